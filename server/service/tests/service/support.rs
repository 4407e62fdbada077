//! A service in a temporary directory, and clients for it.

use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use axum::body::{Body, to_bytes};
use axum::http::{HeaderMap, Method, Request, StatusCode, header};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use futures_util::{SinkExt, StreamExt};
use proto::control::{ClientMessage, ServerMessage};
use proto::frame::{FLAG_FINAL, FRAME_HEADER_BYTES, FrameHeader};
use proto::rest::{Problem, Session, Upload, UploadState};
use proto::scene_file::Camera;
use render::{AdapterPolicy, Gpu};
use serde_json::{Value, json};
use service::{App, Config};
use tempfile::TempDir;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream};
use tokio_util::sync::CancellationToken;
use tower::ServiceExt;

/// Largest body a test reads.
const MAX_BODY: usize = 64 << 20;
/// Longest wait for something that must come; far beyond what it takes.
pub const SOON: Duration = Duration::from_secs(60);
/// Longest life of a viewer: a stream of events that never ends fails, too.
const VIEWER_LIFE: Duration = Duration::from_secs(300);

/// Where uploads begin.
pub const UPLOADS: &str = "/api/v1/uploads";
/// Type of a body that brings bytes.
pub const BYTES: (&str, &str) = ("content-type", "application/offset+octet-stream");

static GPU: LazyLock<Arc<Gpu>> =
    LazyLock::new(|| Gpu::open(AdapterPolicy::Any).expect("tests need a device"));

/// A service with its own data directory.
pub struct Service {
    pub app: Arc<App>,
    pub folder: TempDir,
}

/// What a request was answered.
pub struct Answer {
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).expect("a JSON answer")
    }

    /// The answer as a problem document of a status.
    pub fn problem(&self, status: u16) -> Problem {
        let text = String::from_utf8_lossy(&self.body);
        assert_eq!(self.status.as_u16(), status, "{text}");
        assert_eq!(self.headers[header::CONTENT_TYPE], "application/problem+json");
        let problem: Problem = serde_json::from_slice(&self.body).expect("a problem document");
        assert_eq!(problem.status, status);
        assert!(!problem.title.is_empty() && !problem.detail.is_empty());
        problem
    }

    pub fn ok(self) -> Self {
        assert!(self.status.is_success(), "{}: {}", self.status, String::from_utf8_lossy(&self.body));
        self
    }
}

impl Service {
    pub fn new() -> Self {
        Self::with(|_| {})
    }

    pub fn with(adjust: impl FnOnce(&mut Config)) -> Self {
        Self::in_folder(tempfile::tempdir().unwrap(), adjust)
    }

    /// On a device of its own.
    pub fn on(gpu: Arc<Gpu>) -> Self {
        Self::started(tempfile::tempdir().unwrap(), |_| {}, gpu)
    }

    pub fn in_folder(folder: TempDir, adjust: impl FnOnce(&mut Config)) -> Self {
        Self::started(folder, adjust, GPU.clone())
    }

    fn started(folder: TempDir, adjust: impl FnOnce(&mut Config), gpu: Arc<Gpu>) -> Self {
        let _ = tracing_subscriber::fmt().with_test_writer().with_env_filter("service=debug").try_init();
        let mut config = Config { data: folder.path().join("data"), ..Config::default() };
        adjust(&mut config);
        let app = App::open(config, gpu).unwrap();
        Self { app, folder }
    }

    /// Another service on the same data directory, as after the process has ended. Whatever else
    /// holds this one must let go of it soon.
    pub async fn restarted(self) -> Self {
        Self::in_folder(self.stopped().await, |_| {})
    }

    /// The data directory of a service that has ended.
    pub async fn stopped(self) -> TempDir {
        let Self { app, folder } = self;
        let deadline = Instant::now() + SOON;
        while Arc::strong_count(&app) > 1 {
            assert!(Instant::now() < deadline, "somebody holds on to the service");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        folder
    }

    pub async fn send(&self, request: Request<Body>) -> Answer {
        let response = service::app(self.app.clone()).oneshot(request).await.unwrap();
        let (status, headers) = (response.status(), response.headers().clone());
        let body = to_bytes(response.into_body(), MAX_BODY).await.unwrap().to_vec();
        Answer { status, headers, body }
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.send(Request::get(format!("/api/v1{path}")).body(Body::empty()).unwrap()).await
    }

    pub async fn json(&self, method: Method, path: &str, body: Value) -> Answer {
        let request = Request::builder()
            .method(method)
            .uri(format!("/api/v1{path}"))
            .header(header::CONTENT_TYPE, "application/json");
        self.send(request.body(Body::from(body.to_string())).unwrap()).await
    }

    pub async fn delete(&self, path: &str) -> Answer {
        self.send(Request::delete(format!("/api/v1{path}")).body(Body::empty()).unwrap()).await
    }

    pub async fn put(&self, path: &str, body: impl Into<Body>) -> Answer {
        self.send(Request::put(format!("/api/v1{path}")).body(body.into()).unwrap()).await
    }

    /// Uploads files as parts of a form.
    pub async fn form(&self, parts: &[(&str, &str, &[u8])]) -> Answer {
        let mut body = Vec::new();
        for (field, file, content) in parts {
            body.extend_from_slice(
                format!(
                    "--XX\r\nContent-Disposition: form-data; name=\"{field}\"; filename=\"{file}\"\r\n\r\n"
                )
                .as_bytes(),
            );
            body.extend_from_slice(content);
            body.extend_from_slice(b"\r\n");
        }
        body.extend_from_slice(b"--XX--\r\n");
        let request = Request::post("/api/v1/datasets")
            .header(header::CONTENT_TYPE, "multipart/form-data; boundary=XX")
            .body(Body::from(body))
            .unwrap();
        self.send(request).await
    }

    /// A request below `/uploads` that speaks tus 1.0.0.
    pub async fn tus(
        &self,
        method: &str,
        path: &str,
        headers: &[(&str, &str)],
        body: impl Into<Body>,
    ) -> Answer {
        let uri = if path.starts_with('/') { path.to_owned() } else { format!("/api/v1/uploads/{path}") };
        let mut request = Request::builder().method(method).uri(uri).header("tus-resumable", "1.0.0");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        self.send(request.body(body.into()).unwrap()).await
    }

    /// Begins an upload of a file; its address.
    pub async fn begin(&self, name: &str, length: usize) -> String {
        let metadata = format!("filename {}", BASE64.encode(name));
        let length = length.to_string();
        let headers = [("upload-length", length.as_str()), ("upload-metadata", &metadata)];
        let answer = self.tus("POST", UPLOADS, &headers, Body::empty()).await;
        assert_eq!(answer.status, StatusCode::CREATED, "{}", String::from_utf8_lossy(&answer.body));
        answer.headers[header::LOCATION].to_str().unwrap().to_owned()
    }

    /// Sends bytes of an upload from an offset.
    pub async fn append(&self, upload: &str, offset: usize, body: impl Into<Body>) -> Answer {
        let offset = offset.to_string();
        self.tus("PATCH", upload, &[BYTES, ("upload-offset", &offset)], body).await
    }

    /// What is safe of an upload.
    pub async fn offset(&self, upload: &str) -> usize {
        let answer = self.tus("HEAD", upload, &[], Body::empty()).await.ok();
        answer.headers["upload-offset"].to_str().unwrap().parse().unwrap()
    }

    /// What came of a complete upload.
    pub async fn outcome(&self, upload: &str) -> Upload {
        for _ in 0..1000 {
            let answer = self.tus("GET", upload, &[], Body::empty()).await.ok();
            let upload: Upload = serde_json::from_slice(&answer.body).unwrap();
            if upload.state != UploadState::Reading {
                return upload;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        panic!("the upload is still being read");
    }

    /// Opens a session on a small lit volume.
    pub async fn session(&self) -> Session {
        let answer = self.json(Method::POST, "/sessions", json!({"scene": small_scene()})).await;
        assert_eq!(answer.status, StatusCode::CREATED, "{}", String::from_utf8_lossy(&answer.body));
        serde_json::from_slice(&answer.body).unwrap()
    }

    /// Names of everything below the data directory that belongs to datasets.
    pub fn stored_files(&self) -> Vec<String> {
        let mut found = Vec::new();
        for part in ["datasets", "blobs", "incoming", "uploads"] {
            let entries = std::fs::read_dir(self.folder.path().join("data").join(part)).unwrap();
            found.extend(entries.map(|e| format!("{part}/{}", e.unwrap().file_name().to_string_lossy())));
        }
        found
    }

    /// Listens on a free port.
    pub async fn listen(&self) -> Listening {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let stop = CancellationToken::new();
        let stopped = stop.clone().cancelled_owned();
        let server = tokio::spawn(service::serve_on(listener, self.app.clone(), stopped));
        Listening { address, stop, server }
    }
}

/// A service that listens.
pub struct Listening {
    pub address: std::net::SocketAddr,
    pub stop: CancellationToken,
    pub server: tokio::task::JoinHandle<Result<(), service::ServeError>>,
}

impl Listening {
    /// Ends the server; connections are closed.
    pub async fn stopped(self) {
        self.stop.cancel();
        self.server.await.unwrap().unwrap();
    }

    pub fn view_url(&self, session: &str) -> String {
        format!("ws://{}/api/v1/sessions/{session}/view", self.address)
    }

    /// A viewer that has said hello and was welcomed.
    pub async fn viewer(&self, session: &str) -> Viewer {
        Viewer::greeted(&self.view_url(session)).await
    }

    /// A connection on which nothing was said.
    pub async fn silent_viewer(&self, session: &str) -> Viewer {
        Viewer::connected(&self.view_url(session)).await
    }
}

/// A viewer's side of the WebSocket.
pub struct Viewer {
    pub socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
    /// Whether frames are acknowledged as they come.
    pub acknowledges: bool,
    since: Instant,
}

/// What a viewer is sent.
#[derive(Debug)]
pub enum Event {
    Frame(Frame),
    Message(ServerMessage),
    Closed(u16),
}

#[derive(Debug, Clone)]
pub struct Frame {
    pub header: FrameHeader,
    pub payload: Vec<u8>,
}

impl Frame {
    pub fn is_final(&self) -> bool {
        self.header.flags & FLAG_FINAL != 0
    }

    /// Decoded pixels, RGB.
    pub fn pixels(&self) -> image::RgbImage {
        image::load_from_memory(&self.payload).unwrap().to_rgb8()
    }
}

impl Viewer {
    async fn connected(url: &str) -> Self {
        let (socket, _) = tokio_tungstenite::connect_async(url).await.unwrap();
        Self { socket, acknowledges: true, since: Instant::now() }
    }

    /// One that has said hello and was welcomed.
    pub async fn greeted(url: &str) -> Self {
        let mut viewer = Self::connected(url).await;
        viewer.send(&ClientMessage::Hello { protocol: 1, resume: None }).await;
        assert!(matches!(viewer.message().await, ServerMessage::Welcome { .. }));
        viewer
    }

    pub async fn send(&mut self, message: &ClientMessage) {
        self.send_text(serde_json::to_string(message).unwrap()).await;
    }

    pub async fn send_text(&mut self, text: String) {
        self.socket.send(Message::Text(text.into())).await.unwrap();
    }

    pub async fn viewport(&mut self, seq: u32, width: u32, height: u32) {
        self.send(&ClientMessage::Viewport { seq, width, height, pixel_ratio: 1.0 }).await;
    }

    pub async fn patch(&mut self, seq: u32, patch: Value) {
        self.send(&ClientMessage::Patch { seq, patch }).await;
    }

    pub async fn camera(&mut self, seq: u32, camera: Camera) {
        self.send(&ClientMessage::Camera { seq, camera }).await;
    }

    pub async fn acknowledge(&mut self, frame: u32) {
        self.send(&ClientMessage::Ack { frame, decode_millis: 1.0 }).await;
    }

    /// The next thing sent, `None` if nothing comes within the time.
    pub async fn event_within(&mut self, time: Duration) -> Option<Event> {
        let end = tokio::time::Instant::now() + time;
        loop {
            let message = tokio::time::timeout_at(end, self.socket.next()).await.ok()?;
            match message {
                Some(Ok(Message::Text(text))) => {
                    return Some(Event::Message(serde_json::from_str(&text).expect("a server message")));
                }
                Some(Ok(Message::Binary(bytes))) => {
                    let header = FrameHeader::decode(&bytes).expect("a frame");
                    let payload = bytes[FRAME_HEADER_BYTES..].to_vec();
                    assert_eq!(payload.len(), header.payload_bytes as usize);
                    if self.acknowledges {
                        self.acknowledge(header.frame).await;
                    }
                    return Some(Event::Frame(Frame { header, payload }));
                }
                Some(Ok(Message::Close(frame))) => {
                    return Some(Event::Closed(frame.map_or(1005, |f| f.code.into())));
                }
                Some(Ok(_)) => {}
                Some(Err(_)) | None => return Some(Event::Closed(1006)),
            }
        }
    }

    pub async fn event(&mut self) -> Event {
        assert!(self.since.elapsed() < VIEWER_LIFE, "what was waited for never came");
        self.event_within(SOON).await.expect("something should have come")
    }

    /// The next message; frames before it are dropped.
    pub async fn message(&mut self) -> ServerMessage {
        loop {
            match self.event().await {
                Event::Message(message) => return message,
                Event::Frame(_) => {}
                Event::Closed(code) => panic!("closed with {code}"),
            }
        }
    }

    /// The next message of a kind; others are dropped.
    pub async fn message_of<T>(&mut self, mut pick: impl FnMut(ServerMessage) -> Option<T>) -> T {
        loop {
            if let Some(found) = pick(self.message().await) {
                return found;
            }
        }
    }

    /// Frames up to and including the final one.
    pub async fn frames_until_final(&mut self) -> Vec<Frame> {
        let mut frames: Vec<Frame> = Vec::new();
        loop {
            match self.event().await {
                Event::Frame(frame) => {
                    let last = frame.is_final();
                    frames.push(frame);
                    if last {
                        return frames;
                    }
                }
                Event::Message(ServerMessage::Failed { message }) => panic!("failed: {message}"),
                Event::Message(_) => {}
                Event::Closed(code) => panic!("closed with {code}"),
            }
        }
    }

    /// The code the connection is closed with.
    pub async fn close_code(&mut self) -> u16 {
        loop {
            if let Event::Closed(code) = self.event().await {
                return code;
            }
        }
    }
}

/// Pillars under a light, small and quick.
pub fn small_scene() -> Value {
    json!({
        "version": 1,
        "volume": {"builtin": "pillars", "dims": [24, 24, 24]},
        "value_range": [0, 1],
        "transfer_function": {"points": [
            {"s": 0.0, "extinction": 0.0},
            {"s": 0.3, "extinction": 0.0, "albedo": [0.9, 0.5, 0.3]},
            {"s": 1.0, "extinction": 80.0, "albedo": [0.4, 0.6, 0.9]}
        ]},
        "lights": [
            {"id": "sun", "type": "directional", "direction": [0.3, -0.6, -0.7], "irradiance": [3, 3, 3]},
            {"id": "room", "type": "environment", "radiance": [0.1, 0.1, 0.1]}
        ],
        "sampling": {"samples_per_pixel": 4, "step_voxels": 1.0},
        "image": {"width": 64, "height": 48}
    })
}

/// A view from a direction around the volume.
pub fn camera_at(degrees: f64) -> Camera {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Camera {
        position: [2.2 * sin, 0.4, 2.2 * cos],
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y_degrees: Some(40.0),
        orthographic_height: None,
    }
}

/// An NRRD file of a ball in a box of 16^3 voxels; `seed` varies the content.
pub fn nrrd(seed: u8) -> Vec<u8> {
    let mut bytes =
        b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 16 16\nspacings: 1 1 2\nencoding: raw\n\n".to_vec();
    bytes.extend(ball(seed));
    bytes
}

/// The voxels of [`nrrd`].
pub fn ball(seed: u8) -> Vec<u8> {
    (0..16 * 16 * 16)
        .map(|index| {
            let at = [index % 16, index / 16 % 16, index / 256].map(|i| f64::from(i) - 7.5);
            let radius = at.iter().map(|x| x * x).sum::<f64>().sqrt();
            ((8.0 - radius).max(0.0) * 25.0) as u8 ^ (seed & 1) | seed
        })
        .collect()
}
