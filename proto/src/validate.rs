//! Ranges and references of a scene file. Everything behind this door may rely on them.

use crate::field::FieldError;
use crate::scene_file::{limits::*, *};

type Checked = Result<(), FieldError>;

pub(crate) fn scene(scene: &SceneFile) -> Checked {
    if scene.version != SCENE_VERSION {
        return Err(FieldError::new("version", format!("must be {SCENE_VERSION}, got {}", scene.version)));
    }
    volume(&scene.volume)?;
    ascending("value_range", scene.value_range)?;
    if let Some(spacing) = scene.spacing {
        for (axis, &length) in spacing.iter().enumerate() {
            within(&format!("spacing[{axis}]"), length, 1e-9, MAX_MAGNITUDE)?;
        }
    }
    within("density", scene.density, 0.0, MAX_MAGNITUDE)?;
    transfer_function(scene)?;
    at_most("materials", scene.materials.len(), MAX_MATERIALS)?;
    for (name, value) in &scene.materials {
        material(&format!("materials.{name}"), value)?;
    }
    lights(&scene.lights)?;
    if let Some(value) = &scene.camera {
        camera(value)?;
    }
    clip(&scene.clip)?;
    if let Background::Color(color) = scene.background {
        each("background", &color, 0.0, MAX_MAGNITUDE)?;
    }
    let illumination = &scene.illumination;
    let (paths, longest) = (illumination.paths_per_pixel, illumination.longest_path);
    within("illumination.paths_per_pixel", f64::from(paths), 1.0, f64::from(MAX_PATHS_PER_PIXEL))?;
    within("illumination.max_error", illumination.max_error, 0.0, 1.0)?;
    within("illumination.longest_path", f64::from(longest), 1.0, f64::from(MAX_PATH_LENGTH))?;
    within("illumination.photons", f64::from(illumination.photons), 1.0, f64::from(MAX_PHOTONS))?;
    within("illumination.photon_events", f64::from(illumination.photon_events), 1.0, 256.0)?;
    within("illumination.photon_grid", f64::from(illumination.photon_grid), 4.0, 256.0)?;
    within("illumination.photon_bands", f64::from(illumination.photon_bands), 0.0, f64::from(MAX_BANDS))?;
    within("illumination.direct_grid", f64::from(illumination.direct_grid), 4.0, 256.0)?;
    within("illumination.light_grid", illumination.light_grid, 0.01, 2.0)?;
    within("illumination.light_bands", f64::from(illumination.light_bands), 1.0, 6.0)?;
    within("illumination.explicit_steps", f64::from(illumination.explicit_steps), 1.0, 100.0)?;
    within("illumination.heat_spread", illumination.heat_spread, 0.0, 1.0)?;
    within("illumination.max_residual", illumination.max_residual, 1e-5, 0.5)?;
    within("illumination.records", f64::from(illumination.records), 2.0, f64::from(MAX_RECORDS))?;
    let directions = illumination.record_directions;
    require("illumination.record_directions", RECORD_DIRECTIONS.contains(&directions), || {
        format!("must be 12, 48, 192 or 768, got {directions}")
    })?;
    within("illumination.record_bands", f64::from(illumination.record_bands), 1.0, f64::from(MAX_BANDS))?;
    within("illumination.record_exchange", f64::from(illumination.record_exchange), 0.0, 64.0)?;
    transfer(illumination)?;
    let sampling = &scene.sampling;
    within("sampling.step_voxels", sampling.step_voxels, 1.0 / 16.0, 8.0)?;
    within("sampling.samples_per_pixel", f64::from(sampling.samples_per_pixel), 1.0, 4096.0)?;
    within("sampling.termination_transmittance", sampling.termination_transmittance, 0.0, 0.5)?;
    within("sampling.segments", f64::from(sampling.segments), 0.0, f64::from(MAX_SEGMENTS))?;
    if let Some(value) = scene.rendering.isovalue {
        within("rendering.isovalue", value, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
    }
    ascending("rendering.window", scene.rendering.window)?;
    direction("rendering.slice.normal", &scene.rendering.slice.normal)?;
    within("rendering.slice.offset", scene.rendering.slice.offset, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
    within("film.exposure_stops", scene.film.exposure_stops, -20.0, 20.0)?;
    within("image.width", f64::from(scene.image.width), 1.0, f64::from(MAX_IMAGE_EDGE))?;
    within("image.height", f64::from(scene.image.height), 1.0, f64::from(MAX_IMAGE_EDGE))
}

/// Settings of method `precomputed_transfer`.
fn transfer(illumination: &Illumination) -> Checked {
    let (lights, directions) = (illumination.transfer_lights, illumination.transfer_directions);
    require("illumination.transfer_lights", TRANSFER_LIGHTS.contains(&lights), || {
        format!("must be 42, 162 or 642, got {lights}")
    })?;
    require("illumination.transfer_directions", TRANSFER_DIRECTIONS.contains(&directions), || {
        format!("must be 48, 192, 768 or 3072, got {directions}")
    })?;
    let whole = |field: &str, value: u32, low: f64, high: f64| {
        within(&format!("illumination.transfer_{field}"), f64::from(value), low, high)
    };
    whole("grid", illumination.transfer_grid, 4.0, 128.0)?;
    whole("photons", illumination.transfer_photons, 1.0, f64::from(MAX_PHOTONS))?;
    whole("events", illumination.transfer_events, 1.0, 256.0)?;
    whole("bands", illumination.transfer_bands, 1.0, f64::from(MAX_BANDS))?;
    let clusters = illumination.transfer_clusters;
    require("illumination.transfer_clusters", clusters == 0 || (32..=256).contains(&clusters), || {
        format!("must be 0 or from 32 to 256, got {clusters}")
    })
}

fn ascending(field: &str, interval: Option<[f64; 2]>) -> Checked {
    let Some([low, high]) = interval else { return Ok(()) };
    finite(&format!("{field}[0]"), low)?;
    finite(&format!("{field}[1]"), high)?;
    require(field, low < high, || format!("must ascend, got [{low}, {high}]"))
}

fn volume(volume: &VolumeSource) -> Checked {
    let given = [volume.file.is_some(), volume.builtin.is_some(), volume.dataset.is_some()];
    require("volume", given.iter().filter(|&&g| g).count() == 1, || {
        "needs exactly one of `file`, `builtin`, `dataset`".into()
    })?;
    if let Some(dims) = volume.dims {
        for (axis, &edge) in dims.iter().enumerate() {
            within(&format!("volume.dims[{axis}]"), f64::from(edge), 1.0, f64::from(MAX_VOLUME_EDGE))?;
        }
    }
    let raw_keys = [
        ("type", volume.voxel_type.is_some()),
        ("endian", volume.endian.is_some()),
        ("header_bytes", volume.header_bytes.is_some()),
    ];
    for (key, given) in raw_keys {
        require(&format!("volume.{key}"), !given || volume.file.is_some(), || {
            "describes a raw file; there is no `file`".into()
        })?;
    }
    require("volume.dims", volume.dims.is_none() || volume.dataset.is_none(), || {
        "a dataset has its own size".into()
    })?;
    if let Some(level) = volume.level {
        within("volume.level", f64::from(level), 0.0, f64::from(MAX_LEVEL))?;
    }
    if let Some([low, high]) = &volume.region {
        each("volume.region[0]", low, 0.0, 1.0)?;
        each("volume.region[1]", high, 0.0, 1.0)?;
        for axis in 0..3 {
            require(&format!("volume.region[1][{axis}]"), high[axis] - low[axis] >= MIN_REGION_EDGE, || {
                "must be above the lower corner".into()
            })?;
        }
    }
    Ok(())
}

fn transfer_function(scene: &SceneFile) -> Checked {
    let points = &scene.transfer_function.points;
    require("transfer_function.points", !points.is_empty(), || "needs at least one point".into())?;
    at_most("transfer_function.points", points.len(), MAX_TRANSFER_FUNCTION_POINTS)?;
    for (index, point) in points.iter().enumerate() {
        let at = |key: &str| format!("transfer_function.points[{index}].{key}");
        within(&at("s"), point.s, 0.0, 1.0)?;
        if let Some(before) = index.checked_sub(1).map(|i| points[i].s) {
            require(&at("s"), point.s >= before, || format!("must ascend, got {} after {before}", point.s))?;
        }
        match (point.extinction, point.opacity) {
            (Some(extinction), None) => within(&at("extinction"), extinction, 0.0, MAX_MAGNITUDE)?,
            (None, Some(opacity)) => within(&at("opacity"), opacity, 0.0, 1.0)?,
            (Some(_), Some(_)) => {
                return Err(FieldError::new(at("opacity"), "is an alternative to `extinction`; give one"));
            }
            (None, None) => {
                return Err(FieldError::new(at("extinction"), "is missing (or give `opacity`)"));
            }
        }
        each(&at("albedo"), &point.albedo, 0.0, 1.0)?;
        each(&at("emission"), &point.emission, 0.0, MAX_MAGNITUDE)?;
        if let Some(name) = &point.material {
            // `default` may be named without being defined: it is then isotropic.
            let known = name == "default" || scene.materials.contains_key(name);
            require(&at("material"), known, || format!("`{name}` is not in `materials`"))?;
        }
    }
    Ok(())
}

fn material(path: &str, material: &Material) -> Checked {
    match &material.phase {
        Phase::Isotropic => {}
        Phase::HenyeyGreenstein(p) => within(&format!("{path}.phase.g"), p.g, -0.999, 0.999)?,
        Phase::Schlick(p) => within(&format!("{path}.phase.k"), p.k, -0.999, 0.999)?,
    }
    within(&format!("{path}.surface"), material.surface, 0.0, 1.0)?;
    let at = |key: &str| format!("{path}.brdf.{key}");
    match &material.brdf {
        None => require(&format!("{path}.brdf"), material.surface == 0.0, || {
            "is missing while `surface` > 0".into()
        }),
        Some(Brdf::Lambert(b)) => within(&at("diffuse"), b.diffuse, 0.0, 1.0),
        Some(Brdf::BlinnPhong(b)) => {
            within(&at("diffuse"), b.diffuse, 0.0, 1.0)?;
            within(&at("specular"), b.specular, 0.0, 1.0)?;
            within(&at("exponent"), b.exponent, 0.0, 1e4)
        }
        Some(Brdf::AshikhminShirley(b)) => {
            within(&at("diffuse"), b.diffuse, 0.0, 1.0)?;
            within(&at("specular"), b.specular, 0.0, 1.0)?;
            each(&at("exponents"), &b.exponents, 0.0, 1e4)
        }
        Some(Brdf::Abc(b)) => {
            within(&at("diffuse"), b.diffuse, 0.0, 1.0)?;
            within(&at("a"), b.a, 0.0, 1e6)?;
            within(&at("b"), b.b, 0.0, 1e6)?;
            within(&at("c"), b.c, 0.0, 1e3)
        }
    }
}

fn lights(lights: &[Light]) -> Checked {
    at_most("lights", lights.len(), MAX_LIGHTS)?;
    let mut ids = std::collections::BTreeSet::new();
    let mut environments = 0;
    for (index, light) in lights.iter().enumerate() {
        let at = |key: &str| format!("lights[{index}].{key}");
        let id = light.id().map_or_else(|| index.to_string(), str::to_owned);
        require(&at("id"), !id.is_empty() && id.len() <= 64, || "must have 1 to 64 characters".into())?;
        require(&at("id"), ids.insert(id.clone()), || format!("`{id}` names another light already"))?;
        let power = |key: &str, value: &Triple| each(&at(key), value, 0.0, MAX_MAGNITUDE);
        let place = |key: &str, value: &Triple| each(&at(key), value, -MAX_MAGNITUDE, MAX_MAGNITUDE);
        match light {
            Light::Directional(l) => {
                direction(&at("direction"), &l.direction)?;
                power("irradiance", &l.irradiance)?;
            }
            Light::Point(l) => {
                place("position", &l.position)?;
                power("intensity", &l.intensity)?;
            }
            Light::Spot(l) => {
                place("position", &l.position)?;
                direction(&at("direction"), &l.direction)?;
                power("intensity", &l.intensity)?;
                each(&at("cone_degrees"), &l.cone_degrees, 0.0, 180.0)?;
                require(&at("cone_degrees"), l.cone_degrees[0] <= l.cone_degrees[1], || {
                    "must ascend".into()
                })?;
            }
            Light::Rectangle(l) => {
                place("center", &l.center)?;
                basis(&at("normal"), &l.normal, &at("up"), &l.up)?;
                each(&at("size"), &l.size, 0.0, MAX_MAGNITUDE)?;
                power("radiance", &l.radiance)?;
            }
            Light::Disk(l) => {
                place("center", &l.center)?;
                direction(&at("normal"), &l.normal)?;
                within(&at("radius"), l.radius, 0.0, MAX_MAGNITUDE)?;
                power("radiance", &l.radiance)?;
            }
            Light::Sphere(l) => {
                place("center", &l.center)?;
                within(&at("radius"), l.radius, 0.0, MAX_MAGNITUDE)?;
                power("radiance", &l.radiance)?;
            }
            Light::Environment(l) => {
                environments += 1;
                require(&format!("lights[{index}]"), environments == 1, || {
                    "is a second environment; a scene has at most one".into()
                })?;
                require(&at("radiance"), l.radiance.is_some() != l.image.is_some(), || {
                    "or `image`: exactly one is needed".into()
                })?;
                if let Some(radiance) = &l.radiance {
                    power("radiance", radiance)?;
                }
                if let Some(scale) = l.scale {
                    within(&at("scale"), scale, 0.0, MAX_MAGNITUDE)?;
                }
                if let Some(rotation) = &l.rotation_degrees {
                    each(&at("rotation_degrees"), rotation, -36000.0, 36000.0)?;
                }
            }
        }
    }
    Ok(())
}

fn camera(camera: &Camera) -> Checked {
    each("camera.position", &camera.position, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
    each("camera.target", &camera.target, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
    let view: Triple = std::array::from_fn(|i| camera.target[i] - camera.position[i]);
    require("camera.target", length(&view) > 1e-9, || "must differ from `position`".into())?;
    basis("camera.target", &view, "camera.up", &camera.up)?;
    match (camera.fov_y_degrees, camera.orthographic_height) {
        (Some(fov), None) => within("camera.fov_y_degrees", fov, 0.1, 179.0),
        (None, Some(height)) => within("camera.orthographic_height", height, 1e-6, MAX_MAGNITUDE),
        (None, None) => {
            Err(FieldError::new("camera.fov_y_degrees", "is missing (or give `orthographic_height`)"))
        }
        (Some(_), Some(_)) => Err(FieldError::new(
            "camera.orthographic_height",
            "is an alternative to `fov_y_degrees`; give one",
        )),
    }
}

fn clip(clip: &Clip) -> Checked {
    if let Some([low, high]) = &clip.bounds {
        each("clip.box[0]", low, 0.0, 1.0)?;
        each("clip.box[1]", high, 0.0, 1.0)?;
        for axis in 0..3 {
            require(&format!("clip.box[1][{axis}]"), low[axis] <= high[axis], || {
                "must not be below the lower corner".into()
            })?;
        }
    }
    at_most("clip.planes", clip.planes.len(), MAX_CLIP_PLANES)?;
    for (index, plane) in clip.planes.iter().enumerate() {
        direction(&format!("clip.planes[{index}].normal"), &plane.normal)?;
        within(&format!("clip.planes[{index}].offset"), plane.offset, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
    }
    Ok(())
}

fn require(field: &str, holds: bool, message: impl FnOnce() -> String) -> Checked {
    if holds { Ok(()) } else { Err(FieldError::new(field, message())) }
}

fn at_most(field: &str, count: usize, most: usize) -> Checked {
    require(field, count <= most, || format!("has {count} entries, at most {most} are allowed"))
}

fn finite(field: &str, value: f64) -> Checked {
    require(field, value.is_finite(), || format!("must be finite, got {value}"))
}

fn within(field: &str, value: f64, low: f64, high: f64) -> Checked {
    let holds = value.is_finite() && (low..=high).contains(&value);
    require(field, holds, || match (low, high) {
        (0.0, MAX_MAGNITUDE) => format!("must be finite and >= 0 (at most {high:e}), got {value}"),
        _ => format!("must be from {low} to {high}, got {value}"),
    })
}

fn each(field: &str, values: &[f64], low: f64, high: f64) -> Checked {
    for (index, &value) in values.iter().enumerate() {
        within(&format!("{field}[{index}]"), value, low, high)?;
    }
    Ok(())
}

fn length(v: &Triple) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn direction(field: &str, value: &Triple) -> Checked {
    each(field, value, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
    require(field, length(value) > 1e-9, || "must not be the zero vector".into())
}

/// `up` must not be parallel to `normal`.
fn basis(normal_field: &str, normal: &Triple, up_field: &str, up: &Triple) -> Checked {
    direction(normal_field, normal)?;
    direction(up_field, up)?;
    let cross = [
        normal[1] * up[2] - normal[2] * up[1],
        normal[2] * up[0] - normal[0] * up[2],
        normal[0] * up[1] - normal[1] * up[0],
    ];
    require(up_field, length(&cross) > 1e-6 * length(normal) * length(up), || {
        format!("must not be parallel to {normal_field}")
    })
}
