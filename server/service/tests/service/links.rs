//! Slow links: a proxy between viewer and service lets through so many bytes a second.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;

use crate::support::{Event, Listening, Service, Viewer, camera_at, small_scene};

/// Longest piece that passes at once, bytes: a packet.
const PACKET: usize = 1500;
/// What the proxy takes in beyond what it has passed on.
const BUFFER: u32 = 4096;

/// A link whose rate towards the viewer can be changed.
struct Link {
    address: std::net::SocketAddr,
    bytes_per_second: Arc<AtomicU64>,
}

impl Link {
    async fn to(listening: &Listening, bits_per_second: u64) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let bytes_per_second = Arc::new(AtomicU64::new(bits_per_second / 8));
        let (rate, service) = (bytes_per_second.clone(), listening.address);
        tokio::spawn(async move {
            let (viewer, _) = listener.accept().await.unwrap();
            viewer.set_nodelay(true).unwrap();
            let socket = tokio::net::TcpSocket::new_v4().unwrap();
            // Else the operating system takes in seconds of a slow link's frames.
            socket.set_recv_buffer_size(BUFFER).unwrap();
            let service = socket.connect(service).await.unwrap();
            let (from_viewer, to_viewer) = viewer.into_split();
            let (from_service, to_service) = service.into_split();
            let up = pass(from_viewer, to_service, None);
            let down = pass(from_service, to_viewer, Some(rate));
            tokio::join!(up, down);
        });
        Self { address, bytes_per_second }
    }

    fn set(&self, bits_per_second: u64) {
        self.bytes_per_second.store(bits_per_second / 8, Ordering::Relaxed);
    }

    async fn viewer(&self, session: &str) -> Viewer {
        let url = format!("ws://{}/api/v1/sessions/{session}/view", self.address);
        Viewer::greeted(&url).await
    }
}

async fn pass(
    mut from: tokio::net::tcp::OwnedReadHalf,
    mut to: tokio::net::tcp::OwnedWriteHalf,
    rate: Option<Arc<AtomicU64>>,
) {
    let mut packet = [0; PACKET];
    let mut free_at = tokio::time::Instant::now();
    while let Ok(length @ 1..) = from.read(&mut packet).await {
        if let Some(rate) = &rate {
            let seconds = length as f64 / rate.load(Ordering::Relaxed) as f64;
            free_at = free_at.max(tokio::time::Instant::now()) + Duration::from_secs_f64(seconds);
            tokio::time::sleep_until(free_at).await;
        }
        if to.write_all(&packet[..length]).await.is_err() {
            return;
        }
    }
}

/// A frame of a drag: when it came, how old what it shows was then, and how much of that is not the
/// link's doing.
struct Seen {
    at: Instant,
    age: Duration,
    on_server: Duration,
    bytes: usize,
}

/// Turns the camera sixty times a second.
async fn drag(viewer: &mut Viewer, seq: &mut u32, time: Duration) -> Vec<Seen> {
    let mut ticks = tokio::time::interval(Duration::from_millis(16));
    let began = Instant::now();
    let mut sent: VecDeque<(u32, Instant)> = VecDeque::new();
    let mut seen = Vec::new();
    while began.elapsed() < time {
        tokio::select! {
            _ = ticks.tick() => {
                *seq += 1;
                sent.push_back((*seq, Instant::now()));
                viewer.camera(*seq, camera_at(f64::from(*seq))).await;
            }
            event = viewer.event() => {
                let Event::Frame(frame) = event else { continue };
                let mut shown = None;
                while sent.front().is_some_and(|(number, _)| *number <= frame.header.seq) {
                    shown = sent.pop_front();
                }
                let Some((_, input)) = shown else { continue };
                let header = &frame.header;
                let micros = header.queue_micros + header.render_micros + header.encode_micros;
                seen.push(Seen {
                    at: Instant::now(),
                    age: input.elapsed(),
                    on_server: Duration::from_micros(micros.into()),
                    bytes: frame.payload.len(),
                });
            }
        }
    }
    seen
}

/// A picture of many bytes that is quickly drawn, so that the link is what limits.
fn busy_scene() -> serde_json::Value {
    let mut scene = small_scene();
    scene["volume"] = json!({"builtin": "marschner_lobb", "dims": [40, 40, 40]});
    scene["rendering"] = json!({"mode": "slice", "slice": {"normal": [0.2, 0.1, 1.0], "offset": 0.0}});
    json!({ "scene": scene })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_link_that_becomes_slow_gets_smaller_frames_and_no_older_ones() {
    let service = Service::new();
    let session = service.json(axum::http::Method::POST, "/sessions", busy_scene()).await.ok().json();
    let id = session["id"].as_str().unwrap();
    let listening = service.listen().await;
    let link = Link::to(&listening, 5_000_000).await;
    let mut viewer = link.viewer(id).await;
    viewer.viewport(1, 640, 480).await;
    let mut seq = 1;
    let fast = drag(&mut viewer, &mut seq, Duration::from_secs(3)).await;
    link.set(500_000);
    let changed = Instant::now();
    let slow = drag(&mut viewer, &mut seq, Duration::from_secs(6)).await;
    let bytes = |seen: &[Seen]| seen.iter().map(|seen| seen.bytes).sum::<usize>() / seen.len().max(1);
    let settled: Vec<&Seen> =
        slow.iter().filter(|seen| seen.at.duration_since(changed) > Duration::from_secs(2)).collect();
    let by_link: Vec<u128> =
        settled.iter().map(|seen| seen.age.saturating_sub(seen.on_server).as_millis()).collect();
    eprintln!(
        "5 Mbit/s: {} frames of {} bytes; 0.5 Mbit/s: {} frames of {} bytes; then delayed by the link, ms: {by_link:?}",
        fast.len(),
        bytes(&fast),
        slow.len(),
        bytes(&slow),
    );
    assert!(settled.len() >= 8, "{} frames in four seconds", settled.len());
    assert!(by_link.iter().all(|&millis| millis < 500), "{by_link:?}");

    // It comes back as well.
    link.set(50_000_000);
    let again = drag(&mut viewer, &mut seq, Duration::from_secs(4)).await;
    let last = &again[again.len() / 2..];
    eprintln!("50 Mbit/s: {} frames, in the end of {} bytes", again.len(), bytes(last));
    assert!(bytes(last) > bytes(&slow), "{} and {}", bytes(last), bytes(&slow));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_slow_link_is_nobody_elses_matter() {
    let service = Service::new();
    let session = service.json(axum::http::Method::POST, "/sessions", busy_scene()).await.ok().json();
    let id = session["id"].as_str().unwrap();
    let listening = service.listen().await;
    let mut other = listening.viewer(id).await;
    other.viewport(1, 320, 240).await;
    let mut seq = 1;
    let link = Link::to(&listening, 100_000).await;
    let mut slow = link.viewer(id).await;
    slow.viewport(1, 640, 480).await;
    let mut slow_seq = 1;
    let time = Duration::from_secs(4);
    let (theirs, slow) = tokio::join!(drag(&mut other, &mut seq, time), drag(&mut slow, &mut slow_seq, time));
    let delays: Vec<u128> =
        theirs.iter().map(|seen| seen.age.saturating_sub(seen.on_server).as_millis()).collect();
    eprintln!("{} frames beside {} over the slow link; delays, ms: {delays:?}", theirs.len(), slow.len());
    assert!(theirs.len() > 2 * slow.len(), "{} and {}", theirs.len(), slow.len());
    let late = delays.iter().filter(|&&millis| millis > 200).count();
    assert!(late * 10 <= delays.len(), "{late} of {} frames were late: {delays:?}", delays.len());
}
