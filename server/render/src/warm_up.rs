//! Scenes that make the pipelines of everyday scenes compile.

/// A lit scene whose matter has a surface or none, and emits or not.
pub(crate) fn warm_up_scene(surface: f64, emission: f64) -> proto::SceneFile {
    use proto::scene_file as file;
    let source =
        file::VolumeSource { builtin: Some(file::Builtin::Homogeneous), ..file::VolumeSource::default() };
    let mut scene = proto::SceneFile::new(source);
    // What default scenes and samples use.
    let brdf = Some(file::Brdf::BlinnPhong(file::BlinnPhong { diffuse: 0.9, specular: 0.1, exponent: 30.0 }));
    scene.materials.insert("m".into(), file::Material { surface, brdf, ..file::Material::default() });
    for point in &mut scene.transfer_function.points {
        point.material = Some("m".into());
        point.emission = [emission; 3];
    }
    let (direction, irradiance) = ([0.0, 0.0, -1.0], [1.0; 3]);
    let light = file::DirectionalLight { id: None, enabled: true, direction, irradiance };
    scene.lights.push(file::Light::Directional(light));
    scene
}
