//! Precomputed light of the real program: killed in the middle of a bake, and with files that were
//! tampered with.

#![allow(clippy::unwrap_used, clippy::expect_used)]

#[allow(dead_code)]
#[path = "uploads/client.rs"]
mod client;

use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use client::{Server, free_address, request, serve};
use serde_json::json;

/// Longest wait for a bake to begin, on a busy machine.
const PATIENCE: Duration = Duration::from_secs(300);
/// Of them a few batches, on every device.
const PHOTONS: u64 = 400_000;
/// Where a file holds how many photons were flown, and its last byte of matrices.
const PHOTONS_AT: usize = 16;
const HASH_BYTES: usize = 32;

/// A service on a data directory that writes down its bake at every opportunity, and its log.
fn start(data: &Path) -> Server {
    let address = free_address();
    let log = data.join("log");
    let mut command = serve(address, data);
    for setting in ["bake_checkpoint_seconds=0", "limits.still_seconds=900"] {
        command.extend(["--setting".into(), setting.into()]);
    }
    let mut shell = vec![
        "sh".into(),
        "-c".into(),
        format!("TYNDALL_LOG=warn,render=info exec \"$0\" \"$@\" >>{} 2>&1", log.display()),
    ];
    shell.append(&mut command);
    Server::start(address, &shell).expect("it starts")
}

/// A picture of a scene, as the service draws it for a request.
fn still(address: SocketAddr, session: &str) -> std::io::Result<Vec<u8>> {
    let path = format!("/api/v1/sessions/{session}/snapshot?width=48&height=40&format=npy");
    let reply = client::request_within(PATIENCE, address, "GET", &path, &[], &[])?;
    assert_eq!(reply.status, 200, "{}", String::from_utf8_lossy(&reply.body));
    Ok(reply.body)
}

fn open_session(address: SocketAddr) -> String {
    let scene = json!({"version": 1, "volume": {"builtin": "smoke_plume", "dims": [24, 24, 24]},
        "camera": {"position": [0.4, 0.5, 2.4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 30},
        "transfer_function": {"points": [{"s": 0, "extinction": 0}, {"s": 1, "extinction": 30, "albedo": [0.9, 0.9, 0.9]}]},
        "lights": [{"type": "environment", "radiance": [1, 1, 1]}],
        "illumination": {"method": "precomputed_transfer", "transfer_lights": 42, "transfer_grid": 16,
            "transfer_directions": 48, "transfer_photons": PHOTONS}});
    let headers = [("Content-Type", "application/json")];
    let body = json!({ "scene": scene }).to_string();
    let reply = request(address, "POST", "/api/v1/sessions", &headers, body.as_bytes()).unwrap();
    assert_eq!(reply.status, 201, "{}", String::from_utf8_lossy(&reply.body));
    reply.json()["id"].as_str().unwrap().to_owned()
}

/// The bake that is stored, and how many photons were flown for it.
fn stored(data: &Path) -> Option<(PathBuf, u64)> {
    let is_bake = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "bake");
    let path = fs::read_dir(data.join("bakes")).unwrap().map(|entry| entry.unwrap().path()).find(is_bake)?;
    let bytes = fs::read(&path).ok()?;
    let photons = bytes.get(PHOTONS_AT..PHOTONS_AT + 8)?;
    Some((path, u64::from_le_bytes(photons.try_into().unwrap())))
}

/// How often something was logged.
fn said(data: &Path, words: &str) -> usize {
    fs::read_to_string(data.join("log")).unwrap().matches(words).count()
}

const GOES_ON: &str = "a bake goes on from where it was stored";
const NO_USE: &str = "a baked light is no use and is made anew";

#[test]
fn a_bake_that_was_killed_goes_on_and_nothing_corrupt_is_served() {
    let data = tempfile::tempdir().unwrap();
    let server = start(data.path());
    let address = server.address;
    let session = open_session(address);
    let waiting = {
        let session = session.clone();
        std::thread::spawn(move || still(address, &session))
    };
    let began = Instant::now();
    while stored(data.path()).is_none_or(|(_, photons)| photons == 0) {
        assert!(began.elapsed() < PATIENCE, "no bake is stored");
        std::thread::sleep(Duration::from_millis(5));
    }
    server.kill();
    assert!(waiting.join().unwrap().is_err(), "it was killed before the picture was drawn");
    let (_, photons) = stored(data.path()).unwrap();
    assert!((1..PHOTONS).contains(&photons), "{photons}");

    let server = start(data.path());
    let resumed = still(server.address, &session).unwrap();
    assert_eq!((said(data.path(), GOES_ON), said(data.path(), NO_USE)), (1, 0));
    let (path, photons) = stored(data.path()).unwrap();
    assert_eq!(photons, PHOTONS, "it is finished");
    server.kill();

    // Where nothing was ever interrupted there is the same light.
    let other = tempfile::tempdir().unwrap();
    let server = start(other.path());
    let session_there = open_session(server.address);
    assert!(still(server.address, &session_there).unwrap() == resumed, "the same picture");
    assert_eq!(said(other.path(), GOES_ON), 0);
    server.kill();

    // Light a thousand times as bright is not what was baked.
    let mut bytes = fs::read(&path).unwrap();
    let end = bytes.len() - HASH_BYTES;
    for number in bytes[end / 2 / 4 * 4..end / 4 * 4].as_chunks_mut::<4>().0 {
        *number = (1000.0 * f32::from_le_bytes(*number)).to_le_bytes();
    }
    fs::write(&path, &bytes).unwrap();
    let server = start(data.path());
    assert!(still(server.address, &session).unwrap() == resumed, "the same picture");
    assert_eq!((said(data.path(), GOES_ON), said(data.path(), NO_USE)), (1, 1));
    // And from what was made anew.
    assert!(still(server.address, &session).unwrap() == resumed, "the same picture");
    assert_eq!((said(data.path(), GOES_ON), said(data.path(), NO_USE)), (2, 1));
}
