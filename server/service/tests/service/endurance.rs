//! What happens a thousand times, and what the outside world does to a service.

use std::time::Duration;

use axum::http::Method;
use proto::control::ServerMessage;
use render::{AdapterPolicy, Gpu};
use serde_json::json;
use tokio_tungstenite::tungstenite::Message;

use crate::support::{Event, Service, camera_at, small_scene};
use futures_util::SinkExt;

/// Cycles before memory is measured, and after that; ten times as many in `make soak`.
const WARM_UP: usize = 40;
const CYCLES: usize = 100;
/// Growth of the process that is no slope: pages of allocators and of the driver's caches.
const NO_SLOPE_BYTES: u64 = 24 << 20;

fn cycles() -> usize {
    if std::env::var_os("TYNDALL_SOAK").is_some() { 10 * CYCLES } else { CYCLES }
}

/// Memory of this process, bytes; of all tests that run beside this one, too.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.split_whitespace().next().unwrap().parse::<u64>().unwrap() << 10
}

/// Runs alone with nextest or `--test-threads 1`; beside other tests it sees their memory, and says so.
fn assert_no_slope(before: u64, what: &str) {
    let grown = resident_bytes().saturating_sub(before);
    eprintln!("{} cycles of {what}: {} kB more", cycles(), grown >> 10);
    if std::env::var_os("TYNDALL_SOAK").is_some() {
        assert!(grown < NO_SLOPE_BYTES, "{grown} bytes after {} cycles of {what}", cycles());
    }
}

#[tokio::test]
async fn connections_that_come_and_go_leave_nothing() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut before = 0;
    for cycle in 0..WARM_UP + cycles() {
        if cycle == WARM_UP {
            before = resident_bytes();
        }
        let mut viewer = listening.viewer(&session.id).await;
        viewer.viewport(1, 16, 12).await;
        while !matches!(viewer.event().await, Event::Frame(_)) {}
    }
    // What the session still knows of them is bounded, and the next viewer is served like the first.
    assert_no_slope(before, "connecting and leaving");
    let mut last = listening.viewer(&session.id).await;
    last.viewport(1, 16, 12).await;
    assert!(last.frames_until_final().await.pop().unwrap().is_final());
    let views = service.app.renderer().volumes().others_bytes();
    assert!(views < 64 << 10, "{views} bytes of films of viewers that left");
}

#[tokio::test]
async fn volumes_that_come_and_go_leave_nothing() {
    let service = Service::new();
    let mut before = 0;
    for cycle in 0..WARM_UP + cycles() {
        if cycle == WARM_UP {
            before = resident_bytes();
        }
        let mut scene = small_scene();
        scene["volume"]["dims"] = json!([16 + cycle % 7, 16, 16]);
        let session = service.json(Method::POST, "/sessions", json!({ "scene": scene })).await.ok().json();
        let path = format!("/sessions/{}", session["id"].as_str().unwrap());
        service.get(&format!("{path}/snapshot?width=16&height=16")).await.ok();
        service.delete(&path).await.ok();
    }
    assert_no_slope(before, "opening and deleting sessions");
    assert_eq!(service.get("/status").await.ok().json()["sessions"], 0);
    assert_eq!(service.app.sessions().list().len(), 0);
}

#[tokio::test]
async fn absurd_messages_harm_nobody_else() {
    let service = Service::with(|config| config.limits.max_message_bytes = 10_000);
    let session = service.session().await;
    let listening = service.listen().await;
    let mut other = listening.viewer(&session.id).await;
    other.viewport(1, 48, 32).await;
    other.frames_until_final().await;
    let nested =
        format!("{{\"type\": \"patch\", \"seq\": 1, \"patch\": {}1{}}}", "[".repeat(3000), "]".repeat(3000));
    for (text, survives) in [
        (String::from("{\"type\": \"patch\", \"seq\": 1, \"patch\": {\"density\""), true),
        (nested, true),
        (String::from("{\"type\": \"camera\", \"seq\": -1}"), true),
        (String::from("{\"type\": \"ack\", \"frame\": 4294967295, \"decode_millis\": 1e308}"), true),
        (String::from("{\"type\": \"hello\", \"protocol\": 1, \"resume\": \"x\"}"), true),
        ("x".repeat(20_000), false),
    ] {
        let mut viewer = listening.viewer(&session.id).await;
        viewer.viewport(1, 16, 12).await;
        let sent = viewer.socket.send(Message::Text(text.clone().into())).await;
        assert!(sent.is_ok() || !survives);
        if survives {
            viewer.patch(9, json!({"film": {"exposure_stops": 0.5}})).await;
            let answered = |message| matches!(message, ServerMessage::Scene { seq: 9, .. }).then_some(());
            viewer.message_of(answered).await;
        } else {
            viewer.close_code().await;
        }
    }
    let mut binary = listening.viewer(&session.id).await;
    binary.socket.send(Message::Binary(vec![0xff; 5000].into())).await.unwrap();
    let refused = |message| matches!(message, ServerMessage::Rejected { .. }).then_some(());
    binary.message_of(refused).await;
    // The one beside them still gets its pictures.
    other.camera(2, camera_at(30.0)).await;
    while other.frames_until_final().await.pop().unwrap().header.seq < 2 {}
}

#[tokio::test]
async fn a_lost_device_is_opened_again_and_sessions_go_on() {
    let gpu = Gpu::open(AdapterPolicy::Any).unwrap();
    let service = Service::on(gpu.clone());
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 48, 32).await;
    let before = viewer.frames_until_final().await.pop().unwrap();
    gpu.lose();
    viewer.camera(2, camera_at(50.0)).await;
    let failed = |message| match message {
        ServerMessage::Failed { message } => Some(message),
        _ => None,
    };
    let message = viewer.message_of(failed).await;
    assert!(message.contains("lost"), "{message}");
    // The same connection goes on, with the new view and then with the old one as it was.
    viewer.camera(3, camera_at(60.0)).await;
    loop {
        if let Event::Frame(frame) = viewer.event().await
            && frame.is_final()
            && frame.header.seq >= 3
        {
            assert_ne!(frame.pixels(), before.pixels());
            break;
        }
    }
    viewer.camera(4, session.scene.camera.clone().unwrap()).await;
    loop {
        if let Event::Frame(frame) = viewer.event().await
            && frame.is_final()
            && frame.header.seq >= 4
        {
            assert_eq!(frame.pixels(), before.pixels());
            break;
        }
    }
    tokio::time::timeout(Duration::from_secs(30), service.get(&format!("/sessions/{}/snapshot", session.id)))
        .await
        .unwrap()
        .ok();
}
