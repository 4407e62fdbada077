//! What operators see: metrics, health, and memory that is kept within its bounds.

use axum::body::Body;
use axum::http::{Method, Request};
use serde_json::json;

use crate::support::{Answer, Service, camera_at, small_scene};

async fn root(service: &Service, path: &str) -> Answer {
    service.send(Request::get(path).body(Body::empty()).unwrap()).await
}

/// The sum of a metric's samples whose labels hold `label`.
async fn metric(service: &Service, name: &str, label: &str) -> f64 {
    let text = String::from_utf8(root(service, "/metrics").await.ok().body).unwrap();
    let samples = text.lines().filter_map(|line| {
        let (series, value) = line.rsplit_once(' ')?;
        let (found, labels) = series.split_once('{').unwrap_or((series, ""));
        (found == name && labels.contains(label)).then(|| value.parse::<f64>().unwrap())
    });
    samples.sum()
}

#[tokio::test]
async fn what_happens_is_counted_and_names_nobody() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    viewer.frames_until_final().await;
    // The report follows the frame's bytes, and is counted before it is sent.
    viewer.message().await;
    service.get(&format!("/sessions/{}", session.id)).await.ok();
    service.get("/sessions/no-such-session").await.problem(404);
    assert_eq!(metric(&service, "tyndall_frames_total", "final").await, 1.0);
    assert!(metric(&service, "tyndall_frame_bytes_total", "").await > 100.0);
    for stage in ["queue", "draw", "encode", "send"] {
        assert!(metric(&service, "tyndall_frame_stage_seconds_count", stage).await >= 1.0, "{stage}");
    }
    assert!(metric(&service, "tyndall_work_total", "samples_taken").await > 1000.0);
    assert!(metric(&service, "tyndall_pass_seconds_total", "ray_cast").await > 0.0);
    let found = metric(&service, "tyndall_requests_total", "status=\"404\"").await;
    assert_eq!(found, 1.0);
    assert_eq!(metric(&service, "tyndall_viewers", "").await, 1.0);
    assert_eq!(metric(&service, "tyndall_sessions", "").await, 1.0);
    assert!(metric(&service, "tyndall_gpu_bytes", "views").await >= 64.0 * 48.0 * 20.0);
    assert!(metric(&service, "tyndall_gpu_bytes", "volumes").await > 0.0);
    assert_eq!(metric(&service, "tyndall_voxel_bytes", "").await, f64::from(24 * 24 * 24 * 2));
    let text = String::from_utf8(root(&service, "/metrics").await.ok().body).unwrap();
    assert!(!text.contains(&session.id) && !text.contains("no-such-session"));
    assert!(text.ends_with("# EOF\n"));
}

#[tokio::test]
async fn health_is_told() {
    let service = Service::new();
    root(&service, "/healthz").await.ok();
    root(&service, "/readyz").await.ok();
    let data = service.folder.path().join("data");
    std::fs::rename(&data, data.with_file_name("elsewhere")).unwrap();
    assert!(root(&service, "/readyz").await.problem(503).detail.contains("data directory"));
    std::fs::rename(data.with_file_name("elsewhere"), &data).unwrap();
    root(&service, "/readyz").await.ok();
    service.app.renderer().stop();
    assert!(root(&service, "/readyz").await.problem(503).detail.contains("draws"));
    root(&service, "/healthz").await.ok();
}

#[tokio::test]
async fn the_interface_has_a_page_of_its_own() {
    let service = Service::new();
    let page = root(&service, "/api/docs/").await.ok();
    let text = String::from_utf8(page.body).unwrap();
    for asset in ["swagger-ui.css", "swagger-ui-bundle.js", "swagger-initializer.js"] {
        assert!(text.contains(asset), "{text}");
        root(&service, &format!("/api/docs/{asset}")).await.ok();
    }
    let start = root(&service, "/api/docs/swagger-initializer.js").await.ok().body;
    assert!(String::from_utf8(start).unwrap().contains("/api/v1/openapi.json"));
    assert!(!text.contains("http://") && !text.contains("https://"), "everything comes from here: {text}");
}

/// Film and picture of a viewer, 256 x 192 pixels.
const VIEW_BYTES: u64 = 256 * 192 * 20;

#[tokio::test]
async fn pictures_that_nobody_needs_give_way_and_are_made_again() {
    let budget = 5 * VIEW_BYTES / 2;
    let service = Service::with(|config| config.limits.max_gpu_bytes = budget);
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewers = Vec::new();
    for index in 0..4 {
        let mut viewer = listening.viewer(&session.id).await;
        viewer.viewport(1, 256, 192).await;
        viewer.camera(2, camera_at(f64::from(index) * 40.0)).await;
        let last = loop {
            let last = viewer.frames_until_final().await.pop().unwrap();
            if last.header.seq == 2 {
                break last;
            }
        };
        viewers.push((viewer, last));
        // Charged after the slice that drew the frame.
        service.get("/status").await.ok();
        let used = metric(&service, "tyndall_gpu_bytes", "").await;
        assert!(used <= budget as f64 + VIEW_BYTES as f64, "{used} of {budget}");
    }
    // One copy of the volume for all of them, and no more views than fit.
    assert!(metric(&service, "tyndall_gpu_bytes", "views").await <= budget as f64);
    assert!(metric(&service, "tyndall_gpu_bytes", "volumes").await < VIEW_BYTES as f64 / 2.0);
    // The first one's film is gone; an edit draws it anew, as it was and back.
    let (viewer, before) = &mut viewers[0];
    viewer.camera(3, camera_at(10.0)).await;
    assert_ne!(viewer.frames_until_final().await.pop().unwrap().pixels(), before.pixels());
    viewer.camera(4, camera_at(0.0)).await;
    assert_eq!(viewer.frames_until_final().await.pop().unwrap().pixels(), before.pixels());
}

#[tokio::test]
async fn a_volume_without_room_is_shown_coarser_and_then_refused() {
    let scene = |edge: u32| {
        let mut scene = small_scene();
        scene["volume"]["dims"] = json!([edge, edge, edge]);
        json!({ "scene": scene })
    };
    // The voxels have 16 bits.
    let service = Service::with(|config| config.limits.max_gpu_bytes = 24 * 24 * 24 * 2 + 10_000);
    let whole = service.json(Method::POST, "/sessions", scene(24)).await.ok().json();
    assert!(whole["shown"].is_null());
    let listening = service.listen().await;
    let mut viewer = listening.viewer(whole["id"].as_str().unwrap()).await;
    viewer.viewport(1, 16, 16).await;
    viewer.frames_until_final().await;
    let second = service.json(Method::POST, "/sessions", scene(20)).await.ok().json();
    let notice = second["shown"]["notice"].as_str().unwrap();
    assert!(notice.contains("no room"), "{notice}");
    // The first one lets go: there is room.
    drop(viewer);
    service.delete(&format!("/sessions/{}", whole["id"].as_str().unwrap())).await.ok();
    let nothing = Service::with(|config| config.limits.max_gpu_bytes = 1);
    nothing.json(Method::POST, "/sessions", scene(24)).await.problem(503);
}
