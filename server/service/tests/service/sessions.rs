//! Sessions over REST.

use axum::http::{Method, StatusCode, header};
use proto::rest::RegionHistogram;
use proto::scene_file::Builtin;
use serde_json::{Value, json};

use crate::support::{Service, small_scene};

#[tokio::test]
async fn a_session_lives_from_post_to_delete() {
    let service = Service::new();
    let session = service.session().await;
    assert_eq!((session.epoch, session.viewers), (1, 0));
    assert!(session.scene.camera.is_some(), "camera filled in");
    assert_eq!(session.id.len(), 32);
    let path = format!("/sessions/{}", session.id);
    assert_eq!(service.get(&path).await.ok().json()["scene"], serde_json::to_value(&session.scene).unwrap());
    let listed = service.get("/sessions").await.ok();
    assert!(!String::from_utf8_lossy(&listed.body).contains(&session.id), "a list lets nobody edit");
    let listed = listed.json();
    assert_eq!(listed.as_array().unwrap().len(), 1);
    assert_eq!((&listed[0]["id"], &listed[0]["role"]), (&json!(session.watch), &json!("watcher")));
    service.delete(&format!("/sessions/{}", session.watch.as_ref().unwrap())).await.problem(403);
    assert_eq!(service.get("/status").await.ok().json()["sessions"], 1);
    assert_eq!(service.delete(&path).await.status, StatusCode::NO_CONTENT);
    for answer in [
        service.get(&path).await,
        service.get(&format!("{path}/scene")).await,
        service.get(&format!("{path}/snapshot")).await,
        service.delete(&path).await,
        service.json(Method::PUT, &format!("{path}/scene"), small_scene()).await,
        service.json(Method::PATCH, &format!("{path}/scene"), json!({})).await,
    ] {
        assert_eq!(answer.problem(404).kind, "/problems/not-found");
    }
}

#[tokio::test]
async fn scenes_are_replaced_and_patched_whole_or_not_at_all() {
    let service = Service::new();
    let session = service.session().await;
    let path = format!("/sessions/{}/scene", session.id);
    let mut scene = small_scene();
    scene["density"] = json!(2.0);
    let answer = service.json(Method::PUT, &path, scene).await.ok().json();
    assert_eq!((answer["epoch"].as_u64(), answer["scene"]["density"].as_f64()), (Some(2), Some(2.0)));
    let answer =
        service.json(Method::PATCH, &path, json!({"film": {"exposure_stops": 1.5}, "density": null})).await;
    let answer = answer.ok().json();
    assert_eq!(answer["scene"]["film"]["exposure_stops"], 1.5);
    assert_eq!(answer["scene"]["density"], 1.0, "null takes a field back to its default");
    let before = service.get(&path).await.ok().json();
    for (patch, field) in [
        (json!({"density": -1}), "density"),
        (json!({"colour": 1}), "colour"),
        (
            json!({"transfer_function": {"points": [{"s": 0, "extinction": -1}]}}),
            "transfer_function.points[0].extinction",
        ),
        (json!({"lights": [{"type": "laser"}]}), "lights[0].type"),
        (json!({"volume": {"builtin": null, "dims": null, "file": "/etc/passwd"}}), "volume.file"),
        (json!({"volume": {"builtin": null, "dims": null, "dataset": "nope"}}), "volume.dataset"),
        (json!({"volume": {"dims": [2048, 2048, 2048]}}), "volume.dims"),
        (json!({"illumination": {"method": "magic"}}), "illumination.method"),
        (json!({"camera": {"up": [0, 0, 0]}}), "camera.up"),
    ] {
        let problem = service.json(Method::PATCH, &path, patch.clone()).await.problem(422);
        let named = problem.field.unwrap_or_default();
        assert!(named == field || field == "colour", "{patch}: {named}: {}", problem.detail);
        assert!(named == field || problem.detail.contains(field), "{patch}: {}", problem.detail);
    }
    assert_eq!(service.get(&path).await.ok().json(), before);
    assert_eq!(service.get(&format!("/sessions/{}", session.id)).await.ok().json()["epoch"], 3);
}

#[tokio::test]
async fn an_edit_may_change_the_volume() {
    let service = Service::new();
    let session = service.session().await;
    let path = format!("/sessions/{}/scene", session.id);
    let patch = json!({"volume": {"builtin": "buckyball", "dims": [20, 20, 20]}});
    let answer = service.json(Method::PATCH, &path, patch).await.ok().json();
    assert_eq!(answer["scene"]["volume"]["builtin"], "buckyball");
    service.get(&format!("/sessions/{}/snapshot", session.id)).await.ok();
}

#[tokio::test]
async fn what_cannot_be_opened_is_refused_by_field() {
    let service = Service::new();
    let mut file_scene = small_scene();
    file_scene["volume"] = json!({"file": "../secret.nrrd"});
    let mut bad_scene = small_scene();
    bad_scene["lights"][0]["irradiance"] = json!([1, -1, 1]);
    for (body, status, field) in [
        (json!({}), 422, "scene"),
        (json!({"scene": small_scene(), "dataset": "pillars"}), 422, "dataset"),
        (json!({"dataset": "nope"}), 422, "dataset"),
        (json!({"scene": file_scene}), 422, "scene.volume.file"),
        (json!({"scene": bad_scene}), 422, "scene.lights[0].irradiance[1]"),
        (json!({"scene": {"version": 1}}), 422, "scene"),
    ] {
        let problem = service.json(Method::POST, "/sessions", body.clone()).await.problem(status);
        assert_eq!(problem.field.as_deref(), Some(field), "{body}: {}", problem.detail);
    }
    let request = axum::http::Request::post("/api/v1/sessions").body("{\"scene\": ".into()).unwrap();
    service.send(request).await.problem(400);
    assert_eq!(service.get("/sessions").await.ok().json(), json!([]));
}

#[tokio::test]
async fn a_pixel_tells_its_place_and_value() {
    let service = Service::new();
    let session = service.session().await;
    let path = format!("/sessions/{}/probe", session.id);
    let slice = json!({"rendering": {"mode": "slice", "slice": {"normal": [0, 0, 1], "offset": 0.25}}});
    service.json(Method::PATCH, &format!("/sessions/{}/scene", session.id), slice).await.ok();
    let camera =
        json!({"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 1});
    let ask = |x: f64, camera: &Value| json!({"camera": camera, "x": x, "y": 20, "width": 40, "height": 40});
    let hit = service.json(Method::POST, &path, ask(30.0, &camera)).await.ok().json()["hit"].clone();
    let position: Vec<f64> = serde_json::from_value(hit["position"].clone()).unwrap();
    for (got, expected) in position.iter().zip([0.25, 0.0, 0.25]) {
        assert!((got - expected).abs() < 1e-9, "{hit}");
    }
    assert!(hit["value"].is_number() && hit["voxel"].as_array().is_some_and(|voxel| voxel.len() == 3));
    let beyond = json!({"camera": camera, "x": 1, "y": 1, "width": 40, "height": 4});
    assert_eq!(service.json(Method::POST, &path, beyond).await.ok().json(), json!({"hit": null}));

    let outside = service.json(Method::POST, &path, ask(41.0, &camera)).await.problem(422);
    assert_eq!(outside.field.as_deref(), Some("x"));
    let blind = json!({"position": [0, 0, 0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40});
    let refused = service.json(Method::POST, &path, ask(1.0, &blind)).await.problem(422);
    assert!(refused.field.is_some_and(|field| field.starts_with("camera")));
}

#[tokio::test]
async fn the_clip_region_has_a_histogram_of_its_own() {
    let service = Service::new();
    let session = service.session().await;
    let [path, scene] = ["histogram", "scene"].map(|part| format!("/sessions/{}/{part}", session.id));
    let whole: RegionHistogram = serde_json::from_slice(&service.get(&path).await.ok().body).unwrap();
    assert_eq!((whole.epoch, whole.counts.iter().sum::<u64>()), (1, 24 * 24 * 24));
    let clip =
        json!({"clip": {"box": [[0, 0, 0], [0.5, 1, 1]], "planes": [{"normal": [0, 0, -2], "offset": 0}]}});
    service.json(Method::PATCH, &scene, clip).await.ok();
    let kept: RegionHistogram = serde_json::from_slice(&service.get(&path).await.ok().body).unwrap();
    assert_eq!((kept.epoch, kept.value_range), (2, whole.value_range));
    assert_eq!(kept.counts.iter().sum::<u64>(), 12 * 24 * 12);
    assert!(kept.counts.iter().zip(&whole.counts).all(|(kept, whole)| kept <= whole));
    service.get("/sessions/none/histogram").await.problem(404);
}

#[tokio::test]
async fn previews_show_a_patch_and_leave_the_session_alone() {
    let service = Service::new();
    let session = service.session().await;
    let path = format!("/sessions/{}/preview", session.id);
    let ask = |patch: Value| json!({"patch": patch, "width": 40, "height": 30});
    let brightness = async |patch: Value| {
        let answer = service.json(Method::POST, &path, ask(patch)).await.ok();
        assert_eq!(answer.headers[header::CONTENT_TYPE], "image/png");
        let picture = image::load_from_memory(&answer.body).unwrap().to_rgb8();
        assert_eq!((picture.width(), picture.height()), (40, 30));
        picture.into_raw().iter().map(|&c| u64::from(c)).sum::<u64>()
    };
    let lit = brightness(json!({})).await;
    assert!(lit > 0);
    let nothing =
        json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}]}, "background": [0, 0, 0]});
    assert_eq!(brightness(nothing).await, 0);
    assert_eq!(brightness(json!({})).await, lit, "the scene is as before");
    assert_eq!(service.get(&format!("/sessions/{}", session.id)).await.ok().json()["epoch"], 1);

    for (body, field) in [
        (ask(json!({"density": -1})), "patch.density"),
        (ask(json!({"volume": {"builtin": "buckyball", "dims": [20, 20, 20]}})), "patch.volume"),
        (ask(json!({"volume": {"builtin": null, "dims": null, "file": "/etc/passwd"}})), "patch.volume.file"),
        (json!({"patch": {}, "width": 0, "height": 30}), "width"),
        (json!({"patch": {}, "width": 40, "height": 513}), "height"),
    ] {
        let problem = service.json(Method::POST, &path, body.clone()).await.problem(422);
        assert_eq!(problem.field.as_deref(), Some(field), "{body}");
    }
    service.json(Method::POST, "/sessions/none/preview", ask(json!({}))).await.problem(404);
}

#[tokio::test]
async fn previews_wait_for_each_other_and_never_fill_the_queue_of_stills() {
    let service = Service::with(|config| config.limits.max_waiting_stills = 1);
    let session = service.session().await;
    let path = format!("/sessions/{}/preview", session.id);
    let body = json!({"patch": {}, "width": 64, "height": 64});
    let previews = (0..5).map(|_| service.json(Method::POST, &path, body.clone()));
    for answer in futures_util::future::join_all(previews).await {
        answer.ok();
    }
}

#[tokio::test]
async fn stills_come_in_three_formats() {
    let service = Service::new();
    let session = service.session().await;
    let path = format!("/sessions/{}/snapshot", session.id);
    let png = service.get(&path).await.ok();
    assert_eq!(png.headers[header::CONTENT_TYPE], "image/png");
    let picture = image::load_from_memory(&png.body).unwrap().to_rgb8();
    assert_eq!((picture.width(), picture.height()), (64, 48), "the scene's own size");
    assert!(picture.pixels().any(|pixel| pixel.0.iter().any(|&c| c > 100)), "something is lit");

    let exr = service.get(&format!("{path}?format=exr&width=40&height=30")).await.ok();
    let exr =
        image::load_from_memory_with_format(&exr.body, image::ImageFormat::OpenExr).unwrap().to_rgb32f();
    assert_eq!((exr.width(), exr.height()), (40, 30));
    let npy = service.get(&format!("{path}?format=npy&width=40&height=30")).await.ok().body;
    assert!(npy.starts_with(b"\x93NUMPY\x01\x00"));
    let data = &npy[npy.len() - 40 * 30 * 3 * 4..];
    let npy: Vec<f32> = data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(npy, exr.into_raw(), "both hold the same linear values");
    assert!(npy.iter().any(|&x| x > 0.1));
}

#[tokio::test]
async fn impossible_stills_are_refused() {
    let service = Service::with(|config| config.limits.max_waiting_stills = 0);
    let session = service.session().await;
    let path = format!("/sessions/{}/snapshot", session.id);
    for (query, field) in
        [("width=0", "width"), ("height=9000", "height"), ("width=8000&height=8000", "width")]
    {
        let problem = service.get(&format!("{path}?{query}")).await.problem(422);
        assert_eq!(problem.field.as_deref(), Some(field));
    }
    service.get(&format!("{path}?format=gif")).await.problem(400);
    service.get(&format!("{path}?size=3")).await.problem(400);
    service.get(&format!("{path}?width=-3")).await.problem(400);
    service.get(&path).await.problem(503);
    let service = Service::with(|config| config.limits.still_seconds = 0);
    let session = service.session().await;
    service.get(&format!("/sessions/{}/snapshot", session.id)).await.problem(504);
}

#[tokio::test]
async fn the_service_describes_itself() {
    let service = Service::new();
    let status = service.get("/status").await.ok().json();
    assert_eq!(
        status["methods"],
        json!([
            "local",
            "convection_diffusion",
            "image_based",
            "precomputed_transfer",
            "photon_map",
            "path_traced"
        ])
    );
    assert!(!status["device"]["name"].as_str().unwrap().is_empty());
    let document = service.get("/openapi.json").await.ok().json();
    assert!(document["openapi"].as_str().unwrap().starts_with("3."));
    for (path, methods) in [
        ("/status", vec!["get"]),
        ("/datasets", vec!["get", "post"]),
        ("/datasets/{id}", vec!["get", "put", "delete"]),
        ("/datasets/{id}/histogram", vec!["get"]),
        ("/datasets/{id}/thumbnail", vec!["get"]),
        ("/datasets/{id}/scene", vec!["get"]),
        ("/sessions", vec!["get", "post"]),
        ("/sessions/{id}", vec!["get", "delete"]),
        ("/sessions/{id}/scene", vec!["get", "put", "patch"]),
        ("/sessions/{id}/probe", vec!["post"]),
        ("/sessions/{id}/histogram", vec!["get"]),
        ("/sessions/{id}/preview", vec!["post"]),
        ("/sessions/{id}/snapshot", vec!["get"]),
        ("/sessions/{id}/view", vec!["get"]),
    ] {
        for method in methods {
            assert!(document["paths"][path][method].is_object(), "{method} {path}");
        }
    }
    let schemas = &document["components"]["schemas"];
    for name in ["Dataset", "Session", "SceneFile", "Problem", "ClientMessage", "ServerMessage", "Histogram"]
    {
        assert!(schemas[name].is_object(), "{name}");
    }
    assert_references(&document, schemas);
}

/// Every `$ref` of the document leads somewhere.
fn assert_references(value: &serde_json::Value, schemas: &serde_json::Value) {
    match value {
        serde_json::Value::Object(fields) => {
            if let Some(reference) = fields.get("$ref").and_then(|r| r.as_str()) {
                let name = reference.strip_prefix("#/components/schemas/").unwrap_or(reference);
                assert!(schemas[name].is_object(), "{reference} leads nowhere");
            }
            fields.values().for_each(|field| assert_references(field, schemas));
        }
        serde_json::Value::Array(items) => items.iter().for_each(|item| assert_references(item, schemas)),
        _ => {}
    }
}

#[tokio::test]
async fn every_builtin_can_be_opened_small() {
    let service = Service::new();
    for kind in Builtin::ALL {
        let mut scene = service.get(&format!("/datasets/{}/scene", kind.name())).await.ok().json();
        scene["volume"]["dims"] = json!([12, 12, 12]);
        let answer = service.json(Method::POST, "/sessions", json!({"scene": scene})).await.ok().json();
        let path = format!("/sessions/{}/snapshot?width=16&height=16", answer["id"].as_str().unwrap());
        service.get(&path).await.ok();
    }
}
