//! `/api/v1/uploads`.

use std::sync::Arc;

use axum::Json as JsonAnswer;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use proto::rest::{self, Problem};

use super::protocol::{
    Checksum, UPLOAD_LENGTH, UPLOAD_METADATA, UPLOAD_OFFSET, brings_bytes, expires, length_of, meant,
    metadata_of, number, wrong_type,
};
use super::{Turn, Upload, import, receive};
use crate::App;
use crate::problem::{Answer, Fault};

/// Begins a resumable upload (tus 1.0.0, creation and creation-with-upload).
///
/// `Upload-Metadata` may have `filename`, and `filetype`: if that is `multipart/form-data` with its
/// boundary, the upload is a form as for `POST /datasets`; otherwise it is one file. A body of type
/// `application/offset+octet-stream` is the upload's beginning.
#[utoipa::path(
    post, path = "/uploads", tag = "uploads",
    params(
        ("Tus-Resumable" = String, Header, description = "1.0.0"),
        ("Upload-Length" = u64, Header, description = "Bytes of the whole upload"),
        ("Upload-Metadata" = Option<String>, Header, description = "`KEY BASE64`, separated by commas"),
        ("Upload-Checksum" = Option<String>, Header, description = "`ALGORITHM BASE64` of the body; sha1, sha256, crc32"),
    ),
    request_body(content = Vec<u8>, content_type = "application/offset+octet-stream"),
    responses(
        (status = CREATED, description = "`Location` is its address, `Upload-Offset` what is safe of it, `Upload-Expires` its end if nothing comes"),
        (status = PAYLOAD_TOO_LARGE, body = Problem, content_type = "application/problem+json"),
        (status = SERVICE_UNAVAILABLE, body = Problem, content_type = "application/problem+json"),
        (status = INSUFFICIENT_STORAGE, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn create(State(app): State<Arc<App>>, headers: HeaderMap, body: Body) -> Answer<Response> {
    let length = length_of(&headers, app.config().limits.max_upload_bytes)?;
    let metadata = metadata_of(&headers)?;
    let checksum = Checksum::of(&headers)?;
    let brings = brings_bytes(&headers);
    if !brings && may_have_body(&headers) {
        return Err(wrong_type());
    }
    check_body(&headers, length)?;
    let upload = app.resumable().create(length, metadata).await?;
    if brings || length == 0 {
        let turn = upload.turn().await?;
        take(app.clone(), upload.clone(), turn, checksum, body, true).await?;
    }
    let location = format!("/api/v1/uploads/{}", upload.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], progress(&app, &upload)).into_response())
}

/// How much of an upload is safe.
///
/// Asked while another request sends bytes, that one ends.
#[utoipa::path(
    head, path = "/uploads/{id}", tag = "uploads",
    params(("id" = String, Path), ("Tus-Resumable" = String, Header, description = "1.0.0")),
    responses(
        (status = OK, description = "`Upload-Offset`, `Upload-Length`, `Upload-Metadata`, `Upload-Expires`"),
        (status = NOT_FOUND),
        (status = GONE, description = "It expired"),
        (status = LOCKED, description = "Another request does not let go"),
    )
)]
pub async fn head(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<Response> {
    let upload = app.resumable().find(&id).await?;
    if !upload.record().complete() {
        upload.turn().await?;
    }
    let record = upload.record();
    let mut headers = progress(&app, &upload);
    headers.insert(UPLOAD_LENGTH, record.length.into());
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if let Ok(metadata) = HeaderValue::from_str(&record.metadata)
        && !metadata.is_empty()
    {
        headers.insert(UPLOAD_METADATA, metadata);
    }
    Ok((StatusCode::OK, headers).into_response())
}

/// What became of an upload.
#[utoipa::path(
    get, path = "/uploads/{id}", tag = "uploads", params(("id" = String, Path)),
    responses(
        (status = OK, body = rest::Upload),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
        (status = GONE, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn get(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<Response> {
    let upload = app.resumable().find(&id).await?;
    let described = upload.describe(app.catalog());
    let fresh = [(header::CACHE_CONTROL, HeaderValue::from_static("no-store"))];
    Ok((fresh, JsonAnswer(described)).into_response())
}

/// Sends more of an upload.
///
/// When the last byte is safe, the service begins to read the upload; `GET` says what came of it. A
/// request without bytes at the end of an upload that could not be read makes it try again.
#[utoipa::path(
    patch, path = "/uploads/{id}", tag = "uploads",
    params(
        ("id" = String, Path),
        ("Tus-Resumable" = String, Header, description = "1.0.0"),
        ("Upload-Offset" = u64, Header, description = "Bytes that are safe already"),
        ("Upload-Checksum" = Option<String>, Header, description = "`ALGORITHM BASE64` of the body; sha1, sha256, crc32"),
    ),
    request_body(content = Vec<u8>, content_type = "application/offset+octet-stream"),
    responses(
        (status = NO_CONTENT, description = "`Upload-Offset` is what is safe now"),
        (status = CONFLICT, body = Problem, content_type = "application/problem+json", description = "The offset is another one"),
        (status = PAYLOAD_TOO_LARGE, body = Problem, content_type = "application/problem+json"),
        (status = UNSUPPORTED_MEDIA_TYPE, body = Problem, content_type = "application/problem+json"),
        (status = LOCKED, body = Problem, content_type = "application/problem+json", description = "Another request took over, or does not let go"),
        (status = 460, body = Problem, content_type = "application/problem+json", description = "The checksum is another one"),
        (status = INSUFFICIENT_STORAGE, body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn patch(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Answer<Response> {
    let upload = app.resumable().find(&id).await?;
    if !brings_bytes(&headers) {
        return Err(wrong_type());
    }
    let offset = number(&headers, &UPLOAD_OFFSET)?;
    let checksum = Checksum::of(&headers)?;
    let fits = |upload: &Upload| {
        let safe = upload.record().offset;
        match offset == safe {
            true => check_body(&headers, upload.record().length - safe),
            false => Err(Fault::conflict(format!("{safe} bytes are safe, not {offset}; go on from there."))),
        }
    };
    // Nothing can be added to what is being read or has ended.
    let closed = || upload.state.lock().reading || upload.record().outcome.is_some();
    let turn = if closed() { None } else { Some(upload.turn().await?) };
    fits(&upload)?;
    if let Some(turn) = turn.filter(|_| !closed()) {
        take(app.clone(), upload.clone(), turn, checksum, body, false).await?;
    }
    Ok((StatusCode::NO_CONTENT, progress(&app, &upload)).into_response())
}

/// Cancels an upload, or forgets one that ended. Its dataset stays.
#[utoipa::path(
    delete, path = "/uploads/{id}", tag = "uploads",
    params(("id" = String, Path), ("Tus-Resumable" = String, Header, description = "1.0.0")),
    responses(
        (status = NO_CONTENT),
        (status = NOT_FOUND, body = Problem, content_type = "application/problem+json"),
        (status = LOCKED, body = Problem, content_type = "application/problem+json", description = "It is being read"),
    )
)]
pub async fn delete(State(app): State<Arc<App>>, Path(id): Path<String>) -> Answer<StatusCode> {
    let upload = app.resumable().find(&id).await?;
    if upload.state.lock().reading {
        return Err(Fault::locked(
            "The service reads this upload already; delete the dataset when it is stored.",
        ));
    }
    let _turn = upload.turn().await?;
    app.resumable().forget(&upload).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// `PATCH`, `DELETE` or `HEAD` from clients that can only send `POST`: `X-HTTP-Method-Override` says which.
#[utoipa::path(
    post, path = "/uploads/{id}", tag = "uploads",
    params(
        ("id" = String, Path),
        ("Tus-Resumable" = String, Header, description = "1.0.0"),
        ("X-HTTP-Method-Override" = String, Header, description = "The method that is meant"),
    ),
    request_body(content = Vec<u8>, content_type = "application/offset+octet-stream"),
    responses((status = "default", description = "As the method that is meant"))
)]
pub async fn post(
    app: State<Arc<App>>,
    id: Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Answer<Response> {
    match meant(&headers)? {
        Method::PATCH => patch(app, id, headers, body).await,
        Method::DELETE => delete(app, id).await.map(IntoResponse::into_response),
        _ => head(app, id).await,
    }
}

/// Receives a body and has the upload read when it is complete; goes on when the client is gone. A
/// `new` upload whose beginning does not arrive is removed: nobody knows its address.
async fn take(
    app: Arc<App>,
    upload: Arc<Upload>,
    turn: Turn,
    checksum: Option<Checksum>,
    body: Body,
    new: bool,
) -> Answer<()> {
    let most = app.config().limits.max_uploads;
    let permit = app.receiving.clone().try_acquire_owned();
    let taking = async move {
        let received = match permit {
            Ok(_permit) => receive::receive(&app, &upload, &turn, checksum, body).await,
            // The beginning can come later, too.
            Err(_) if new => return Ok(()),
            Err(_) => Err(Fault::busy(format!("{most} uploads are under way (`limits.max_uploads`)."))),
        };
        match received {
            Ok(()) if upload.record().complete() => import::start(app, upload, turn),
            Err(_) if new => app.resumable().forget(&upload).await?,
            _ => {}
        }
        received
    };
    tokio::spawn(taking).await.map_err(|error| Fault::internal("receiving an upload", &error))?
}

/// What is safe of an upload, and until when.
fn progress(app: &App, upload: &Upload) -> HeaderMap {
    let record = upload.record();
    let mut headers = HeaderMap::from_iter([(UPLOAD_OFFSET, HeaderValue::from(record.offset))]);
    if record.outcome.is_none() {
        headers.extend(expires(record.touched_unix_millis, app.resumable().idle));
    }
    headers
}

fn may_have_body(headers: &HeaderMap) -> bool {
    headers.contains_key(header::TRANSFER_ENCODING) || body_length(headers).is_some_and(|length| length > 0)
}

/// Refuses a body that is longer than what is missing, before it is sent.
fn check_body(headers: &HeaderMap, missing: u64) -> Answer<()> {
    match body_length(headers) {
        Some(length) if length > missing => Err(Fault::too_large(format!(
            "The body has {length} bytes, and {missing} are missing to the upload's length."
        ))),
        _ => Ok(()),
    }
}

fn body_length(headers: &HeaderMap) -> Option<u64> {
    let name: HeaderName = header::CONTENT_LENGTH;
    headers.get(name)?.to_str().ok()?.parse().ok()
}
