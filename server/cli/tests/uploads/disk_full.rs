//! A full disk: told in words, nothing half-visible, and what was acknowledged stays.

use std::path::Path;
use std::process::Command;

use crate::client::{
    Chance, Reply, Server, append, begin, files_below, free_address, head, put, request, serve,
};

/// Largest file of the limited service, KiB.
const LIMIT_KIB: usize = 1024;
/// Size of the small disk, bytes; the samples that the service writes there take some.
const DISK_BYTES: usize = 24 << 20;

fn refused_for_room(reply: &Reply) {
    let text = String::from_utf8_lossy(&reply.body);
    assert_eq!(reply.status, 507, "{text}");
    assert_eq!(reply.header("content-type"), Some("application/problem+json"));
    assert!(reply.json()["detail"].as_str().unwrap().contains("disk of the service is full"), "{text}");
}

/// The command under a shell that first does something else.
fn wrapped(shell: &str, first: &str, command: &[String]) -> Vec<String> {
    let mut whole: Vec<String> = shell.split(' ').map(str::to_owned).collect();
    whole.extend(["-c".to_owned(), format!("{first} && exec \"$@\""), "sh".to_owned()]);
    whole.extend(command.iter().cloned());
    whole
}

#[test]
fn files_that_cannot_grow_are_refused_and_what_was_acknowledged_stays() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let address = free_address();
    // Every write beyond the limit fails as on a disk without room.
    let limited = wrapped("bash", &format!("trap '' XFSZ && ulimit -f {LIMIT_KIB}"), &serve(address, &data));
    let server = Server::start(address, &limited).expect("the service runs");
    let file = Chance::new(7).volume(3 * LIMIT_KIB * 1024);
    refused_for_room(&put(address, &file).unwrap());
    let upload = begin(address, file.len(), &[]).unwrap();
    assert_eq!(upload.status, 201);
    let path = upload.header("location").unwrap();
    refused_for_room(&append(address, path, 0, &file).unwrap());
    assert_eq!(head(address, path).unwrap().offset(), 0);
    let some = LIMIT_KIB * 1024 / 2;
    assert_eq!(append(address, path, 0, &file[..some]).unwrap().status, 204);
    refused_for_room(&append(address, path, some, &file[some..]).unwrap());
    assert_eq!(head(address, path).unwrap().offset(), some, "what was acknowledged stays");
    assert!(server.uploaded().is_empty());
    let big = files_below(&data).into_iter().filter(|path| !path.starts_with(data.join("samples")));
    let bytes: u64 = big.map(|path| path.metadata().unwrap().len()).sum();
    assert!(bytes < LIMIT_KIB as u64 * 1024, "what was refused takes no room: {bytes} bytes");
    server.kill();

    let server = Server::start(address, &serve(address, &data)).expect("the service runs");
    assert_eq!(head(address, path).unwrap().offset(), some);
    assert_eq!(append(address, path, some, &file[some..]).unwrap().status, 204);
    assert_eq!(wait_for_outcome(&server, path), "stored");
    assert_eq!(server.uploaded().len(), 1);
}

#[test]
fn a_disk_that_fills_up_is_told_in_words_and_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_owned();
    let address = free_address();
    let mount = format!("mount -t tmpfs -o size={DISK_BYTES} none '{}'", data.display());
    if !can_mount(&data) {
        eprintln!("left out: no small disk can be mounted here (unshare, mount)");
        return;
    }
    let command = wrapped("unshare --map-root-user --mount sh", &mount, &serve(address, &data));
    let server = Server::start(address, &command).expect("the service runs");
    let mut chance = Chance::new(8);
    let mut stored = Vec::new();
    let full = loop {
        let reply = put(address, &chance.volume(3 << 20)).unwrap();
        if reply.status != 201 {
            break reply;
        }
        stored.push(reply.json()["id"].as_str().unwrap().to_owned());
        assert!(stored.len() < DISK_BYTES / (3 << 20), "the disk fills up");
    };
    refused_for_room(&full);
    assert!(!stored.is_empty());
    let file = chance.volume(3 << 20);
    let upload = begin(address, file.len(), &[]).unwrap();
    assert_eq!(upload.status, 201);
    let path = upload.header("location").unwrap();
    refused_for_room(&append(address, path, 0, &file).unwrap());
    let safe = head(address, path).unwrap().offset();
    let mut listed = server.uploaded();
    listed.sort();
    stored.sort();
    assert_eq!(listed, stored, "what was stored is there, and nothing else");

    // Room is made, and the upload goes on.
    let removed = format!("/api/v1/datasets/{}", stored[0]);
    assert_eq!(request(address, "DELETE", &removed, &[], &[]).unwrap().status, 204);
    assert_eq!(append(address, path, safe, &file[safe..]).unwrap().status, 204);
    assert_eq!(wait_for_outcome(&server, path), "stored");
    assert_eq!(server.uploaded().len(), stored.len());
}

fn can_mount(folder: &Path) -> bool {
    let script = format!("mount -t tmpfs -o size=1m none '{}'", folder.display());
    let trial = Command::new("unshare").args(["--map-root-user", "--mount", "sh", "-c", &script]).output();
    trial.is_ok_and(|output| output.status.success())
}

fn wait_for_outcome(server: &Server, path: &str) -> String {
    loop {
        let outcome = request(server.address, "GET", path, &[], &[]).unwrap().json();
        match outcome["state"].as_str().unwrap() {
            "reading" => std::thread::sleep(std::time::Duration::from_millis(20)),
            state => return state.to_owned(),
        }
    }
}
