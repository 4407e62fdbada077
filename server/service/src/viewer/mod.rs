//! Viewers: one WebSocket each, two tasks: [`reader`] takes inputs, [`writer`] sends frames.
//!
//! Inputs that arrived together are applied together, newest state only. Frames come from the
//! render thread through a bounded channel, are encoded on blocking threads in order, and sent;
//! their number in flight is bounded by the viewer's acknowledgements.

mod link;
mod reader;
mod writer;

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::Response;
use futures_util::StreamExt;
use parking_lot::Mutex;
use proto::control::{ClientMessage, PROTOCOL_VERSION, ServerMessage};
use proto::rest::Problem;
use tokio::sync::mpsc;
use tracing::Instrument;

use crate::App;
use crate::problem::Fault;
use crate::render_thread::MAX_WAITING_OUTPUTS;
use crate::sessions::{Access, Outlet};
use link::LinkMeter;

/// Close code: the session does not exist (any more).
pub const CLOSE_NO_SESSION: u16 = 4404;
/// Close code: the first message was not a `hello` of this protocol.
pub const CLOSE_BAD_HELLO: u16 = 4400;
/// Close code: another connection goes on with this viewer.
pub const CLOSE_TAKEN_OVER: u16 = 4409;
/// Close code: the viewer does not read what it is sent.
pub const CLOSE_TOO_SLOW: u16 = 4408;
/// Close code: too many viewers; try again later (RFC 6455 registry).
pub const CLOSE_TRY_AGAIN: u16 = 1013;
/// Close code: the service is going away.
pub const CLOSE_GOING_AWAY: u16 = 1001;

/// Longest wait for the first message.
const HELLO_TIME: Duration = Duration::from_secs(10);
/// Messages waiting to be sent besides frames and scenes.
const MAX_WAITING_NOTES: usize = 64;

/// What the reader asks the writer to send.
enum Note {
    Message(Box<ServerMessage>),
    Close(u16, String),
}

/// Opens a viewer of the session (WebSocket).
///
/// Text messages are `ClientMessage` and `ServerMessage`, the first of them `hello`; binary
/// messages are frames. An unknown session closes the connection with code 4404.
#[utoipa::path(
    get, path = "/sessions/{id}/view", tag = "sessions", params(("id" = String, Path)),
    responses(
        (status = SWITCHING_PROTOCOLS, description = "A WebSocket"),
        (status = FORBIDDEN, body = Problem, content_type = "application/problem+json", description = "A page of another origin"),
    )
)]
pub async fn view(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let most = app.config().limits.max_message_bytes;
    upgrade.max_message_size(most).max_frame_size(most).on_upgrade(move |socket| connection(app, id, socket))
}

async fn connection(app: Arc<App>, id: String, mut socket: WebSocket) {
    let Access { session, role } = match app.sessions().find(&app, &id).await {
        Ok(access) => access,
        Err(fault) if fault.status() == StatusCode::NOT_FOUND => {
            return close(socket, CLOSE_NO_SESSION, "there is no such session").await;
        }
        Err(_) => return close(socket, CLOSE_TRY_AGAIN, "the session cannot be opened now").await,
    };
    let Ok(_permit) = app.viewers.clone().try_acquire_owned() else {
        return close(socket, CLOSE_TRY_AGAIN, "too many viewers").await;
    };
    let resume = match tokio::time::timeout(HELLO_TIME, hello(&mut socket)).await {
        Ok(Ok(resume)) => resume,
        Ok(Err(reason)) => return close(socket, CLOSE_BAD_HELLO, &reason).await,
        Err(_) => return close(socket, CLOSE_BAD_HELLO, "no hello arrived").await,
    };
    let (outputs_in, outputs) = mpsc::channel(MAX_WAITING_OUTPUTS);
    let (notes, notes_out) = mpsc::channel(MAX_WAITING_NOTES);
    let epochs = session.epochs();
    let (joining, shared) = (session.clone(), app.clone());
    let joined = crate::blocking("joining a session", move || {
        let member = joining.join(&shared, Outlet { role, resume, outputs: outputs_in })?;
        let welcome = joining.welcome(&shared, &member);
        Ok::<_, Fault>((member, welcome))
    });
    let Ok(Ok((member, welcome))) = joined.await else { return };
    let member = Arc::new(member);
    let meter = Arc::new(Mutex::new(LinkMeter::default()));
    let (sink, stream) = socket.split();
    let writer = writer::Writer {
        app: app.clone(),
        member: member.clone(),
        meter: meter.clone(),
        notes: notes_out,
        outputs,
        epochs,
    };
    // Not the session's identifier: whoever knows that may use it.
    let span = tracing::info_span!("viewer", session = session.name_in_log(), viewer = member.number);
    let writer = tokio::spawn(writer.run(sink, welcome).instrument(span.clone()));
    let reader = reader::Reader::new(app, member.clone(), meter, notes);
    reader.run(stream, &writer).instrument(span).await;
    // The writer ends when it has sent what the reader left, or gives up on a slow viewer.
    if let Err(error) = writer.await {
        tracing::error!(%error, "a viewer's connection failed");
    }
    // Leaving may have to wait for an edit; a failure is logged.
    drop(crate::blocking("leaving a session", move || drop(member)).await);
}

/// Waits for the first message; which viewer it goes on with, if any.
async fn hello(socket: &mut WebSocket) -> Result<Option<String>, String> {
    while let Some(Ok(message)) = socket.recv().await {
        match message {
            Message::Text(text) => {
                return match serde_json::from_str(&text) {
                    Ok(ClientMessage::Hello { protocol: PROTOCOL_VERSION, resume }) => Ok(resume),
                    Ok(ClientMessage::Hello { protocol, .. }) => {
                        Err(format!("protocol {protocol} is not spoken here, only {PROTOCOL_VERSION}"))
                    }
                    _ => Err("the first message must be a hello".into()),
                };
            }
            Message::Binary(_) => return Err("the first message must be a hello".into()),
            Message::Close(_) => break,
            Message::Ping(_) | Message::Pong(_) => {}
        }
    }
    Err("the connection ended before a hello".into())
}

async fn close(mut socket: WebSocket, code: u16, reason: &str) {
    let frame = CloseFrame { code, reason: reason.into() };
    // Nothing is lost if the viewer is gone already.
    drop(tokio::time::timeout(writer::SEND_TIME, socket.send(Message::Close(Some(frame)))).await);
}
