//! Volumes that are larger than what the device may hold.

use axum::http::Method;
use proto::control::{ClientMessage, ServerMessage};
use proto::rest::{Session, ShownVolume};
use serde_json::{Value, json};

use crate::support::{Service, nrrd, small_scene};

/// Room for an eighth of the 16^3 voxels of [`nrrd`], but not for all of them.
fn narrow() -> Service {
    Service::with(|config| config.limits.max_texture_bytes = 2000)
}

/// Uploads a ball and opens it.
async fn open(service: &Service) -> Session {
    let dataset = service.put("/datasets/ball.nrrd", nrrd(2)).await.ok().json();
    let answer = service.json(Method::POST, "/sessions", json!({"dataset": dataset["id"]})).await;
    serde_json::from_slice(&answer.ok().body).unwrap()
}

async fn patched(service: &Service, id: &str, patch: Value) -> Option<ShownVolume> {
    let answer = service.json(Method::PATCH, &format!("/sessions/{id}/scene"), patch).await.ok();
    serde_json::from_slice::<Session>(&answer.body).unwrap().shown
}

const REGION: [[f64; 3]; 2] = [[0.25, 0.25, 0.25], [0.6, 0.6, 0.6]];

#[tokio::test]
async fn a_volume_that_does_not_fit_is_shown_coarser_and_a_region_of_it_in_full() {
    let service = narrow();
    let session = open(&service).await;
    let shown = session.shown.unwrap();
    assert_eq!((shown.level, shown.dims, shown.whole_dims), (1, [8, 8, 8], [16, 16, 16]));
    assert_eq!(
        shown.notice,
        "shown at 1/2 resolution (8x8x8 of 16x16x16): the full volume needs 4.1 kB of the 2.0 kB allowed"
    );
    let still = format!("/sessions/{}/snapshot?width=32&height=24", session.id);
    let coarse = service.get(&still).await.ok().body;

    let shown = patched(&service, &session.id, json!({"volume": {"region": REGION}})).await.unwrap();
    assert_eq!((shown.level, shown.dims, shown.region), (0, [10, 10, 10], Some(REGION)));
    assert!(shown.notice.starts_with("region shown at full resolution"), "{}", shown.notice);
    assert_ne!(service.get(&still).await.ok().body, coarse);
    let listed = service.get(&format!("/sessions/{}", session.id)).await.ok().json();
    assert_eq!(listed["shown"], serde_json::to_value(&shown).unwrap());

    let shown = patched(&service, &session.id, json!({"volume": {"region": null}})).await.unwrap();
    assert_eq!((shown.level, shown.region), (1, None));
    assert_eq!(service.get(&still).await.ok().body, coarse, "back to where it was");

    let shown = patched(&service, &session.id, json!({"volume": {"level": 3}})).await.unwrap();
    assert_eq!((shown.level, shown.dims), (3, [2, 2, 2]));
    assert!(shown.notice.ends_with("as the scene asks"), "{}", shown.notice);
    let refused = json!({"volume": {"region": [[0.5, 0, 0], [0.5, 1, 1]]}});
    let path = format!("/sessions/{}/scene", session.id);
    let problem = service.json(Method::PATCH, &path, refused).await.problem(422);
    assert_eq!(problem.field.as_deref(), Some("volume.region[1][0]"));
}

#[tokio::test]
async fn what_is_shown_of_a_dataset_does_not_change_what_it_is() {
    let service = narrow();
    let dataset = service.put("/datasets/ball.nrrd", nrrd(2)).await.ok().json();
    let id = dataset["id"].as_str().unwrap();
    let full = Service::new();
    full.put("/datasets/ball.nrrd", nrrd(2)).await.ok();
    for what in ["scene", "histogram"] {
        let path = format!("/datasets/{id}/{what}");
        assert_eq!(service.get(&path).await.ok().json(), full.get(&path).await.ok().json());
    }
    service.get(&format!("/datasets/{id}/thumbnail")).await.ok();
    let opened = full.json(Method::POST, "/sessions", json!({"dataset": id})).await.ok().json();
    assert_eq!(opened.get("shown"), None, "what fits is shown in silence");
}

#[tokio::test]
async fn viewers_are_told_what_is_shown() {
    let service = narrow();
    let session = open(&service).await;
    let listening = service.listen().await;
    let mut viewer = listening.silent_viewer(&session.id).await;
    viewer.send(&ClientMessage::Hello { protocol: 1, resume: None }).await;
    let ServerMessage::Welcome { shown, dataset, .. } = viewer.message().await else { panic!() };
    assert_eq!(shown.unwrap().level, 1);
    assert_eq!(dataset.unwrap().dims, [16, 16, 16], "the dataset is what it is");
    viewer.viewport(1, 32, 24).await;
    viewer.frames_until_final().await;
    viewer.patch(2, json!({"volume": {"region": REGION}})).await;
    let told = viewer.message_of(|message| match message {
        ServerMessage::Scene { seq: 2, shown, scene, .. } => Some((shown, scene)),
        _ => None,
    });
    let (shown, scene) = told.await;
    assert_eq!(scene.volume.region, Some(REGION));
    assert_eq!(shown.unwrap().level, 0);
    viewer.frames_until_final().await;
}

#[tokio::test]
async fn a_pixel_of_a_region_names_the_whole_volumes_voxel() {
    let service = narrow();
    let session = open(&service).await;
    let region = json!({
        "volume": {"region": [[0.5, 0.5, 0.5], [1, 1, 1]]},
        "rendering": {"mode": "slice", "slice": {"normal": [0, 0, 1], "offset": 0.3}}
    });
    assert_eq!(patched(&service, &session.id, region).await.unwrap().level, 0);
    // The voxels are twice as deep as wide: the box is half as wide as deep.
    let camera =
        json!({"position": [0, 0, 2], "target": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 1});
    let ask = |x: f64| json!({"camera": camera, "x": x, "y": 14.5, "width": 40, "height": 40});
    let path = format!("/sessions/{}/probe", session.id);
    let hit = service.json(Method::POST, &path, ask(25.5)).await.ok().json()["hit"].clone();
    assert_eq!(hit["voxel"], json!([12, 12, 12]), "{hit}");
    assert_eq!(service.json(Method::POST, &path, ask(15.0)).await.ok().json()["hit"], Value::Null);
}

#[tokio::test]
async fn another_filter_reduces_in_another_way() {
    let service = narrow();
    let mut scene = small_scene();
    scene["volume"] = json!({"builtin": "cornell_box", "dims": [24, 24, 24]});
    let answer = service.json(Method::POST, "/sessions", json!({"scene": scene})).await.ok();
    let session: Session = serde_json::from_slice(&answer.body).unwrap();
    assert_eq!(session.shown.unwrap().level, 1);
    let still = format!("/sessions/{}/snapshot?width=32&height=24", session.id);
    let means = service.get(&still).await.ok().body;
    patched(&service, &session.id, json!({"volume": {"filter": "nearest"}})).await.unwrap();
    assert_ne!(service.get(&still).await.ok().body, means);
    patched(&service, &session.id, json!({"volume": {"filter": "linear"}})).await.unwrap();
    assert_eq!(service.get(&still).await.ok().body, means);
}

#[tokio::test]
async fn parts_count_as_memory_and_go_with_their_session() {
    // Room for the volume and its level, not for a region besides.
    let service = Service::with(|config| {
        config.limits.max_texture_bytes = 2000;
        config.limits.max_volume_memory_bytes = 4096 + 512 + 900;
    });
    let session = open(&service).await;
    let path = format!("/sessions/{}/scene", session.id);
    let wide = json!({"volume": {"region": REGION}});
    let problem = service.json(Method::PATCH, &path, wide.clone()).await.problem(503);
    assert!(problem.detail.contains("limits.max_volume_memory_bytes"), "{}", problem.detail);
    let small = json!({"volume": {"region": [[0.4, 0.4, 0.4], [0.6, 0.6, 0.6]]}});
    assert_eq!(patched(&service, &session.id, small).await.unwrap().level, 0);
    // Only the region is in use now: what the level took is free.
    let level = json!({"volume": {"region": null}});
    assert_eq!(patched(&service, &session.id, level).await.unwrap().level, 1);
}
