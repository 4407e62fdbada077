//! What is there again: viewers after a lost connection, sessions after a restart.

use std::time::Duration;

use axum::http::{Method, StatusCode, header};
use proto::control::{ClientMessage, Role, ServerMessage};
use proto::rest::Session;
use serde_json::json;

use crate::support::{Event, Frame, Listening, SOON, Service, Viewer, camera_at, small_scene};

/// What a welcome says.
struct Greeting {
    viewer: Viewer,
    number: u32,
    role: Role,
    resume: String,
    camera: [f64; 3],
}

async fn greet(listening: &Listening, session: &str, resume: Option<&str>) -> Greeting {
    let mut viewer = listening.silent_viewer(session).await;
    viewer.send(&ClientMessage::Hello { protocol: 1, resume: resume.map(str::to_owned) }).await;
    let ServerMessage::Welcome { viewer: number, role, resume, scene, .. } = viewer.message().await else {
        panic!("a welcome comes first")
    };
    let camera = scene.camera.unwrap().position;
    Greeting { viewer, number, role, resume, camera }
}

async fn last_frame(viewer: &mut Viewer) -> Frame {
    viewer.frames_until_final().await.pop().unwrap()
}

async fn all_viewers_left(service: &Service) {
    let deadline = tokio::time::Instant::now() + SOON;
    while service.get("/status").await.ok().json()["viewers"] != 0 {
        assert!(tokio::time::Instant::now() < deadline);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test]
async fn a_lost_connection_finds_its_picture_again() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut first = greet(&listening, &session.id, None).await;
    first.viewer.viewport(1, 64, 48).await;
    first.viewer.camera(2, camera_at(70.0)).await;
    let before = last_frame(&mut first.viewer).await;
    // Somebody else edits and turns meanwhile; nothing of it moves this viewer.
    let mut other = listening.viewer(&session.id).await;
    other.camera(1, camera_at(200.0)).await;
    drop(first.viewer);
    tokio::time::sleep(Duration::from_millis(100)).await;

    let mut again = greet(&listening, &session.id, Some(&first.resume)).await;
    assert_eq!((again.number, again.resume.as_str()), (first.number, first.resume.as_str()));
    assert_eq!(again.camera, camera_at(70.0).position);
    let mut after = None;
    let mut reports = 0;
    while after.is_none() || reports < 2 {
        match again.viewer.event().await {
            Event::Frame(frame) if frame.is_final() => after = Some(frame),
            Event::Message(ServerMessage::Report { report, .. }) => {
                let cast = report.plan.iter().find(|pass| pass.pass == "ray_cast").unwrap();
                assert!(!cast.runs, "{}", cast.reason);
                reports += 1;
            }
            _ => {}
        }
    }
    let after = after.unwrap();
    assert_eq!(after.payload, before.payload);
    assert!(after.header.frame > before.header.frame);
    // Edits made meanwhile are shown, too.
    drop(again.viewer);
    other.patch(2, json!({"density": 3.0})).await;
    let denser = |message| matches!(message, ServerMessage::Scene { .. }).then_some(());
    other.message_of(denser).await;
    let mut again = greet(&listening, &session.id, Some(&first.resume)).await;
    assert_ne!(last_frame(&mut again.viewer).await.payload, before.payload);
}

#[tokio::test]
async fn frames_in_flight_when_the_connection_was_lost_do_not_block_it() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut first = greet(&listening, &session.id, None).await;
    first.viewer.acknowledges = false;
    first.viewer.viewport(1, 64, 48).await;
    for _ in 0..2 {
        while !matches!(first.viewer.event().await, Event::Frame(_)) {}
        first.viewer.camera(2, camera_at(10.0)).await;
    }
    // The old connection is still open: the service has not noticed that nobody reads it.
    let mut again = greet(&listening, &session.id, Some(&first.resume)).await;
    assert_eq!(again.number, first.number);
    assert_eq!(first.viewer.close_code().await, 4409);
    assert!(last_frame(&mut again.viewer).await.is_final());
}

#[tokio::test]
async fn viewers_do_not_wait_for_ever() {
    let service = Service::with(|config| config.viewer_keep_seconds = 0);
    let session = service.session().await;
    let listening = service.listen().await;
    let first = greet(&listening, &session.id, None).await;
    let other = greet(&listening, &session.id, Some("another's")).await;
    assert_ne!(first.number, other.number, "an unknown token is a new viewer");
    drop((first.viewer, other.viewer));
    all_viewers_left(&service).await;
    let again = greet(&listening, &session.id, Some(&first.resume)).await;
    assert!(again.number > other.number, "{}", again.number);
}

#[tokio::test]
async fn most_viewers_that_are_away_are_forgotten() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut tokens = Vec::new();
    for _ in 0..20 {
        let greeting = greet(&listening, &session.id, None).await;
        tokens.push((greeting.number, greeting.resume));
        drop(greeting.viewer);
        all_viewers_left(&service).await;
    }
    let (number, token) = &tokens[19];
    assert_eq!(greet(&listening, &session.id, Some(token)).await.number, *number);
    let (number, token) = &tokens[0];
    assert!(greet(&listening, &session.id, Some(token)).await.number > *number);
}

#[tokio::test]
async fn watchers_look_and_change_nothing() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let watch = session.watch.clone().unwrap();
    assert!(!watch.contains(&session.id) && watch.len() == session.id.len());
    let mut watcher = greet(&listening, &watch, None).await;
    assert_eq!(watcher.role, Role::Watcher);
    watcher.viewer.viewport(1, 64, 48).await;
    let front = last_frame(&mut watcher.viewer).await;
    watcher.viewer.patch(2, json!({"density": 9.0})).await;
    let refused = |message| match message {
        ServerMessage::Rejected { seq, message, .. } => Some((seq, message)),
        _ => None,
    };
    let (seq, message) = watcher.viewer.message_of(refused).await;
    assert!(seq == 2 && message.contains("watched"), "{message}");
    // Its own view turns, the session's stays.
    watcher.viewer.camera(3, camera_at(120.0)).await;
    assert_ne!(last_frame(&mut watcher.viewer).await.pixels(), front.pixels());
    let path = format!("/sessions/{watch}");
    let seen: Session = serde_json::from_slice(&service.get(&path).await.ok().body).unwrap();
    assert_eq!((seen.id.as_str(), seen.watch, seen.role), (watch.as_str(), None, Role::Watcher));
    assert_eq!(seen.scene, session.scene);
    assert!(!serde_json::to_string(&seen.scene).unwrap().contains(&session.id));
    service.get(&format!("{path}/snapshot?width=16&height=16")).await.ok();
    for (method, path) in [
        (Method::PATCH, format!("{path}/scene")),
        (Method::PUT, format!("{path}/scene")),
        (Method::DELETE, path.clone()),
    ] {
        service.json(method, &path, small_scene()).await.problem(403);
    }
    // An editor's edit reaches the watcher.
    service
        .json(Method::PATCH, &format!("/sessions/{}/scene", session.id), json!({"density": 2.0}))
        .await
        .ok();
    let scene = |message| match message {
        ServerMessage::Scene { scene, .. } => Some(scene.density),
        _ => None,
    };
    assert_eq!(watcher.viewer.message_of(scene).await, 2.0);
}

#[tokio::test]
async fn sessions_come_back_after_a_restart() {
    let service = Service::new();
    let session = service.session().await;
    let path = format!("/sessions/{}", session.id);
    let edited =
        service.json(Method::PATCH, &format!("{path}/scene"), json!({"density": 4.0})).await.ok().json();
    let other = service.session().await;
    service.delete(&format!("/sessions/{}", other.id)).await.ok();

    let service = service.restarted().await;
    let listed = service.get("/sessions").await.ok().json();
    assert_eq!(listed.as_array().unwrap().len(), 1, "what was deleted stays deleted: {listed}");
    assert_eq!(listed[0]["id"], json!(session.watch), "as to those who watch");
    assert!(!listed.to_string().contains(&session.id));
    assert_eq!(listed[0]["scene"], edited["scene"]);
    let listening = service.listen().await;
    let mut viewer = greet(&listening, session.watch.as_ref().unwrap(), None).await.viewer;
    viewer.viewport(1, 64, 48).await;
    let frame = last_frame(&mut viewer).await;
    assert!(
        frame.header.snapshot_epoch > 2,
        "newer than what was shown before: {}",
        frame.header.snapshot_epoch
    );
    let again = service.get(&path).await.ok().json();
    assert_eq!(again["scene"], edited["scene"]);
    assert_eq!(again["created_unix_millis"], edited["created_unix_millis"]);

    service.delete(&path).await.ok();
    drop(viewer);
    listening.stopped().await;
    let service = service.restarted().await;
    service.get(&path).await.problem(404);
}

#[tokio::test]
async fn a_kill_loses_no_session_that_had_a_moment() {
    let service = Service::new();
    let session = service.session().await;
    let stored = service.folder.path().join(format!("data/sessions/{}.json", session.id));
    let deadline = tokio::time::Instant::now() + SOON;
    while !stored.exists() {
        assert!(tokio::time::Instant::now() < deadline);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    // What a crash can leave beside it, and what others may have put there.
    std::fs::write(stored.with_extension("12ab.part"), b"{").unwrap();
    std::fs::write(stored.with_file_name("0000.json"), b"{\"version\": 1").unwrap();
    let copy = tempfile::tempdir().unwrap();
    let sessions = copy.path().join("data/sessions");
    std::fs::create_dir_all(&sessions).unwrap();
    for entry in std::fs::read_dir(stored.parent().unwrap()).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), sessions.join(entry.file_name())).unwrap();
    }
    let after = Service::in_folder(copy, |_| {});
    after.get(&format!("/sessions/{}", session.id)).await.ok();
    after.get("/sessions/0000").await.problem(404);
    assert_eq!(after.get("/sessions").await.ok().json().as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn sessions_without_viewers_make_room_and_come_back() {
    let service = Service::with(|config| config.limits.max_sessions = 1);
    let first = service.session().await;
    let deadline = tokio::time::Instant::now() + SOON;
    while !service.app.sessions().store().is_saved(&first.id) {
        assert!(tokio::time::Instant::now() < deadline);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let second = service.session().await;
    assert_eq!(service.get("/status").await.ok().json()["sessions"], 1);
    let listening = service.listen().await;
    let viewer = listening.viewer(&second.id).await;
    // The one in memory is looked at: there is no room for the other.
    let refused = service.get(&format!("/sessions/{}", first.id)).await;
    refused.problem(503);
    assert!(refused.headers.contains_key(header::RETRY_AFTER));
    let refused = service.json(Method::POST, "/sessions", json!({"scene": small_scene()})).await;
    assert_eq!(refused.status, StatusCode::SERVICE_UNAVAILABLE);
    drop(viewer);
    all_viewers_left(&service).await;
    tokio::time::sleep(Duration::from_millis(600)).await;
    let again = service.get(&format!("/sessions/{}", first.id)).await.ok().json();
    assert_eq!(again["scene"], serde_json::to_value(&first.scene).unwrap());
}

#[tokio::test]
async fn a_session_whose_volume_is_gone_says_so() {
    let service = Service::new();
    let id = service.put("/datasets/ball.nrrd", crate::support::nrrd(0)).await.ok().json()["id"].clone();
    let session = service.json(Method::POST, "/sessions", json!({"dataset": id})).await.ok().json();
    service.delete(&format!("/datasets/{}", id.as_str().unwrap())).await.ok();
    let service = service.restarted().await;
    let gone = service.get(&format!("/sessions/{}", session["id"].as_str().unwrap())).await.problem(404);
    assert!(gone.detail.contains("no longer there"), "{}", gone.detail);
}
