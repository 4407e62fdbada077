//! The page: the web client's build, embedded in the binary.

use std::collections::HashMap;
use std::io::Write;
use std::sync::LazyLock;

use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};

/// What may run and load on the page: only what this service sends.
const CONTENT_SECURITY_POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; \
     worker-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'";
/// Files whose names hold a hash of their content never change.
const IMMUTABLE: &str = "public, max-age=31536000, immutable";
/// Everything else is asked for again, and mostly answered with 304.
const REVALIDATE: &str = "no-cache";
/// Folder of the files with hashed names.
const HASHED_FOLDER: &str = "assets/";
/// Text below this size is not worth compressing, bytes.
const MIN_COMPRESSED_BYTES: usize = 1024;

/// Shown where the client was not built.
const NOT_BUILT: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Tyndall</title>\
<h1>Tyndall is running</h1><p>The web client was not built into this binary. Build it with <code>make build</code>, \
then start the service again. The interface for programs is described at \
<a href=\"/api/v1/openapi.json\">/api/v1/openapi.json</a>.</p></html>";

/// The build of `web/`; absent where Node was not.
#[derive(rust_embed::Embed)]
#[folder = "../../web/dist/"]
#[allow_missing = true]
struct Build;

/// A file of the page.
struct Asset {
    bytes: Vec<u8>,
    /// Present if smaller.
    gzip: Option<Vec<u8>>,
    media_type: HeaderValue,
    etag: HeaderValue,
}

/// Every file by path, compressed once.
static ASSETS: LazyLock<HashMap<String, Asset>> = LazyLock::new(|| {
    let mut assets: HashMap<String, Asset> = Build::iter()
        .filter_map(|path| {
            let file = Build::get(&path)?;
            Some((path.to_string(), asset(file.data.into_owned(), file.metadata.mimetype())))
        })
        .collect();
    assets.entry("index.html".into()).or_insert_with(|| asset(NOT_BUILT.as_bytes().to_vec(), "text/html"));
    assets
});

fn asset(bytes: Vec<u8>, media_type: &str) -> Asset {
    let text = ["text/", "javascript", "json", "svg", "wasm"].iter().any(|kind| media_type.contains(kind));
    let gzip = if text && bytes.len() >= MIN_COMPRESSED_BYTES { compressed(&bytes) } else { None };
    let charset = if media_type.starts_with("text/") { "; charset=utf-8" } else { "" };
    let header = |text: String| {
        HeaderValue::from_str(&text).unwrap_or(HeaderValue::from_static("application/octet-stream"))
    };
    let hash = blake3::hash(&bytes).to_hex();
    Asset {
        media_type: header(format!("{media_type}{charset}")),
        etag: header(format!("\"{}\"", &hash.as_str()[..32])),
        gzip,
        bytes,
    }
}

fn compressed(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).ok()?;
    encoder.finish().ok().filter(|small| small.len() < bytes.len())
}

/// Answers every address outside the API with a file of the page; addresses that look like places
/// within the page get its entry.
pub async fn page(request: Request) -> Response {
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    let path = request.uri().path().trim_start_matches('/').to_owned();
    let entry = path.is_empty() || !path.rsplit('/').next().is_some_and(|name| name.contains('.'));
    if path == "api" || path.starts_with("api/") {
        return crate::http::nothing_here().await.into_response();
    }
    let headers = request.headers().clone();
    // The first request compresses everything.
    let answer = crate::blocking("reading the page", move || {
        let found = ASSETS.get(&path).or_else(|| ASSETS.get("index.html").filter(|_| entry));
        found.map(|asset| send(asset, &path, &headers))
    });
    match answer.await {
        Ok(Some(response)) => response,
        Ok(None) => StatusCode::NOT_FOUND.into_response(),
        Err(fault) => fault.into_response(),
    }
}

fn send(asset: &'static Asset, path: &str, headers: &HeaderMap) -> Response {
    let known = headers.get(header::IF_NONE_MATCH).is_some_and(|tag| tag == asset.etag);
    let takes_gzip = headers
        .get(header::ACCEPT_ENCODING)
        .and_then(|value| value.to_str().ok())
        .is_some_and(|value| value.contains("gzip"));
    let gzip = asset.gzip.as_deref().filter(|_| takes_gzip);
    let body = match (known, gzip) {
        (true, _) => Body::empty(),
        (false, Some(small)) => Body::from(small),
        (false, None) => Body::from(asset.bytes.as_slice()),
    };
    let mut response = Response::new(body);
    if known {
        *response.status_mut() = StatusCode::NOT_MODIFIED;
    }
    let caching = if path.starts_with(HASHED_FOLDER) { IMMUTABLE } else { REVALIDATE };
    let fields = response.headers_mut();
    fields.insert(header::CONTENT_TYPE, asset.media_type.clone());
    fields.insert(header::ETAG, asset.etag.clone());
    fields.insert(header::CACHE_CONTROL, HeaderValue::from_static(caching));
    fields.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
    fields.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(CONTENT_SECURITY_POLICY));
    if gzip.is_some() && !known {
        fields.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
    }
    response
}
