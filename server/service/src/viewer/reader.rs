//! The receiving half of a viewer's connection: inputs, gathered and applied.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::SplitStream;
use futures_util::{FutureExt, StreamExt};
use parking_lot::Mutex;
use proto::FieldError;
use proto::control::{ClientMessage, Role, ServerMessage};
use proto::scene_file::Camera;
use serde_json::Value;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::{sleep_until, timeout};

use super::link::LinkMeter;
use super::{CLOSE_GOING_AWAY, CLOSE_NO_SESSION, CLOSE_TAKEN_OVER, CLOSE_TOO_SLOW, Note};
use crate::App;
use crate::problem::Answer;
use crate::sessions::{Loaded, Member, Patched, WATCH_ONLY};

/// A connection on which nothing arrives for this long, not even answers to pings, is dead.
const SILENCE: Duration = Duration::from_secs(60);
/// Messages of this size take long enough to decode that another thread does it.
const LARGE_MESSAGE_BYTES: usize = 32 << 10;
/// Messages taken together at most.
const MAX_TOGETHER: usize = 256;
/// Shortest time between two applications of edits; what arrives between is applied together.
const PATCH_INTERVAL: Duration = Duration::from_millis(8);
/// Most edits that wait, and their bytes; further ones are refused.
const MAX_WAITING_PATCHES: usize = 256;
const MAX_WAITING_PATCH_BYTES: usize = 4 << 20;
/// Most device pixels of a viewport edge, and of the whole; larger ones are drawn smaller.
const MAX_VIEWPORT_EDGE: f64 = 4096.0;
const MAX_VIEWPORT_PIXELS: f64 = 3840.0 * 2160.0;
/// Most CSS pixels of a viewport edge.
const MAX_CSS_EDGE: u32 = 32_768;
/// Device pixels per CSS pixel.
const PIXEL_RATIOS: std::ops::RangeInclusive<f64> = 0.25..=4.0;
/// Shortest time between two progress messages.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

type Loading = Pin<Box<dyn Future<Output = Answer<Arc<Loaded>>> + Send>>;

/// Takes what a viewer sends.
pub(super) struct Reader {
    app: Arc<App>,
    member: Arc<Member>,
    meter: Arc<Mutex<LinkMeter>>,
    notes: mpsc::Sender<Note>,
    /// Edits not applied yet, in order, and their bytes.
    patches: Vec<(u32, Value)>,
    patch_bytes: usize,
    camera: Option<(u32, Camera)>,
    /// When the oldest of the gathered inputs arrived.
    arrived: Instant,
    /// The volume that the edits wait for.
    loading: Option<Loading>,
    next_patch: tokio::time::Instant,
}

/// Why reading ended.
enum End {
    /// The viewer left, or cannot be reached.
    Left,
    /// It is sent away.
    Close(u16, &'static str),
}

impl Reader {
    pub fn new(
        app: Arc<App>,
        member: Arc<Member>,
        meter: Arc<Mutex<LinkMeter>>,
        notes: mpsc::Sender<Note>,
    ) -> Self {
        Self {
            app,
            member,
            meter,
            notes,
            patches: Vec::new(),
            patch_bytes: 0,
            camera: None,
            arrived: Instant::now(),
            loading: None,
            next_patch: tokio::time::Instant::now(),
        }
    }

    /// Reads until the viewer leaves, the writer ends, or the viewer is sent away.
    pub async fn run(mut self, mut stream: SplitStream<WebSocket>, writer: &JoinHandle<()>) {
        let end = self.read_all(&mut stream).await;
        if let End::Close(code, reason) = end
            && !writer.is_finished()
        {
            let message = ServerMessage::Closing { reason: reason.to_owned() };
            let notes = [Note::Message(Box::new(message)), Note::Close(code, reason.to_owned())];
            for note in notes {
                // A full queue belongs to a viewer that does not read; it is dropped with it.
                if self.notes.try_send(note).is_err() {
                    break;
                }
            }
        }
    }

    async fn read_all(&mut self, stream: &mut SplitStream<WebSocket>) -> End {
        let closing = self.app.closing().clone();
        let ended = self.member.session.ended.clone();
        let taken_over = self.member.taken_over.clone();
        let notes = self.notes.clone();
        loop {
            let edits_due = !self.patches.is_empty() && self.loading.is_none();
            let next_patch = self.next_patch;
            let loaded = async {
                match &mut self.loading {
                    Some(loading) => loading.await,
                    None => std::future::pending().await,
                }
            };
            let outcome = tokio::select! {
                biased;
                () = closing.cancelled() => return End::Close(CLOSE_GOING_AWAY, "the service is stopping"),
                () = ended.cancelled() => return End::Close(CLOSE_NO_SESSION, "the session was closed"),
                () = taken_over.cancelled() => return End::Close(CLOSE_TAKEN_OVER, "the viewer goes on elsewhere"),
                () = notes.closed() => return End::Left,
                loaded = loaded => {
                    self.loading = None;
                    self.loaded(loaded).await
                }
                () = sleep_until(next_patch), if edits_due => self.apply_patches(None).await,
                message = timeout(SILENCE, stream.next()) => match message {
                    Ok(Some(Ok(message))) => self.take_together(message, stream).await,
                    Ok(Some(Err(_)) | None) | Err(_) => return End::Left,
                },
            };
            if let Err(end) = outcome {
                return end;
            }
        }
    }

    /// Takes a message and all others that have arrived, then applies what they come to.
    async fn take_together(
        &mut self,
        first: Message,
        stream: &mut SplitStream<WebSocket>,
    ) -> Result<(), End> {
        self.arrived = Instant::now();
        self.take(first).await?;
        for _ in 1..MAX_TOGETHER {
            match stream.next().now_or_never() {
                Some(Some(Ok(message))) => self.take(message).await?,
                Some(Some(Err(_)) | None) => return Err(End::Left),
                None => break,
            }
        }
        // A camera stands for itself; edits wait for the next moment of their rhythm.
        self.apply_camera().await
    }

    async fn take(&mut self, message: Message) -> Result<(), End> {
        match message {
            Message::Text(text) => {
                let bytes = text.len();
                let decoded = if bytes < LARGE_MESSAGE_BYTES {
                    proto::field::from_json::<Value>(&text)
                } else {
                    let decode = move || proto::field::from_json::<Value>(&text);
                    crate::blocking("decoding a message", decode).await.map_err(|_| End::Left)?
                };
                match decoded {
                    Ok(value) => self.take_message(value, bytes),
                    Err(error) => self.reject(0, error),
                }
            }
            Message::Binary(_) => self.reject(0, FieldError::new("", "binary messages are not understood")),
            Message::Close(_) => Err(End::Left),
            Message::Ping(_) | Message::Pong(_) => Ok(()),
        }
    }

    fn take_message(&mut self, value: Value, bytes: usize) -> Result<(), End> {
        let seq = value.get("seq").and_then(Value::as_u64).and_then(|seq| u32::try_from(seq).ok());
        let message = match proto::field::from_value(value) {
            Ok(message) => message,
            Err(error) => return self.reject(seq.unwrap_or(0), error),
        };
        match message {
            ClientMessage::Hello { .. } => Ok(()),
            ClientMessage::Patch { seq, patch } => self.take_patch(seq, patch, bytes),
            ClientMessage::Camera { seq, camera } => {
                self.camera = Some((seq, camera));
                Ok(())
            }
            ClientMessage::Viewport { seq, width, height, pixel_ratio } => {
                match device_pixels(width, height, pixel_ratio) {
                    Ok(pixels) => {
                        let arrived = self.arrived;
                        self.app.renderer().update(self.member.render, |input| {
                            input.viewport = Some(pixels);
                            input.seq = input.seq.max(seq);
                            input.arrived = arrived;
                        });
                        Ok(())
                    }
                    Err(error) => self.reject(seq, error),
                }
            }
            ClientMessage::Ack { frame, decode_millis } => {
                let (acknowledged, link, age) = {
                    let mut meter = self.meter.lock();
                    let acknowledged = meter.acknowledged(frame, decode_millis, Instant::now());
                    (acknowledged, meter.link(), meter.take_age())
                };
                if let Some(age) = age {
                    self.app.metrics().acknowledged(age);
                }
                self.app.renderer().update(self.member.render, |input| {
                    input.acknowledged = input.acknowledged.max(acknowledged);
                    input.link = link;
                });
                Ok(())
            }
            ClientMessage::Visible { visible } => {
                self.app.renderer().update(self.member.render, |input| input.visible = visible);
                Ok(())
            }
        }
    }

    fn take_patch(&mut self, seq: u32, patch: Value, bytes: usize) -> Result<(), End> {
        if self.member.role == Role::Watcher {
            return self.reject(seq, FieldError::new("", WATCH_ONLY));
        }
        let full = self.patches.len() >= MAX_WAITING_PATCHES
            || self.patch_bytes.saturating_add(bytes) > MAX_WAITING_PATCH_BYTES;
        if full {
            return self
                .reject(seq, FieldError::new("", "too many edits are waiting; send them again later"));
        }
        self.patches.push((seq, patch));
        self.patch_bytes += bytes;
        Ok(())
    }

    async fn apply_camera(&mut self) -> Result<(), End> {
        let Some((seq, camera)) = self.camera.take() else { return Ok(()) };
        let (app, member, arrived) = (self.app.clone(), self.member.clone(), self.arrived);
        let moved = crate::blocking("moving a camera", move || {
            member.session.move_camera(&app, member.number, seq, camera, arrived)
        });
        match moved.await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(error)) => self.reject(seq, error),
            Err(fault) => self.reject(seq, fault.as_field_error()),
        }
    }

    /// Applies the waiting edits; those that need a volume stay, and it is loaded.
    async fn apply_patches(&mut self, loaded: Option<Arc<Loaded>>) -> Result<(), End> {
        self.next_patch = tokio::time::Instant::now() + PATCH_INTERVAL;
        let patches = std::mem::take(&mut self.patches);
        self.patch_bytes = 0;
        let (app, member, arrived) = (self.app.clone(), self.member.clone(), self.arrived);
        let applied = crate::blocking("editing a scene", move || {
            let outcome = member.session.patch(&app, member.number, &patches, loaded.as_ref(), arrived);
            (outcome, patches)
        });
        let Ok((Patched { rejected, waiting, announcement }, mut patches)) = applied.await else {
            return Err(End::Left);
        };
        let told = rejected.into_iter().try_for_each(|(seq, error)| self.reject(seq, error));
        drop(announcement);
        told?;
        if let Some((asked, count)) = waiting {
            self.patches = patches.split_off(patches.len().saturating_sub(count));
            let (app, notes) = (self.app.clone(), self.notes.clone());
            let mut next_progress = Instant::now();
            let tell = move |fraction: f32| {
                let now = Instant::now();
                if now >= next_progress {
                    next_progress = now + PROGRESS_INTERVAL;
                    // Progress is worth nothing later.
                    drop(notes.try_send(progress(fraction.into())));
                }
            };
            self.loading = Some(Box::pin(async move { Loaded::load(&app, asked, tell).await }));
        }
        Ok(())
    }

    /// The volume is there, and the edits that waited for it are applied; or it cannot be loaded,
    /// and they are refused.
    async fn loaded(&mut self, loaded: Answer<Arc<Loaded>>) -> Result<(), End> {
        self.note(progress(1.0))?;
        match loaded {
            Ok(loaded) => self.apply_patches(Some(loaded)).await,
            Err(fault) => {
                self.patch_bytes = 0;
                for (seq, _) in std::mem::take(&mut self.patches) {
                    self.reject(seq, FieldError::new("volume", fault.problem.detail.clone()))?;
                }
                Ok(())
            }
        }
    }

    fn reject(&self, seq: u32, error: FieldError) -> Result<(), End> {
        let FieldError { field, message } = error;
        self.note(Note::Message(Box::new(ServerMessage::Rejected { seq, field, message })))
    }

    fn note(&self, note: Note) -> Result<(), End> {
        self.notes.try_send(note).map_err(|error| match error {
            mpsc::error::TrySendError::Full(_) => End::Close(CLOSE_TOO_SLOW, "messages are not being read"),
            mpsc::error::TrySendError::Closed(_) => End::Left,
        })
    }
}

fn progress(fraction: f64) -> Note {
    Note::Message(Box::new(ServerMessage::Progress { activity: "Loading the volume".into(), fraction }))
}

/// The size frames are drawn at: the viewport's device pixels, shrunk evenly where they are more
/// than is drawn.
fn device_pixels(width: u32, height: u32, pixel_ratio: f64) -> Result<(u32, u32), FieldError> {
    for (field, edge) in [("width", width), ("height", height)] {
        if !(1..=MAX_CSS_EDGE).contains(&edge) {
            return Err(FieldError::new(field, format!("must be from 1 to {MAX_CSS_EDGE}, got {edge}")));
        }
    }
    if !PIXEL_RATIOS.contains(&pixel_ratio) {
        let (low, high) = PIXEL_RATIOS.into_inner();
        return Err(FieldError::new(
            "pixel_ratio",
            format!("must be from {low} to {high}, got {pixel_ratio}"),
        ));
    }
    let (width, height) = (f64::from(width) * pixel_ratio, f64::from(height) * pixel_ratio);
    let shrink =
        (MAX_VIEWPORT_EDGE / width.max(height)).min((MAX_VIEWPORT_PIXELS / (width * height)).sqrt()).min(1.0);
    let edge = |length: f64| (length * shrink).round().max(1.0) as u32;
    Ok((edge(width), edge(height)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viewports_are_bounded_and_keep_their_shape() {
        assert_eq!(device_pixels(800, 600, 1.5).unwrap(), (1200, 900));
        assert_eq!(device_pixels(1, 1, 0.25).unwrap(), (1, 1));
        let (width, height) = device_pixels(7680, 4320, 2.0).unwrap();
        assert!(f64::from(width) * f64::from(height) <= MAX_VIEWPORT_PIXELS * 1.001);
        assert!((f64::from(width) / f64::from(height) - 16.0 / 9.0).abs() < 0.01);
        let (width, height) = device_pixels(30_000, 10, 1.0).unwrap();
        assert_eq!((width, height), (4096, 1));
        for (width, height, ratio, field) in [
            (0, 1, 1.0, "width"),
            (1, 99_999, 1.0, "height"),
            (1, 1, f64::NAN, "pixel_ratio"),
            (1, 1, 9.0, "pixel_ratio"),
        ] {
            assert_eq!(device_pixels(width, height, ratio).unwrap_err().field, field);
        }
    }
}
