//! A service in a process of its own, and requests that may break off.

use std::io::{Error, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::Value;

/// Longest start: a software device compiles its first shaders, on a busy machine.
const START: Duration = Duration::from_secs(120);
/// Longest wait for an answer.
const ANSWER: Duration = Duration::from_secs(60);

/// A running service.
pub struct Server {
    child: Child,
    pub address: SocketAddr,
}

/// An address that nothing listens on.
pub fn free_address() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

/// The command that serves a data directory, to be wrapped or spawned.
pub fn serve(address: SocketAddr, data: &Path) -> Vec<String> {
    let program = env!("CARGO_BIN_EXE_tyndall");
    let data = data.to_str().unwrap();
    [program, "serve", "--listen", &address.to_string(), "--data", data].map(str::to_owned).into()
}

impl Server {
    /// Starts a command that serves at an address, and waits until it answers; `None` if it ends.
    pub fn start(address: SocketAddr, command: &[String]) -> Option<Self> {
        let mut spawned = Command::new(&command[0]);
        spawned.args(&command[1..]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let mut server = Self { child: spawned.spawn().unwrap(), address };
        let began = Instant::now();
        while request(address, "GET", "/api/v1/status", &[], &[]).map_or(true, |reply| reply.status != 200) {
            assert!(began.elapsed() < START, "the service does not answer");
            if server.child.try_wait().unwrap().is_some() {
                return None;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Some(server)
    }

    /// Ends it without warning.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Identifiers of what was uploaded.
    pub fn uploaded(&self) -> Vec<String> {
        let reply = request(self.address, "GET", "/api/v1/datasets", &[], &[]).unwrap();
        let list: Vec<Value> = serde_json::from_slice(&reply.body).unwrap();
        let mine = list.iter().filter(|dataset| dataset["sample"] == false);
        mine.map(|dataset| dataset["id"].as_str().unwrap().to_owned()).collect()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An answer.
pub struct Reply {
    pub status: u16,
    head: String,
    pub body: Vec<u8>,
}

impl Reply {
    pub fn header(&self, name: &str) -> Option<&str> {
        let mut lines = self.head.lines().filter_map(|line| line.split_once(": "));
        lines.find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }

    /// `Upload-Offset`.
    pub fn offset(&self) -> usize {
        self.header("upload-offset").expect("an offset").parse().unwrap()
    }
}

/// One request on a connection of its own.
///
/// # Errors
/// No connection, or one that broke off before the whole answer came.
pub fn request(
    address: SocketAddr,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &[u8],
) -> std::io::Result<Reply> {
    request_within(ANSWER, address, method, path, headers, body)
}

/// As [`request`], for answers that take longer.
///
/// # Errors
/// As [`request`].
pub fn request_within(
    patience: Duration,
    address: SocketAddr,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &[u8],
) -> std::io::Result<Reply> {
    let mut socket = TcpStream::connect_timeout(&address, ANSWER)?;
    socket.set_read_timeout(Some(patience))?;
    socket.set_write_timeout(Some(ANSWER))?;
    let mut head = format!("{method} {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n");
    for (name, value) in headers {
        head += &format!("{name}: {value}\r\n");
    }
    head += &format!("Content-Length: {}\r\n\r\n", body.len());
    socket.write_all(head.as_bytes())?;
    // A service that refuses a body answers before it has read it.
    let sent = body.chunks(64 << 10).try_for_each(|piece| socket.write_all(piece));
    let mut bytes = Vec::new();
    let read = socket.read_to_end(&mut bytes);
    let broken = || Error::other("the answer broke off");
    let end = bytes.windows(4).position(|window| window == b"\r\n\r\n");
    let Some(end) = end else {
        sent?;
        read?;
        return Err(broken());
    };
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let status = head.split(' ').nth(1).and_then(|text| text.parse().ok()).ok_or_else(broken)?;
    let reply = Reply { status, head, body: bytes.split_off(end + 4) };
    let length = reply.header("content-length").and_then(|text| text.parse::<usize>().ok());
    if method != "HEAD" && length.is_some_and(|length| reply.body.len() < length) {
        return Err(broken());
    }
    Ok(reply)
}

const TUS: (&str, &str) = ("Tus-Resumable", "1.0.0");
const BYTES: (&str, &str) = ("Content-Type", "application/offset+octet-stream");

/// Begins an upload, with the first bytes in the same request or without.
pub fn begin(address: SocketAddr, length: usize, first: &[u8]) -> std::io::Result<Reply> {
    let (length, metadata) = (length.to_string(), format!("filename {}", BASE64.encode("a.nrrd")));
    let mut headers = vec![TUS, ("Upload-Length", &length), ("Upload-Metadata", &metadata)];
    if !first.is_empty() {
        headers.push(BYTES);
    }
    request(address, "POST", "/api/v1/uploads", &headers, first)
}

/// Sends more of an upload.
pub fn append(address: SocketAddr, path: &str, offset: usize, bytes: &[u8]) -> std::io::Result<Reply> {
    let offset = offset.to_string();
    request(address, "PATCH", path, &[TUS, BYTES, ("Upload-Offset", &offset)], bytes)
}

/// Asks how much of an upload is safe.
pub fn head(address: SocketAddr, path: &str) -> std::io::Result<Reply> {
    request(address, "HEAD", path, &[TUS], &[])
}

/// Uploads a file in one request.
pub fn put(address: SocketAddr, bytes: &[u8]) -> std::io::Result<Reply> {
    request(address, "PUT", "/api/v1/datasets/a.nrrd", &[], bytes)
}

/// Numbers by chance (xorshift64*): a run is repeated by its seed, up to what the system decides.
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Below a bound.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.next() >> 33) as usize % bound
    }

    /// A volume file of about so many bytes that no other one equals.
    pub fn volume(&mut self, bytes: usize) -> Vec<u8> {
        let depth = bytes.div_ceil(64 * 64).max(2);
        let header = format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 64 64 {depth}\nencoding: raw\n\n");
        let mut file = header.into_bytes();
        let end = file.len() + depth * 64 * 64;
        while file.len() < end {
            file.extend(self.next().to_le_bytes());
        }
        file.truncate(end);
        file
    }
}

/// Every file below a folder, by its path in it.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let (mut left, mut found) = (vec![folder.to_owned()], Vec::new());
    while let Some(next) = left.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { left.push(path) } else { found.push(path) }
        }
    }
    found
}
