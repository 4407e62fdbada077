//! The sending half of a viewer's connection.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, WebSocket};
use futures_util::SinkExt;
use futures_util::stream::SplitSink;
use parking_lot::Mutex;
use proto::control::ServerMessage;
use serde::Serialize;
use tokio::sync::{mpsc, watch};
use tokio::time::{sleep_until, timeout};

use super::Note;
use super::link::LinkMeter;
use crate::App;
use crate::render_thread::{Encoding, FinishedFrame, Output};
use crate::sessions::Member;

/// Longest time one message may take to leave; then the viewer counts as gone.
pub(super) const SEND_TIME: Duration = Duration::from_secs(10);
/// Longest time the last messages may take.
const LAST_SEND_TIME: Duration = Duration::from_secs(1);
/// Shortest time between two scenes: a drag sends many edits, and each answer is a whole scene.
const SCENE_INTERVAL: Duration = Duration::from_millis(50);
/// How often a quiet connection is tested.
const PING_INTERVAL: Duration = Duration::from_secs(20);

/// Sends what a viewer gets.
pub(super) struct Writer {
    pub app: Arc<App>,
    pub member: Arc<Member>,
    pub meter: Arc<Mutex<LinkMeter>>,
    pub notes: mpsc::Receiver<Note>,
    pub outputs: mpsc::Receiver<Output>,
    pub epochs: watch::Receiver<u32>,
}

/// The viewer is gone.
struct Gone;

type Sink = SplitSink<WebSocket, Message>;

impl Writer {
    /// Sends until the reader is done, the viewer is gone, or it is told to close.
    pub async fn run(mut self, mut sink: Sink, welcome: ServerMessage) {
        // Gone or told to go: either way there is nobody to tell.
        let _ = self.send_all(&mut sink, welcome).await;
    }

    async fn send_all(&mut self, sink: &mut Sink, welcome: ServerMessage) -> Result<(), Gone> {
        self.epochs.mark_unchanged();
        text(sink, &welcome).await?;
        let mut next_scene = tokio::time::Instant::now();
        // No longer once another connection goes on with this viewer; the reader says what follows.
        let mut drawn_for = true;
        let mut pings = tokio::time::interval(PING_INTERVAL);
        pings.reset();
        loop {
            let scene_changed = async {
                sleep_until(next_scene).await;
                self.epochs.changed().await
            };
            tokio::select! {
                biased;
                note = self.notes.recv() => match note {
                    Some(Note::Message(message)) => text(sink, &message).await?,
                    Some(Note::Close(code, reason)) => {
                        let frame = CloseFrame { code, reason: reason.into() };
                        let closing = sink.send(Message::Close(Some(frame)));
                        return timeout(LAST_SEND_TIME, closing).await.map(|_| ()).map_err(|_| Gone);
                    }
                    None => return Ok(()),
                },
                Ok(()) = scene_changed => {
                    next_scene = tokio::time::Instant::now() + SCENE_INTERVAL;
                    let member = self.member.clone();
                    let message = move || member.session.scene_message(member.number);
                    let message = crate::blocking("telling a viewer the scene", message).await;
                    text(sink, &message.map_err(|_| Gone)?).await?;
                }
                output = self.outputs.recv(), if drawn_for => match output {
                    Some(output) => self.output(sink, output).await?,
                    None => drawn_for = false,
                },
                _ = pings.tick() => send(sink, Message::Ping(Bytes::new())).await?,
            }
        }
    }

    async fn output(&self, sink: &mut Sink, output: Output) -> Result<(), Gone> {
        match output {
            Output::Frame(finished) => self.frame(sink, *finished).await,
            Output::Unchanged { frame, report } => text(sink, &ServerMessage::Report { frame, report }).await,
            Output::Failed(message) => text(sink, &ServerMessage::Failed { message }).await,
        }
    }

    async fn frame(&self, sink: &mut Sink, finished: FinishedFrame) -> Result<(), Gone> {
        let _permit = self.app.encodes.acquire().await.map_err(|_| Gone)?;
        let encoded = crate::blocking("encoding a frame", move || {
            let began = Instant::now();
            let bytes = crate::encode::frame(&finished);
            (bytes, began.elapsed(), finished)
        });
        let (bytes, encoding, finished) = encoded.await.map_err(|_| Gone)?;
        drop(_permit);
        let number = finished.header.frame;
        let bytes = match bytes {
            Ok(bytes) => bytes,
            Err(error) => {
                tracing::error!(%error, "a frame cannot be encoded");
                // It will never be acknowledged.
                self.app.renderer().update(self.member.render, |input| {
                    input.acknowledged = input.acknowledged.max(number);
                });
                let message = "A picture could not be encoded; the server's log says more.".into();
                return text(sink, &ServerMessage::Failed { message }).await;
            }
        };
        let pixels = u64::from(finished.picture.width) * u64::from(finished.picture.height);
        let moving_pixels = matches!(finished.encoding, Encoding::Moving(_)).then_some(pixels);
        self.meter.lock().sent(number, bytes.len() as u64, moving_pixels, Instant::now());
        let (length, began) = (bytes.len(), Instant::now());
        send(sink, Message::Binary(bytes.into())).await?;
        let sending = began.elapsed();
        self.app.metrics().frame(&finished, length, encoding, sending);
        tracing::debug!(frame = number, epoch = finished.header.snapshot_epoch, bytes = length, "sent");
        text(sink, &ServerMessage::Report { frame: number, report: Box::new(finished.report) }).await
    }
}

async fn text(sink: &mut Sink, message: &impl Serialize) -> Result<(), Gone> {
    let text = serde_json::to_string(message).map_err(|error| {
        tracing::error!(%error, "a message cannot be written");
        Gone
    })?;
    send(sink, Message::Text(text.into())).await
}

async fn send(sink: &mut Sink, message: Message) -> Result<(), Gone> {
    match timeout(SEND_TIME, sink.send(message)).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => Err(Gone),
    }
}
