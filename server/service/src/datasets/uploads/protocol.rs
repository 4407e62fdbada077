//! The words of tus 1.0.0 (<https://tus.io/protocols/resumable-upload>): headers, metadata,
//! checksums, and what all its answers share.

use std::sync::Arc;
use std::time::{Duration, UNIX_EPOCH};

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use sha1::Digest;

use crate::App;
use crate::problem::{Answer, Fault};

const VERSION: HeaderValue = HeaderValue::from_static("1.0.0");
const EXTENSIONS: HeaderValue =
    HeaderValue::from_static("creation,creation-with-upload,checksum,expiration,termination");
const CHECKSUM_ALGORITHMS: HeaderValue = HeaderValue::from_static("sha1,sha256,crc32");
const TUS_RESUMABLE: HeaderName = HeaderName::from_static("tus-resumable");
const TUS_VERSION: HeaderName = HeaderName::from_static("tus-version");
const TUS_EXTENSION: HeaderName = HeaderName::from_static("tus-extension");
const TUS_MAX_SIZE: HeaderName = HeaderName::from_static("tus-max-size");
const TUS_CHECKSUM_ALGORITHM: HeaderName = HeaderName::from_static("tus-checksum-algorithm");
const METHOD_OVERRIDE: HeaderName = HeaderName::from_static("x-http-method-override");
pub const UPLOAD_OFFSET: HeaderName = HeaderName::from_static("upload-offset");
pub const UPLOAD_LENGTH: HeaderName = HeaderName::from_static("upload-length");
pub const UPLOAD_METADATA: HeaderName = HeaderName::from_static("upload-metadata");
pub const UPLOAD_EXPIRES: HeaderName = HeaderName::from_static("upload-expires");
const UPLOAD_DEFER_LENGTH: HeaderName = HeaderName::from_static("upload-defer-length");
const UPLOAD_CHECKSUM: HeaderName = HeaderName::from_static("upload-checksum");

/// Headers that a page of a listed origin may send.
pub const REQUEST_HEADERS: [HeaderName; 6] =
    [TUS_RESUMABLE, UPLOAD_OFFSET, UPLOAD_LENGTH, UPLOAD_METADATA, UPLOAD_CHECKSUM, METHOD_OVERRIDE];
/// Headers that a page of a listed origin may read.
pub const RESPONSE_HEADERS: [HeaderName; 9] = [
    TUS_RESUMABLE,
    TUS_VERSION,
    TUS_EXTENSION,
    TUS_MAX_SIZE,
    TUS_CHECKSUM_ALGORITHM,
    UPLOAD_OFFSET,
    UPLOAD_LENGTH,
    UPLOAD_METADATA,
    UPLOAD_EXPIRES,
];

/// Type of a body that holds bytes of an upload.
const OFFSET_OCTET_STREAM: &str = "application/offset+octet-stream";
/// Longest `Upload-Metadata`, bytes.
const MAX_METADATA_BYTES: usize = 4096;

/// Middleware: what every request below `/uploads` shares. Answers `OPTIONS` unless a browser asks
/// for leave (CORS), and refuses other versions of the protocol. `GET` is no part of it.
pub async fn speak(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let path = request.uri().path();
    if path != "/uploads" && !path.starts_with("/uploads/") {
        return next.run(request).await;
    }
    let headers = request.headers();
    let preflight = headers.contains_key(header::ACCESS_CONTROL_REQUEST_METHOD);
    let mut response = if *request.method() == Method::OPTIONS && !preflight {
        let most = app.config().limits.max_upload_bytes;
        let about = [
            (TUS_VERSION, VERSION),
            (TUS_EXTENSION, EXTENSIONS),
            (TUS_MAX_SIZE, most.into()),
            (TUS_CHECKSUM_ALGORITHM, CHECKSUM_ALGORITHMS),
        ];
        (StatusCode::NO_CONTENT, about).into_response()
    } else if preflight || *request.method() == Method::GET {
        next.run(request).await
    } else if headers.get(TUS_RESUMABLE).is_none_or(|version| version != VERSION) {
        let fault = Fault::wrong_version(
            "Uploads are sent with tus 1.0.0: the header `Tus-Resumable: 1.0.0` is missing or different.",
        );
        ([(TUS_VERSION, VERSION)], fault).into_response()
    } else {
        next.run(request).await
    };
    response.headers_mut().insert(TUS_RESUMABLE, VERSION);
    response
}

/// The method that a `POST` means: some clients can send nothing else.
///
/// # Errors
/// It means none that an upload knows.
pub fn meant(headers: &HeaderMap) -> Answer<Method> {
    let wanted = headers.get(METHOD_OVERRIDE).map(HeaderValue::as_bytes);
    [Method::PATCH, Method::DELETE, Method::HEAD]
        .into_iter()
        .find(|known| wanted == Some(known.as_str().as_bytes()))
        .ok_or_else(|| Fault::bad_request("`X-HTTP-Method-Override` must be PATCH, DELETE or HEAD."))
}

/// `Upload-Length` of a new upload.
///
/// # Errors
/// It is missing (400) or more than is taken (413).
pub fn length_of(headers: &HeaderMap, most: u64) -> Answer<u64> {
    if headers.contains_key(UPLOAD_DEFER_LENGTH) {
        return Err(Fault::bad_request("The length must be known from the beginning: send `Upload-Length`."));
    }
    let length = number(headers, &UPLOAD_LENGTH)?;
    if length > most {
        return Err(Fault::too_large(format!(
            "An upload may have {most} bytes (`limits.max_upload_bytes`); this one has {length}."
        )));
    }
    Ok(length)
}

/// A header that is a whole number.
///
/// # Errors
/// It is missing or something else.
pub fn number(headers: &HeaderMap, name: &HeaderName) -> Answer<u64> {
    let text = headers.get(name).and_then(|value| value.to_str().ok());
    // `parse` alone would take a sign.
    let digits = text.filter(|text| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit()));
    digits
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| Fault::bad_request(format!("The header `{name}` must be a whole number of bytes.")))
}

/// Whether the body holds bytes of an upload.
pub fn brings_bytes(headers: &HeaderMap) -> bool {
    headers.get(header::CONTENT_TYPE).is_some_and(|value| value == OFFSET_OCTET_STREAM)
}

/// The answer to a body of another type.
pub fn wrong_type() -> Fault {
    Fault::unsupported_media(format!("The bytes of an upload have the type `{OFFSET_OCTET_STREAM}`."))
}

/// `Upload-Metadata` as it came, once it can be understood; empty where there is none.
///
/// # Errors
/// It is too long or cannot be decoded.
pub fn metadata_of(headers: &HeaderMap) -> Answer<String> {
    let Some(value) = headers.get(UPLOAD_METADATA) else { return Ok(String::new()) };
    let text = value.to_str().unwrap_or("?");
    if text.len() > MAX_METADATA_BYTES {
        return Err(Fault::bad_request(format!("`Upload-Metadata` may have {MAX_METADATA_BYTES} bytes.")));
    }
    decode(text).map(|_| text.to_owned()).ok_or_else(|| {
        Fault::bad_request(
            "`Upload-Metadata` must be pairs `KEY BASE64` with commas between them, each key once.",
        )
    })
}

/// Keys and values of metadata; `None` if they cannot be understood.
pub fn decode(metadata: &str) -> Option<Vec<(String, String)>> {
    let mut pairs: Vec<(String, String)> = Vec::new();
    for pair in metadata.split(',').map(str::trim).filter(|pair| !pair.is_empty()) {
        let (key, value) = pair.split_once(' ').unwrap_or((pair, ""));
        let value = String::from_utf8(BASE64.decode(value.trim()).ok()?).ok()?;
        if !key.bytes().all(|byte| byte.is_ascii_graphic()) || pairs.iter().any(|(known, _)| known == key) {
            return None;
        }
        pairs.push((key.to_owned(), value));
    }
    Some(pairs)
}

/// When an upload expires, as a header.
pub fn expires(touched_unix_millis: u64, idle: Duration) -> Option<(HeaderName, HeaderValue)> {
    let at = UNIX_EPOCH + Duration::from_millis(touched_unix_millis) + idle;
    HeaderValue::from_str(&httpdate::fmt_http_date(at)).ok().map(|value| (UPLOAD_EXPIRES, value))
}

/// What the bytes of a request must come to.
#[derive(Debug)]
pub struct Checksum {
    state: Hasher,
    expected: Vec<u8>,
}

#[derive(Debug)]
enum Hasher {
    Sha1(sha1::Sha1),
    Sha256(sha2::Sha256),
    Crc32(crc32fast::Hasher),
}

impl Checksum {
    /// `Upload-Checksum`, if there is one.
    ///
    /// # Errors
    /// The algorithm is not known, or it is no base64.
    pub fn of(headers: &HeaderMap) -> Answer<Option<Self>> {
        let Some(value) = headers.get(UPLOAD_CHECKSUM) else { return Ok(None) };
        let (algorithm, sum) = value.to_str().unwrap_or_default().split_once(' ').unwrap_or_default();
        let state = match algorithm {
            "sha1" => Hasher::Sha1(sha1::Sha1::new()),
            "sha256" => Hasher::Sha256(sha2::Sha256::new()),
            "crc32" => Hasher::Crc32(crc32fast::Hasher::new()),
            _ => return Err(Fault::bad_request("`Upload-Checksum` may use sha1, sha256 and crc32.")),
        };
        let expected = BASE64
            .decode(sum.trim())
            .map_err(|_| Fault::bad_request("`Upload-Checksum` must be `ALGORITHM BASE64`."))?;
        Ok(Some(Self { state, expected }))
    }

    /// Takes more of the body.
    pub fn update(&mut self, bytes: &[u8]) {
        match &mut self.state {
            Hasher::Sha1(state) => state.update(bytes),
            Hasher::Sha256(state) => state.update(bytes),
            Hasher::Crc32(state) => state.update(bytes),
        }
    }

    /// Whether the whole body was what was sent.
    ///
    /// # Errors
    /// It was not (460).
    pub fn verify(self) -> Answer<()> {
        let sum = match self.state {
            Hasher::Sha1(state) => state.finalize().to_vec(),
            Hasher::Sha256(state) => state.finalize().to_vec(),
            Hasher::Crc32(state) => state.finalize().to_be_bytes().to_vec(),
        };
        if sum == self.expected {
            return Ok(());
        }
        Err(Fault::checksum_mismatch(
            "The bytes do not have the checksum they were sent with; they were thrown away. Send them again.",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(name: HeaderName, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name, value.parse().unwrap())])
    }

    #[test]
    fn numbers_are_plain() {
        for text in ["", "-1", "+1", "1.0", "0x10", "99999999999999999999", " 1 2"] {
            assert!(number(&with(UPLOAD_OFFSET, text), &UPLOAD_OFFSET).is_err(), "{text:?}");
        }
        assert_eq!(number(&with(UPLOAD_OFFSET, "0012"), &UPLOAD_OFFSET).unwrap(), 12);
        assert_eq!(length_of(&with(UPLOAD_LENGTH, "10"), 10).unwrap(), 10);
        assert_eq!(length_of(&with(UPLOAD_LENGTH, "11"), 10).unwrap_err().problem.status, 413);
        assert_eq!(length_of(&with(UPLOAD_DEFER_LENGTH, "1"), 10).unwrap_err().problem.status, 400);
    }

    #[test]
    fn metadata_is_pairs() {
        let pairs = decode("filename YS5ucnJk, is_secret,note ").unwrap();
        let plain: Vec<_> = pairs.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
        assert_eq!(plain, [("filename", "a.nrrd"), ("is_secret", ""), ("note", "")]);
        for text in ["filename ?", "a YQ==,a YQ==", "name /w==", "na\u{e9}me YQ=="] {
            assert!(decode(text).is_none(), "{text}");
        }
        let long = "a".repeat(MAX_METADATA_BYTES + 1);
        assert!(metadata_of(&with(UPLOAD_METADATA, &long)).is_err());
        assert!(metadata_of(&with(UPLOAD_METADATA, "filename !")).is_err());
        assert_eq!(metadata_of(&HeaderMap::new()).unwrap(), "");
    }

    #[test]
    fn checksums_are_those_of_others() {
        // Of "hello world", from coreutils and zlib.
        for text in [
            "sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0=",
            "sha256 uU0nuZNNPgilLlLX2n2r+sSE7+N6U4DukIj3rOLvzek=",
            "crc32 DUoRhQ==",
        ] {
            let mut checksum = Checksum::of(&with(UPLOAD_CHECKSUM, text)).unwrap().unwrap();
            checksum.update(b"hello ");
            checksum.update(b"world");
            checksum.verify().unwrap();
            let mut checksum = Checksum::of(&with(UPLOAD_CHECKSUM, text)).unwrap().unwrap();
            checksum.update(b"hello World");
            assert_eq!(checksum.verify().unwrap_err().problem.status, 460);
        }
        for text in ["md5 XUFAKrxLKna5cZ2REBfFkg==", "sha1", "sha1 ???", "SHA1 Kq5sNclPz7QV2+lfQIuc6R7oRu0="]
        {
            assert_eq!(Checksum::of(&with(UPLOAD_CHECKSUM, text)).unwrap_err().problem.status, 400, "{text}");
        }
        assert!(Checksum::of(&HeaderMap::new()).unwrap().is_none());
    }
}
