//! Viewers: edits, other viewers, and how connections end.

use std::time::{Duration, Instant};

use axum::http::Method;
use proto::control::{ClientMessage, ServerMessage};
use proto::scene_file::SceneFile;
use serde_json::{Value, json};

use crate::support::{Event, Service, Viewer, camera_at};

async fn rejection(viewer: &mut Viewer) -> (u32, String, String) {
    let pick = |message| match message {
        ServerMessage::Rejected { seq, field, message } => Some((seq, field, message)),
        _ => None,
    };
    viewer.message_of(pick).await
}

async fn scene(viewer: &mut Viewer) -> (u32, u32, SceneFile) {
    let pick = |message| match message {
        ServerMessage::Scene { epoch, seq, scene, .. } => Some((epoch, seq, *scene)),
        _ => None,
    };
    viewer.message_of(pick).await
}

fn ramp(top: f64) -> Value {
    json!({"transfer_function": {"points": [{"s": 0.2, "extinction": 0}, {"s": 1, "extinction": top}]}})
}

#[tokio::test]
async fn a_refused_edit_changes_nothing() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    for (seq, patch, field) in [
        (1, json!({"density": "much"}), "density"),
        (2, ramp(-1.0), "transfer_function.points[1].extinction"),
        (3, json!({"volume": {"builtin": null, "dims": null, "file": "a.nrrd"}}), "volume.file"),
        (4, json!(7), ""),
        (5, json!({"camera": {"position": [0, 0, 0], "target": [0, 0, 0]}}), "camera.target"),
    ] {
        viewer.patch(seq, patch).await;
        let (rejected, named, message) = rejection(&mut viewer).await;
        assert_eq!((rejected, named.as_str()), (seq, field), "{message}");
    }
    let mut camera = camera_at(0.0);
    camera.fov_y_degrees = Some(400.0);
    viewer.camera(6, camera).await;
    assert_eq!(rejection(&mut viewer).await.1, "camera.fov_y_degrees");
    viewer.send_text("{\"type\": \"camera\", \"seq\": 7}".into()).await;
    assert_eq!(rejection(&mut viewer).await.0, 7);
    viewer.send_text("{\"type\": \"dance\", \"seq\": 8}".into()).await;
    assert_eq!(rejection(&mut viewer).await.0, 8);
    viewer.send_text("not JSON".into()).await;
    assert_eq!(rejection(&mut viewer).await.0, 0);
    let after = service.get(&format!("/sessions/{}", session.id)).await.ok().json();
    assert_eq!(after["epoch"], 1);
    assert_eq!(after["scene"], serde_json::to_value(&session.scene).unwrap());
}

#[tokio::test]
async fn a_burst_of_edits_is_applied_together_and_only_the_bad_one_is_refused() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    for seq in 1..=100 {
        viewer.patch(seq, if seq == 50 { ramp(-1.0) } else { ramp(f64::from(seq)) }).await;
    }
    assert_eq!(rejection(&mut viewer).await.0, 50);
    loop {
        let (_, seq, scene) = scene(&mut viewer).await;
        if seq == 100 {
            assert_eq!(scene.transfer_function.points[1].extinction, Some(100.0));
            break;
        }
    }
    let mut seq = 100;
    // Without a bad one, epochs count applications, not messages.
    let before =
        service.get(&format!("/sessions/{}", session.id)).await.ok().json()["epoch"].as_u64().unwrap();
    for _ in 0..100 {
        seq += 1;
        viewer.patch(seq, ramp(f64::from(seq))).await;
    }
    while scene(&mut viewer).await.1 < seq {}
    let after =
        service.get(&format!("/sessions/{}", session.id)).await.ok().json()["epoch"].as_u64().unwrap();
    assert!(after - before < 60, "{} epochs for 100 edits sent at once", after - before);
}

#[tokio::test]
async fn edits_reach_every_viewer_and_cameras_stay_ones_own() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut first = listening.viewer(&session.id).await;
    let mut second = listening.viewer(&session.id).await;
    first.viewport(1, 48, 32).await;
    second.viewport(1, 48, 32).await;
    let front = first.frames_until_final().await.pop().unwrap();
    assert_eq!(second.frames_until_final().await.pop().unwrap().pixels(), front.pixels());

    first.camera(2, camera_at(120.0)).await;
    let side = first.frames_until_final().await.pop().unwrap();
    assert_ne!(side.pixels(), front.pixels());
    while let Some(event) = second.event_within(Duration::from_millis(400)).await {
        assert!(matches!(event, Event::Message(ServerMessage::Report { .. })), "{event:?}");
    }

    first.patch(3, json!({"density": 3.0})).await;
    let (epoch, seq, told) = scene(&mut second).await;
    assert_eq!((epoch, seq, told.density), (2, 0, 3.0), "none of this viewer's inputs is part of it");
    assert_ne!(told.camera, Some(camera_at(120.0)), "each sees its own camera");
    let (_, seq, told) = scene(&mut first).await;
    assert_eq!((seq, told.camera), (3, Some(camera_at(120.0))));
    let denser = second.frames_until_final().await.pop().unwrap();
    assert_eq!((denser.header.snapshot_epoch, denser.header.seq), (2, 1));

    // A new viewer starts where the session's camera was left.
    let mut third = listening.viewer(&session.id).await;
    third.viewport(1, 48, 32).await;
    let third = third.frames_until_final().await.pop().unwrap();
    assert_eq!(third.pixels(), first.frames_until_final().await.pop().unwrap().pixels());
    assert_eq!(service.get("/status").await.ok().json()["viewers"], 3);
}

#[tokio::test]
async fn edits_over_rest_reach_viewers() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    let path = format!("/sessions/{}/scene", session.id);
    service.json(Method::PATCH, &path, json!({"density": 2.5})).await.ok();
    let (epoch, seq, told) = scene(&mut viewer).await;
    assert_eq!((epoch, seq, told.density), (2, 0, 2.5));
}

#[tokio::test]
async fn a_camera_in_a_patch_moves_this_viewer() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.camera(1, camera_at(30.0)).await;
    viewer.patch(2, json!({"camera": {"fov_y_degrees": 20}})).await;
    let (_, _, told) = scene(&mut viewer).await;
    let camera = told.camera.unwrap();
    assert_eq!(camera.fov_y_degrees, Some(20.0));
    assert_eq!(camera.position, camera_at(30.0).position, "merged with the viewer's own");
    viewer.patch(3, json!({"camera": {"fov_y_degrees": null, "orthographic_height": 1.0}})).await;
    assert_eq!(scene(&mut viewer).await.2.camera.unwrap().orthographic_height, Some(1.0));
    viewer.patch(4, json!({"camera": null})).await;
    assert_eq!(scene(&mut viewer).await.2.camera, Some(scene::Camera::default_file(false)));
}

#[tokio::test]
async fn another_volume_is_loaded_and_edits_behind_it_wait() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 48, 32).await;
    let before = viewer.frames_until_final().await.pop().unwrap();
    viewer.patch(2, json!({"volume": {"builtin": "nested_shells", "dims": [40, 40, 40]}})).await;
    viewer.patch(3, json!({"density": 2.0})).await;
    let mut progress = false;
    let told = loop {
        match viewer.message().await {
            ServerMessage::Progress { .. } => progress = true,
            ServerMessage::Scene { seq: 3, scene, .. } => break scene,
            ServerMessage::Scene { seq, .. } => assert!(seq < 3),
            ServerMessage::Rejected { message, .. } => panic!("{message}"),
            _ => {}
        }
    };
    assert!(progress);
    assert_eq!(told.volume.builtin, Some(proto::scene_file::Builtin::NestedShells));
    assert_eq!(told.density, 2.0);
    let after = viewer.frames_until_final().await.pop().unwrap();
    assert_ne!(after.pixels(), before.pixels());
}

#[tokio::test]
async fn connections_that_cannot_be_are_closed_with_a_reason() {
    let service = Service::with(|config| {
        config.limits.max_viewers = 1;
        config.limits.max_message_bytes = 4096;
    });
    let session = service.session().await;
    let listening = service.listen().await;
    assert_eq!(listening.silent_viewer("nobody").await.close_code().await, 4404);

    let mut wrong = listening.silent_viewer(&session.id).await;
    wrong.send(&ClientMessage::Hello { protocol: 99, resume: None }).await;
    assert_eq!(wrong.close_code().await, 4400);
    let mut rude = listening.silent_viewer(&session.id).await;
    rude.viewport(1, 10, 10).await;
    assert_eq!(rude.close_code().await, 4400);

    let mut first = listening.viewer(&session.id).await;
    assert_eq!(listening.silent_viewer(&session.id).await.close_code().await, 1013);
    first.send_text(format!("\"{}\"", "x".repeat(5000))).await;
    let code = first.close_code().await;
    assert!([1006, 1009].contains(&code), "{code}");
    // Its place is free again.
    let end = Instant::now() + Duration::from_secs(20);
    while service.get("/status").await.ok().json()["viewers"] != 0 {
        assert!(Instant::now() < end, "the viewer was not forgotten");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    listening.viewer(&session.id).await;
}

#[tokio::test]
async fn a_deleted_session_tells_its_viewers() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    service.delete(&format!("/sessions/{}", session.id)).await.ok();
    viewer.message_of(|message| matches!(message, ServerMessage::Closing { .. }).then_some(())).await;
    assert_eq!(viewer.close_code().await, 4404);
}

#[tokio::test]
async fn stopping_tells_viewers_and_ends_in_time() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 640, 480).await;
    // One that never reads, and one that never said hello.
    let mut deaf = listening.viewer(&session.id).await;
    deaf.viewport(1, 640, 480).await;
    let _silent = listening.silent_viewer(&session.id).await;
    let began = Instant::now();
    listening.stop.cancel();
    viewer.message_of(|message| matches!(message, ServerMessage::Closing { .. }).then_some(())).await;
    assert_eq!(viewer.close_code().await, 1001);
    listening.server.await.unwrap().unwrap();
    assert!(began.elapsed() < Duration::from_secs(11), "{:?}", began.elapsed());
    assert!(tokio::net::TcpStream::connect(listening.address).await.is_err(), "nobody listens any more");
}
