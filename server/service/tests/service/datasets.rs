//! Samples and stored datasets: what is told about them.

use axum::http::{Method, Request, StatusCode, header};
use proto::rest::{Dataset, Histogram};
use proto::scene_file::SceneFile;
use serde_json::json;

use crate::support::{Service, nrrd};

#[tokio::test]
async fn the_list_has_every_sample_and_then_uploads() {
    let service = Service::new();
    service.put("/datasets/ball.nrrd", nrrd(0)).await.ok();
    let datasets: Vec<Dataset> = serde_json::from_slice(&service.get("/datasets").await.ok().body).unwrap();
    for name in ["pillars", "homogeneous", "stent", "avm"] {
        let sample = datasets.iter().find(|d| d.id == name).unwrap_or_else(|| panic!("{name}"));
        assert!(sample.sample && sample.bytes > 0);
    }
    let last = datasets.last().unwrap();
    assert!(!last.sample && last.name == "ball" && last.format == "nrrd");
    assert_eq!((last.dims, last.spacing), ([16; 3], [1.0, 1.0, 2.0]));
    assert!(last.created_unix_millis > 1_600_000_000_000);
    let one: Dataset =
        serde_json::from_slice(&service.get(&format!("/datasets/{}", last.id)).await.ok().body).unwrap();
    assert_eq!(one, *last);
}

#[tokio::test]
async fn histograms_count_every_voxel() {
    let service = Service::new();
    let dataset = service.put("/datasets/ball.nrrd", nrrd(0)).await.ok().json();
    let path = format!("/datasets/{}/histogram", dataset["id"].as_str().unwrap());
    let histogram: Histogram = serde_json::from_slice(&service.get(&path).await.ok().body).unwrap();
    assert_eq!(histogram.counts.iter().sum::<u64>(), 16 * 16 * 16);
    assert_eq!((histogram.bin_edges.len(), histogram.bin_shares.len()), (65, 64));
    assert!(histogram.bin_shares.iter().all(|share| (0.0..=1.0).contains(share)));
    assert!(histogram.bin_shares[0] > 0.0 && histogram.bin_shares[63] > 0.0, "both ends occur");
    let range = dataset["value_range"].as_array().unwrap();
    assert_eq!(histogram.value_range, [range[0].as_f64().unwrap(), range[1].as_f64().unwrap()]);
}

#[tokio::test]
async fn an_upload_opens_with_a_scene_that_shows_something() {
    let service = Service::new();
    let dataset = service.put("/datasets/ball.nrrd", nrrd(0)).await.ok().json();
    let id = dataset["id"].as_str().unwrap();
    let scene = service.get(&format!("/datasets/{id}/scene")).await.ok();
    let scene: SceneFile = serde_json::from_slice(&scene.body).unwrap();
    assert_eq!(scene.volume.dataset.as_deref(), Some(id));
    assert!(scene.camera.is_some() && scene.lights.len() >= 2);
    let session = service.json(Method::POST, "/sessions", json!({"dataset": id})).await.ok().json();
    assert_eq!(session["scene"], serde_json::to_value(&scene).unwrap());
    let path = format!("/sessions/{}/snapshot?width=48&height=48", session["id"].as_str().unwrap());
    let png = image::load_from_memory(&service.get(&path).await.ok().body).unwrap().to_rgb8();
    let corner = png.get_pixel(0, 0).0;
    let middle = png.get_pixel(24, 24).0;
    assert!(middle.iter().map(|&c| u32::from(c)).sum::<u32>() > 150, "the ball is lit: {middle:?}");
    assert!(corner.iter().all(|&c| c < 60), "the background is dark: {corner:?}");
}

#[tokio::test]
async fn samples_open_with_their_own_scene() {
    let service = Service::new();
    let scene = service.get("/datasets/pillars/scene").await.ok().json();
    assert_eq!(scene["volume"]["builtin"], "pillars");
    let scene = service.get("/datasets/stent/scene").await.ok().json();
    assert_eq!(scene["volume"]["dataset"], "stent");
    let histogram: Histogram =
        serde_json::from_slice(&service.get("/datasets/stent/histogram").await.ok().body).unwrap();
    assert_eq!(histogram.counts.iter().sum::<u64>(), 128 * 128 * 256);
}

#[tokio::test]
async fn thumbnails_are_drawn_once_and_cached() {
    let service = Service::new();
    let dataset = service.put("/datasets/ball.nrrd", nrrd(0)).await.ok().json();
    let path = format!("/datasets/{}/thumbnail", dataset["id"].as_str().unwrap());
    let first = service.get(&path).await.ok();
    assert_eq!(first.headers[header::CONTENT_TYPE], "image/png");
    let picture = image::load_from_memory(&first.body).unwrap();
    assert_eq!((picture.width(), picture.height()), (192, 144));
    let etag = first.headers[header::ETAG].clone();
    assert_eq!(service.get(&path).await.ok().body, first.body);
    let request = Request::get(format!("/api/v1{path}")).header(header::IF_NONE_MATCH, etag);
    let known = service.send(request.body(axum::body::Body::empty()).unwrap()).await;
    assert_eq!((known.status, known.body.len()), (StatusCode::NOT_MODIFIED, 0));
    let thumbnails = || std::fs::read_dir(service.folder.path().join("data/thumbnails")).unwrap().count();
    assert_eq!(thumbnails(), 1);
    service.delete(&format!("/datasets/{}", dataset["id"].as_str().unwrap())).await.ok();
    assert_eq!(thumbnails(), 0, "deleted with their dataset");
}

#[tokio::test]
async fn samples_cannot_be_deleted_and_uploads_can() {
    let service = Service::new();
    let problem = service.delete("/datasets/pillars").await.problem(403);
    assert_eq!(problem.kind, "/problems/forbidden");
    let id = service.put("/datasets/ball.nrrd", nrrd(0)).await.ok().json()["id"].as_str().unwrap().to_owned();
    assert_eq!(service.delete(&format!("/datasets/{id}")).await.status, StatusCode::NO_CONTENT);
    assert!(service.stored_files().is_empty(), "{:?}", service.stored_files());
    for path in ["", "/histogram", "/thumbnail", "/scene"] {
        service.get(&format!("/datasets/{id}{path}")).await.problem(404);
    }
    service.delete(&format!("/datasets/{id}")).await.problem(404);
}

#[tokio::test]
async fn a_session_keeps_its_volume_when_the_dataset_is_deleted() {
    let service = Service::new();
    let id = service.put("/datasets/ball.nrrd", nrrd(0)).await.ok().json()["id"].as_str().unwrap().to_owned();
    let session = service.json(Method::POST, "/sessions", json!({"dataset": id})).await.ok().json();
    service.delete(&format!("/datasets/{id}")).await.ok();
    let path = format!("/sessions/{}", session["id"].as_str().unwrap());
    service.get(&format!("{path}/snapshot?width=16&height=16")).await.ok();
}

#[tokio::test]
async fn a_restart_keeps_datasets() {
    let service = Service::new();
    let before = service.put("/datasets/ball.nrrd", nrrd(0)).await.ok().json();
    let service = service.restarted().await;
    let id = before["id"].as_str().unwrap();
    assert_eq!(service.get(&format!("/datasets/{id}")).await.ok().json(), before);
    service.get(&format!("/datasets/{id}/histogram")).await.ok();
}
