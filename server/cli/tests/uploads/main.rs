//! Uploads to the real program: killed at random moments, and on a disk that is full.
//!
//! `TYNDALL_SOAK` is how often it is killed; `make soak` sets it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod client;
mod disk_full;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use client::{Chance, Server, append, begin, files_below, free_address, head, put, request, serve};

/// Kills of a short run.
const KILLS: usize = 6;
/// Clients at once: resumable uploads, and uploads in one request. Together as many as the service
/// receives at once.
const RESUMABLE: u64 = 3;
const PLAIN: u64 = 1;
/// Largest file, bytes; small enough that many are finished, large enough that many are not.
const MAX_FILE: usize = 1_500_000;
const MAX_PIECE: usize = 300_000;
/// Longest life of the service between two kills, milliseconds.
const MAX_LIFE: usize = 900;
/// Datasets that are kept after a kill; the others are deleted, and stay so.
const KEPT: usize = 20;
/// Patience of a client whose service is away.
const AWAY: Duration = Duration::from_millis(30);

/// What all clients share.
struct Shared {
    address: std::net::SocketAddr,
    /// Set when the last kill is over: clients end when what they have begun is stored.
    ending: AtomicBool,
    /// Datasets that the service acknowledged: identifier and hash of the content.
    acknowledged: Mutex<BTreeMap<String, blake3::Hash>>,
    /// Datasets whose deletion the service acknowledged.
    deleted: Mutex<BTreeSet<String>>,
    /// Requests that broke off, bytes resumed beyond what was acknowledged, refused takeovers.
    broken: AtomicUsize,
}

impl Shared {
    fn acknowledge(&self, dataset: &serde_json::Value, content: &[u8]) {
        let hash = blake3::hash(content);
        let id = dataset["id"].as_str().expect("an identifier").to_owned();
        assert!(hash.to_hex().starts_with(&id), "the dataset is what was sent");
        self.acknowledged.lock().unwrap().insert(id, hash);
    }

    fn breaks(&self) {
        self.broken.fetch_add(1, Ordering::Relaxed);
        std::thread::sleep(AWAY);
    }
}

/// Sends one file after the other in one request each.
fn plain_client(shared: &Shared, mut chance: Chance) {
    while !shared.ending.load(Ordering::Relaxed) {
        let length = 1 + chance.below(MAX_FILE);
        let content = chance.volume(length);
        match put(shared.address, &content) {
            Ok(reply) if reply.status == 201 || reply.status == 200 => {
                shared.acknowledge(&reply.json(), &content);
            }
            Ok(reply) => assert!(reply.status == 503 || reply.status == 400, "PUT: {}", reply.status),
            Err(_) => shared.breaks(),
        }
    }
}

/// Sends one resumable file after the other; whatever breaks, it goes on with the same one.
fn resumable_client(shared: &Shared, mut chance: Chance) {
    while !shared.ending.load(Ordering::Relaxed) {
        let length = 1 + chance.below(MAX_FILE);
        let content = chance.volume(length);
        let first = &content[..if chance.below(2) == 0 { 0 } else { chance.below(content.len()) }];
        let begun = match begin(shared.address, content.len(), first) {
            Ok(reply) if reply.status == 201 => reply,
            Ok(reply) => {
                assert!(reply.status == 503 || reply.status == 400, "POST: {}", reply.status);
                continue;
            }
            Err(_) => {
                shared.breaks();
                continue;
            }
        };
        let path = begun.header("location").expect("an address").to_owned();
        let mut safe = begun.offset();
        let mut sure = true;
        while safe < content.len() {
            if !sure {
                let Ok(reply) = head(shared.address, &path) else {
                    shared.breaks();
                    continue;
                };
                if reply.status == 423 {
                    continue;
                }
                assert_eq!(reply.status, 200, "an acknowledged upload is there");
                assert!(
                    reply.offset() >= safe,
                    "{} bytes are there, {safe} were acknowledged",
                    reply.offset()
                );
                (safe, sure) = (reply.offset(), true);
                continue;
            }
            let end = content.len().min(safe + 1 + chance.below(MAX_PIECE));
            match append(shared.address, &path, safe, &content[safe..end]) {
                Ok(reply) if reply.status == 204 => {
                    assert_eq!(reply.offset(), end);
                    safe = end;
                }
                Ok(reply) => {
                    assert!([400, 423, 503].contains(&reply.status), "PATCH: {}", reply.status);
                    sure = false;
                }
                Err(_) => {
                    shared.breaks();
                    sure = false;
                }
            }
        }
        loop {
            match request(shared.address, "GET", &path, &[], &[]) {
                Ok(reply) => {
                    assert_eq!(reply.status, 200, "a complete upload is there");
                    let outcome = reply.json();
                    match outcome["state"].as_str() {
                        Some("stored") => {
                            shared.acknowledge(&outcome["dataset"], &content);
                            break;
                        }
                        Some("reading") => std::thread::sleep(Duration::from_millis(5)),
                        _ => panic!("an acknowledged upload became {outcome}"),
                    }
                }
                Err(_) => shared.breaks(),
            }
        }
    }
}

/// What must hold of a service at any moment: what it acknowledged is there and whole, and nothing is
/// there that is not whole.
fn check(server: &Server, data: &Path, acknowledged: &BTreeMap<String, blake3::Hash>) {
    let listed = server.uploaded();
    for id in acknowledged.keys() {
        assert!(listed.contains(id), "{id} was acknowledged and is not listed");
    }
    for id in &listed {
        let manifest = std::fs::read(data.join("datasets").join(format!("{id}.json"))).unwrap();
        let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
        let content = manifest["content"].as_str().unwrap();
        let file = data.join("blobs").join(content).join(manifest["main_file"].as_str().unwrap());
        let hash = blake3::hash(&std::fs::read(file).unwrap());
        assert_eq!(hash.to_hex().as_str(), content, "{id} is listed and not whole");
        if let Some(sent) = acknowledged.get(id) {
            assert_eq!(*sent, hash, "{id}");
        }
    }
}

#[test]
fn nothing_acknowledged_is_lost_however_often_the_service_is_killed() {
    let kills = std::env::var("TYNDALL_SOAK").ok().and_then(|text| text.parse().ok()).unwrap_or(KILLS);
    let seed = std::time::UNIX_EPOCH.elapsed().unwrap().as_millis() as u64;
    let mut chance = Chance::new(seed);
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let address = free_address();
    let shared = Arc::new(Shared {
        address,
        ending: AtomicBool::new(false),
        acknowledged: Mutex::default(),
        deleted: Mutex::default(),
        broken: AtomicUsize::new(0),
    });
    let start = || Server::start(address, &serve(address, &data)).expect("the service runs");
    let mut server = start();
    let spawn = |number: u64, client: fn(&Shared, Chance)| {
        let shared = shared.clone();
        std::thread::spawn(move || client(&shared, Chance::new(seed + 1 + number)))
    };
    let clients: Vec<_> = (0..RESUMABLE)
        .map(|number| spawn(number, resumable_client))
        .chain((0..PLAIN).map(|number| spawn(RESUMABLE + number, plain_client)))
        .collect();
    for kill in 0..kills {
        std::thread::sleep(Duration::from_millis(chance.below(MAX_LIFE) as u64));
        let acknowledged = shared.acknowledged.lock().unwrap().clone();
        server.kill();
        // The index is made from the manifests, whatever became of it.
        let index = data.join("index.sqlite");
        match kill % 4 {
            1 => std::fs::remove_file(&index).unwrap(),
            3 => std::fs::write(&index, b"not a database").unwrap(),
            _ => {}
        }
        server = start();
        check(&server, &data, &acknowledged);
        let deleted = shared.deleted.lock().unwrap().clone();
        assert!(server.uploaded().iter().all(|id| !deleted.contains(id)), "what was deleted stays so");
        for id in acknowledged.keys().skip(KEPT) {
            let reply = request(address, "DELETE", &format!("/api/v1/datasets/{id}"), &[], &[]).unwrap();
            assert_eq!(reply.status, 204);
            shared.acknowledged.lock().unwrap().remove(id);
            shared.deleted.lock().unwrap().insert(id.clone());
        }
        assert!(clients.iter().all(|client| !client.is_finished()), "a client gave up");
    }
    shared.ending.store(true, Ordering::Relaxed);
    for client in clients {
        client.join().expect("a client found what it was promised");
    }
    let acknowledged = shared.acknowledged.lock().unwrap().clone();
    check(&server, &data, &acknowledged);
    server.kill();
    let server = start();
    check(&server, &data, &acknowledged);
    // No bytes but those of datasets; of finished uploads only how they ended.
    let blobs = std::fs::read_dir(data.join("blobs")).unwrap().count();
    assert_eq!(blobs, server.uploaded().len(), "every blob has its dataset");
    assert_eq!(files_below(&data.join("incoming")), Vec::<std::path::PathBuf>::new());
    for path in files_below(&data.join("uploads")) {
        let record: serde_json::Value = match path.extension() {
            Some(ending) if ending == "json" => {
                serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap()
            }
            _ => {
                let record = std::fs::read(path.with_extension("json")).expect("bytes have a record");
                let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
                // Begun, and killed before its client heard its address.
                assert!(record["outcome"].is_null(), "{path:?}");
                continue;
            }
        };
        assert!(record["outcome"].is_null() || record["metadata"] == "", "{path:?}");
    }
    let broken = shared.broken.load(Ordering::Relaxed);
    let deleted = shared.deleted.lock().unwrap().len();
    eprintln!(
        "seed {seed}: {kills} kills, {broken} requests broke off, {} datasets acknowledged, {deleted} of them deleted, {} stored",
        acknowledged.len() + deleted,
        server.uploaded().len()
    );
    assert!(kills == 0 || broken > 0 && !acknowledged.is_empty(), "the kills met something");
}
