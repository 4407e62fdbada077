//! From a complete upload to a dataset.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{DefaultBodyLimit, FromRequest, Multipart, Request};
use axum::http::header;
use proto::rest::Dataset;
use tokio_util::io::ReaderStream;

use super::protocol::decode;
use super::record::Outcome;
use super::{Turn, Upload};
use crate::App;
use crate::datasets::receive::Incoming;
use crate::problem::{Answer, Fault};

/// How often an upload is read before it is taken to be what ends the service.
const MAX_ATTEMPTS: u32 = 5;
/// Begins the media type of a form.
const FORM: &str = "multipart/form-data";

/// Reads a complete upload in the background and records what came of it; leaves one that has ended
/// alone. Returns at once.
pub fn start(app: Arc<App>, upload: Arc<Upload>, turn: Turn) {
    {
        let mut state = upload.state.lock();
        if state.record.outcome.is_some() {
            return;
        }
        state.reading = true;
        state.failure = None;
    }
    tokio::spawn(async move {
        let read = read(&app, &upload).await;
        let recorded = match read {
            Ok(dataset) => upload.end(Outcome::Stored(dataset.id)).await,
            Err(fault) if fault.status().is_client_error() => {
                upload.end(Outcome::Refused(fault.problem)).await
            }
            Err(fault) => Err(fault),
        };
        let mut state = upload.state.lock();
        if let Err(fault) = recorded {
            // What came of it was not recorded: it can be read again, and then the dataset is found
            // by its content.
            if state.room.is_none() && state.record.outcome.is_none() {
                state.room = Some(app.catalog().reserve_held(state.record.length));
            }
            state.failure = Some(fault.problem);
        }
        state.reading = false;
        drop(state);
        drop(turn);
    });
}

async fn read(app: &Arc<App>, upload: &Arc<Upload>) -> Answer<Dataset> {
    let _permit =
        app.receiving.acquire().await.map_err(|error| Fault::internal("reading an upload", &error))?;
    if upload.record().attempts >= MAX_ATTEMPTS {
        return Err(Fault::unreadable_file(format!(
            "The service ended {MAX_ATTEMPTS} times while it read this upload, and does not try again."
        )));
    }
    upload.persist(|record| record.attempts += 1).await?;
    let room = upload.state.lock().room.take();
    let room = room.unwrap_or_else(|| app.catalog().reserve_held(upload.record().length));
    let mut incoming = Incoming::with_room(app, room).await?;
    let pairs = decode(&upload.record().metadata).unwrap_or_default();
    let value = |key: &str| pairs.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str());
    match value("filetype").filter(|kind| kind.starts_with(FORM)) {
        Some(kind) => incoming.form(form(kind, upload).await?).await?,
        None => incoming.adopt(value("filename").unwrap_or_default(), &upload.place.data).await?,
    }
    let (dataset, _) = incoming.finish().await?;
    Ok(dataset)
}

/// The upload as the body of a form.
async fn form(kind: &str, upload: &Upload) -> Answer<Multipart> {
    let file = tokio::fs::File::open(&upload.place.data)
        .await
        .map_err(|error| Fault::internal("reading an upload", &error))?;
    let mut request = Request::post("/")
        .header(header::CONTENT_TYPE, kind)
        .body(Body::from_stream(ReaderStream::new(file)))
        .map_err(|_| Fault::bad_request("The upload's `filetype` is no media type."))?;
    DefaultBodyLimit::disable().apply(&mut request);
    Multipart::from_request(request, &())
        .await
        .map_err(|error| Fault::bad_request(format!("The upload's form cannot be read: {error}.")))
}
