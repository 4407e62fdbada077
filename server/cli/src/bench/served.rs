//! A service in this process, on a socket as any client meets it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow};
use axum::body::Body;
use axum::http::{Request, header};
use futures_util::{SinkExt, StreamExt};
use proto::control::PROTOCOL_VERSION;
use proto::frame::{FRAME_HEADER_BYTES, FrameHeader};
use proto::rest::DeviceInfo;
use proto::{ClientMessage, SceneFile};
use render::{AdapterPolicy, Gpu};
use serde_json::json;
use service::{App, Config};
use tokio::net::TcpStream;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream};
use tower::ServiceExt as _;

/// Longest answer that is read.
const MAX_BODY: usize = 1 << 20;

/// A service with a data directory of its own.
pub struct Served {
    state: Arc<App>,
    address: std::net::SocketAddr,
    stop: oneshot::Sender<()>,
    server: JoinHandle<Result<(), service::ServeError>>,
    data: PathBuf,
    /// What draws.
    pub device: DeviceInfo,
}

impl Served {
    /// Opens the device and listens on a free port.
    ///
    /// # Errors
    /// No device, no port, no directory.
    pub async fn open() -> anyhow::Result<Self> {
        let data = std::env::temp_dir().join(format!("tyndall-bench-{}", std::process::id()));
        let config = Config { data: data.clone(), ..Config::default() };
        let gpu = tokio::task::spawn_blocking(|| Gpu::open(AdapterPolicy::Any)).await??;
        let device = gpu.info().clone();
        let state = tokio::task::spawn_blocking(move || App::open(config, gpu)).await??;
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
        let address = listener.local_addr()?;
        let (stop, stopped) = oneshot::channel::<()>();
        let server = tokio::spawn(service::serve_on(listener, state.clone(), async {
            let _ = stopped.await;
        }));
        Ok(Self { state, address, stop, server, data, device })
    }

    /// Stops, and removes the data directory.
    ///
    /// # Errors
    /// What the service ended with.
    pub async fn close(self) -> anyhow::Result<()> {
        let _ = self.stop.send(());
        self.server.await??;
        let _ = std::fs::remove_dir_all(self.data);
        Ok(())
    }

    /// The identifier of a new session on a scene.
    ///
    /// # Errors
    /// The service refuses the scene.
    pub async fn session(&self, scene: &SceneFile) -> anyhow::Result<String> {
        let request = Request::post("/api/v1/sessions")
            .header(header::CONTENT_TYPE, "application/json")
            .header(header::HOST, "127.0.0.1")
            .body(Body::from(serde_json::to_vec(&json!({"scene": scene}))?))?;
        let response = service::app(self.state.clone()).oneshot(request).await?;
        let status = response.status();
        let body = axum::body::to_bytes(response.into_body(), MAX_BODY).await?;
        if !status.is_success() {
            return Err(anyhow!("{status}: {}", String::from_utf8_lossy(&body)));
        }
        let session: proto::rest::Session = serde_json::from_slice(&body)?;
        Ok(session.id)
    }

    /// Bytes of all volumes on the GPU.
    pub fn volume_bytes(&self) -> u64 {
        self.state.renderer().volumes().bytes()
    }

    /// A viewer of a session that has said hello and how large its picture is.
    ///
    /// # Errors
    /// The connection breaks.
    pub async fn viewer(&self, session: &str, (width, height): (u32, u32)) -> anyhow::Result<Viewer> {
        let url = format!("ws://{}/api/v1/sessions/{session}/view", self.address);
        let (socket, _) = tokio_tungstenite::connect_async(url).await?;
        let mut viewer = Viewer { socket };
        viewer.send(&ClientMessage::Hello { protocol: PROTOCOL_VERSION, resume: None }).await?;
        viewer.send(&ClientMessage::Viewport { seq: 1, width, height, pixel_ratio: 1.0 }).await?;
        Ok(viewer)
    }
}

/// A viewer's side of the socket.
pub struct Viewer {
    socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
}

/// A frame as it came.
pub struct Frame {
    /// What it shows and what it cost.
    pub header: FrameHeader,
    /// Header and payload, bytes.
    pub bytes: usize,
    /// The encoded picture.
    pub payload: Vec<u8>,
}

/// What a viewer is sent.
pub enum Event {
    Frame(Frame),
    /// A message as text: none is looked at here.
    Message,
}

impl Viewer {
    /// # Errors
    /// The connection breaks.
    pub async fn send(&mut self, message: &ClientMessage) -> anyhow::Result<()> {
        self.socket.send(Message::Text(serde_json::to_string(message)?.into())).await?;
        Ok(())
    }

    /// The next thing sent; frames are to be acknowledged. Nothing is lost if the future is dropped.
    ///
    /// # Errors
    /// The connection breaks.
    pub async fn event(&mut self) -> anyhow::Result<Event> {
        loop {
            let message = self.socket.next().await.context("the service closed the connection")??;
            match message {
                Message::Binary(bytes) => {
                    let header = FrameHeader::decode(&bytes).context("not a frame")?;
                    let payload = bytes[FRAME_HEADER_BYTES..].to_vec();
                    return Ok(Event::Frame(Frame { header, bytes: bytes.len(), payload }));
                }
                Message::Text(_) => return Ok(Event::Message),
                _ => {}
            }
        }
    }

    /// Says that a frame was shown.
    ///
    /// # Errors
    /// The connection breaks.
    pub async fn acknowledge(&mut self, frame: &FrameHeader) -> anyhow::Result<()> {
        self.send(&ClientMessage::Ack { frame: frame.frame, decode_millis: 0.0 }).await
    }

    /// All frames that come within a time, each acknowledged.
    ///
    /// # Errors
    /// The connection breaks.
    pub async fn frames_within(&mut self, time: Duration) -> anyhow::Result<Vec<Frame>> {
        let end = tokio::time::Instant::now() + time;
        let mut frames = Vec::new();
        while let Ok(event) = tokio::time::timeout_at(end, self.event()).await {
            if let Event::Frame(frame) = event? {
                self.acknowledge(&frame.header).await?;
                frames.push(frame);
            }
        }
        Ok(frames)
    }

    /// # Errors
    /// The connection breaks.
    pub async fn close(mut self) -> anyhow::Result<()> {
        Ok(self.socket.close(None).await?)
    }
}
