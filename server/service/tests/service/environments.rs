//! Environments: uploads, samples, and scenes lit by them.

use axum::http::Method;
use serde_json::{Value, json};

use crate::support::{Service, small_scene};

/// A Radiance HDR picture of one colour, RGBE without run lengths.
fn hdr(width: usize, height: usize, rgbe: [u8; 4]) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    bytes.extend(std::iter::repeat_n(rgbe, width * height).flatten());
    bytes
}

fn lit_by(image: &str) -> Value {
    let mut scene = small_scene();
    scene["lights"] = json!([{"type": "environment", "image": image}]);
    scene["illumination"] = json!({"method": "path_traced", "paths_per_pixel": 8});
    scene
}

async fn snapshot(service: &Service, scene: Value) -> image::RgbImage {
    let session = service.json(Method::POST, "/sessions", json!({ "scene": scene })).await.ok().json();
    let path = format!("/sessions/{}/snapshot?width=24&height=24", session["id"].as_str().unwrap());
    image::load_from_memory(&service.get(&path).await.ok().body).unwrap().to_rgb8()
}

#[tokio::test]
async fn samples_light_scenes_and_have_previews() {
    let service = Service::new();
    let listed = service.get("/environments").await.ok().json();
    for environment in listed.as_array().unwrap() {
        let mean = environment["mean_radiance"].as_array().unwrap();
        let mean = mean.iter().map(|channel| channel.as_f64().unwrap()).sum::<f64>() / 3.0;
        assert!((0.45..0.65).contains(&mean), "{environment}");
    }
    let ids: Vec<&str> = listed.as_array().unwrap().iter().map(|e| e["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["studio", "clear-sky", "overcast"]);
    let mut pictures = Vec::new();
    for id in ids {
        let preview = service.get(&format!("/environments/{id}/preview")).await.ok();
        let preview = image::load_from_memory(&preview.body).unwrap().to_rgb8();
        assert_eq!(preview.dimensions(), (256, 128));
        let mean =
            preview.as_raw().iter().map(|x| f64::from(*x)).sum::<f64>() / preview.as_raw().len() as f64;
        assert!((40.0..200.0).contains(&mean), "{id}: {mean}");
        pictures.push(snapshot(&service, lit_by(id)).await);
    }
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
    service.delete("/environments/studio").await.problem(403);
}

#[tokio::test]
async fn an_uploaded_environment_shines_as_its_texels_say() {
    let service = Service::new();
    let bytes = hdr(16, 8, [128, 64, 32, 129]);
    let answer = service.put("/environments/room.hdr", bytes.clone()).await;
    assert_eq!(answer.status, 201);
    let stored = answer.json();
    assert_eq!((stored["name"].as_str(), stored["width"].as_u64()), (Some("room.hdr"), Some(16)));
    assert_eq!(service.put("/environments/again.hdr", bytes).await.status, 200);
    // 128 / 256 of two to the exponent, and so on.
    assert_eq!(stored["mean_radiance"], json!([1.0, 0.5, 0.25]));
    let id = stored["id"].as_str().unwrap();
    // One colour everywhere is a uniform environment of that radiance.
    let by_image = snapshot(&service, lit_by(id)).await;
    let mut uniform = lit_by(id);
    uniform["lights"] = json!([{"type": "environment", "radiance": [1.0, 0.5, 0.25]}]);
    let mean = |picture: &image::RgbImage, channel: usize| {
        picture.pixels().map(|pixel| f64::from(pixel.0[channel])).sum::<f64>() / f64::from(24 * 24)
    };
    let by_radiance = snapshot(&service, uniform).await;
    for channel in 0..3 {
        let (a, b) = (mean(&by_image, channel), mean(&by_radiance, channel));
        assert!(a > 3.0 && (a - b).abs() < 0.1 * b, "{channel}: {a} {b}");
    }

    // It is there after a restart, and the session that names it is, too.
    let session = service.json(Method::POST, "/sessions", json!({"scene": lit_by(id)})).await.ok().json();
    let folder = service.stopped().await;
    std::fs::write(folder.path().join("data/environments/0123.image"), b"left by a crash").unwrap();
    let service = Service::in_folder(folder, |_| {});
    assert!(!service.folder.path().join("data/environments/0123.image").exists());
    service.get(&format!("/sessions/{}", session["id"].as_str().unwrap())).await.ok();
    service.delete(&format!("/environments/{id}")).await.ok();
    service.delete(&format!("/environments/{id}")).await.problem(404);
    let refused = service.json(Method::POST, "/sessions", json!({"scene": lit_by(id)})).await.problem(422);
    assert_eq!(refused.field.as_deref(), Some("scene.lights[0].image"));
    assert_eq!(std::fs::read_dir(service.folder.path().join("data/environments")).unwrap().count(), 0);
}

#[tokio::test]
async fn what_is_no_environment_is_refused_in_words() {
    let service = Service::with(|config| {
        config.limits.max_environments = 1;
        config.limits.max_environment_bytes = 4096;
    });
    let cut = hdr(16, 8, [1, 2, 3, 128])[..200].to_vec();
    for (name, bytes, status) in [
        ("a.hdr", b"not a picture".to_vec(), 422),
        ("cut.hdr", cut, 422),
        ("empty.hdr", Vec::new(), 422),
        ("large.hdr", vec![0; 5000], 413),
    ] {
        service.put(&format!("/environments/{name}"), bytes).await.problem(status);
    }
    assert_eq!(std::fs::read_dir(service.folder.path().join("data/environments")).unwrap().count(), 0);
    service.put("/environments/one.hdr", hdr(4, 2, [9, 9, 9, 128])).await.ok();
    service.put("/environments/two.hdr", hdr(4, 2, [8, 9, 9, 128])).await.problem(507);
    // A method that cannot use images says so.
    let mut local = lit_by("studio");
    local["illumination"] = json!({"method": "local"});
    let refused = service.json(Method::POST, "/sessions", json!({ "scene": local })).await.problem(422);
    assert!(refused.detail.contains("environment images"), "{}", refused.detail);
    // The field is the light's place in the scene, whatever it is called and whichever others are off.
    local["lights"] = json!([
        {"id": "off", "type": "point", "position": [0, 2, 0], "intensity": [1, 1, 1], "enabled": false},
        {"id": "dome", "type": "environment", "image": "studio"}
    ]);
    let refused = service.json(Method::POST, "/sessions", json!({ "scene": local })).await.problem(422);
    assert_eq!(refused.field.as_deref(), Some("scene.lights[1].image"));
    // What shows data and not light does not mind; an isosurface is lit as `local` lights.
    for (rendering, status) in
        [(json!({"mode": "maximum"}), 201), (json!({"mode": "isosurface", "isovalue": 0.5}), 422)]
    {
        let mut scene = lit_by("studio");
        scene["rendering"] = rendering;
        let answer = service.json(Method::POST, "/sessions", json!({ "scene": scene })).await;
        assert_eq!(answer.status, status, "{}", String::from_utf8_lossy(&answer.body));
        if status == 422 {
            assert!(answer.problem(422).detail.starts_with("an isosurface"));
        }
    }
    service.get("/environments/..%2F..%2Fetc/preview").await.problem(404);
}
