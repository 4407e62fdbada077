//! Resumable uploads: pieces become datasets, across breaks, takeovers and restarts.

use axum::body::{Body, Bytes};
use axum::http::{Method, Request, StatusCode, header};
use proto::rest::UploadState;
use service::datasets::uploads;

use crate::support::{BYTES, Service, UPLOADS, ball, nrrd};
use crate::uploads::{slice, wait_until_stored};

#[tokio::test]
async fn the_service_tells_what_it_speaks() {
    let service = Service::with(|config| {
        config.limits.max_upload_bytes = 1234;
        config.allowed_origins = vec!["https://lab.example".into()];
    });
    let request = Request::options(UPLOADS).body(Body::empty()).unwrap();
    let answer = service.send(request).await;
    assert_eq!((answer.status, answer.body.len()), (StatusCode::NO_CONTENT, 0));
    for (name, value) in [
        ("tus-resumable", "1.0.0"),
        ("tus-version", "1.0.0"),
        ("tus-max-size", "1234"),
        ("tus-extension", "creation,creation-with-upload,checksum,expiration,termination"),
        ("tus-checksum-algorithm", "sha1,sha256,crc32"),
    ] {
        assert_eq!(answer.headers[name], value);
    }
    // A browser that asks for leave is answered by CORS.
    let preflight = Request::options(UPLOADS)
        .header(header::HOST, "localhost")
        .header(header::ORIGIN, "https://lab.example")
        .header(header::ACCESS_CONTROL_REQUEST_METHOD, "PATCH")
        .header(header::ACCESS_CONTROL_REQUEST_HEADERS, "tus-resumable,upload-offset");
    let answer = service.send(preflight.body(Body::empty()).unwrap()).await.ok();
    assert_eq!(answer.headers[header::ACCESS_CONTROL_ALLOW_ORIGIN], "https://lab.example");
    let allowed = answer.headers[header::ACCESS_CONTROL_ALLOW_HEADERS].to_str().unwrap();
    assert!(allowed.contains("upload-offset") && allowed.contains("tus-resumable"), "{allowed}");
}

#[tokio::test]
async fn pieces_become_the_dataset_that_the_whole_would_be() {
    let service = Service::new();
    let file = nrrd(0);
    let upload = service.begin("ball.nrrd", file.len()).await;
    let mut sent = 0;
    for end in [1, 1000, 1000, 4000, file.len()] {
        assert_eq!(service.offset(&upload).await, sent);
        let answer = service.append(&upload, sent, file[sent..end].to_vec()).await;
        assert_eq!((answer.status, answer.body.len()), (StatusCode::NO_CONTENT, 0));
        assert_eq!(answer.headers["upload-offset"].to_str().unwrap(), end.to_string());
        assert_eq!(answer.headers["tus-resumable"], "1.0.0");
        if end < file.len() {
            assert!(answer.headers["upload-expires"].to_str().unwrap().ends_with(" GMT"));
            let list = service.get("/datasets").await.ok().json();
            assert!(list.as_array().unwrap().iter().all(|dataset| dataset["sample"] == true));
        }
        sent = end;
    }
    let outcome = service.outcome(&upload).await;
    assert_eq!((outcome.state, outcome.offset), (UploadState::Stored, file.len() as u64), "{outcome:?}");
    let dataset = outcome.dataset.unwrap();
    assert_eq!((dataset.name.as_str(), dataset.bytes), ("ball", file.len() as u64));
    let same = service.put("/datasets/other.nrrd", file.clone()).await;
    assert_eq!((same.status, same.json()["id"].as_str()), (StatusCode::OK, Some(dataset.id.as_str())));
    service.get(&format!("/datasets/{}/histogram", dataset.id)).await.ok();
    // Manifest, blob, and the record of how the upload ended; no other copy of the bytes.
    wait_until_stored(&service, 3).await;
    let head = service.tus("HEAD", &upload, &[], Body::empty()).await.ok();
    assert_eq!(head.headers["upload-length"].to_str().unwrap(), file.len().to_string());
    assert_eq!(head.headers[header::CACHE_CONTROL], "no-store");
    // A dataset that is gone is not told about; forgetting an upload leaves its dataset.
    service.delete(&format!("/datasets/{}", dataset.id)).await.ok();
    assert!(service.outcome(&upload).await.dataset.is_none());
    service.tus("DELETE", &upload, &[], Body::empty()).await.ok();
    assert!(service.stored_files().is_empty(), "{:?}", service.stored_files());
}

#[tokio::test]
async fn an_upload_may_begin_with_bytes() {
    let service = Service::new();
    let file = nrrd(0);
    let length = file.len().to_string();
    for (seed, first) in [(0, 100), (2, file.len())] {
        let file = nrrd(seed);
        let headers = [BYTES, ("upload-length", length.as_str()), ("upload-metadata", "filename YS5ucnJk")];
        let answer = service.tus("POST", UPLOADS, &headers, file[..first].to_vec()).await;
        assert_eq!(answer.status, StatusCode::CREATED);
        assert_eq!(answer.headers["upload-offset"].to_str().unwrap(), first.to_string());
        let upload = answer.headers[header::LOCATION].to_str().unwrap();
        if first < file.len() {
            service.append(upload, first, file[first..].to_vec()).await.ok();
        }
        assert_eq!(service.outcome(upload).await.dataset.unwrap().name, "a");
    }
}

/// The body of a form with files.
fn form(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, content) in files {
        let head = format!("Content-Disposition: form-data; name=\"file\"; filename=\"{name}\"");
        body.extend_from_slice(format!("--XX\r\n{head}\r\n\r\n").as_bytes());
        body.extend_from_slice(content);
        body.extend_from_slice(b"\r\n");
    }
    body.extend_from_slice(b"--XX--\r\n");
    body
}

/// `filetype multipart/form-data; boundary=XX`.
const FORM: (&str, &str) = ("upload-metadata", "filetype bXVsdGlwYXJ0L2Zvcm0tZGF0YTsgYm91bmRhcnk9WFg=");

#[tokio::test]
async fn several_files_come_as_a_form() {
    let service = Service::new();
    let head = b"NDims = 3\nDimSize = 16 16 16\nElementType = MET_UCHAR\nElementDataFile = ball.raw\n";
    let body = form(&[("ball.mhd", head), ("ball.raw", &ball(0))]);
    let length = body.len().to_string();
    let answer = service.tus("POST", UPLOADS, &[BYTES, ("upload-length", &length), FORM], body).await.ok();
    let upload = answer.headers[header::LOCATION].to_str().unwrap();
    let outcome = service.outcome(upload).await;
    assert_eq!(outcome.dataset.expect("a dataset").format, "metaimage");
    // A form that is none.
    let headers = [BYTES, ("upload-length", "5"), FORM];
    let answer = service.tus("POST", UPLOADS, &headers, "hello").await.ok();
    let outcome = service.outcome(answer.headers[header::LOCATION].to_str().unwrap()).await;
    assert_eq!((outcome.state, outcome.problem.unwrap().status), (UploadState::Refused, 400));
}

#[tokio::test]
async fn of_dicom_no_patient_is_kept_once_the_upload_ended() {
    let service = Service::new();
    let files = [slice("1", 0), slice("1", 2)];
    let body = form(&[("DOE_JANE_1.dcm", &files[0]), ("DOE_JANE_2.dcm", &files[1])]);
    let length = body.len().to_string();
    let answer = service.tus("POST", UPLOADS, &[BYTES, ("upload-length", &length), FORM], body).await.ok();
    let outcome = service.outcome(answer.headers[header::LOCATION].to_str().unwrap()).await;
    assert_eq!(outcome.dataset.expect("a dataset").format, "dicom");
    let single = service.begin("DOE_JANE.dcm", 100).await;
    service.append(&single, 0, vec![b'D'; 100]).await.ok();
    assert_eq!(service.outcome(&single).await.state, UploadState::Refused);
    wait_until_stored(&service, 4).await;
    let mut folders = vec![service.folder.path().to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let bytes = std::fs::read(&path).unwrap();
            for name in [&b"DOE"[..], b"RE9F"] {
                assert!(!bytes.windows(name.len()).any(|window| window == name), "{path:?}");
            }
        }
    }
}

#[tokio::test]
async fn what_arrived_before_a_break_is_kept() {
    let service = Service::new();
    let file = nrrd(0);
    let upload = service.begin("a.nrrd", file.len()).await;
    let pieces = [Ok(Bytes::from(file[..1500].to_vec())), Err(std::io::Error::other("cable pulled"))];
    let broken = Body::from_stream(futures_util::stream::iter(pieces));
    service.append(&upload, 0, broken).await.problem(400);
    assert_eq!(service.offset(&upload).await, 1500);
    service.append(&upload, 1500, file[1500..].to_vec()).await.ok();
    assert_eq!(service.outcome(&upload).await.state, UploadState::Stored);
}

#[tokio::test]
async fn a_request_takes_over_from_one_that_hangs() {
    let service = Service::with(|config| config.limits.max_uploads = 1);
    let file = nrrd(0);
    let upload = service.begin("a.nrrd", file.len()).await;
    // Sends a beginning and then nothing, without ending: a connection that died unnoticed.
    let hanging = |piece: Vec<u8>| {
        let beginning = futures_util::stream::iter([Ok::<_, std::io::Error>(Bytes::from(piece))]);
        Body::from_stream(futures_util::StreamExt::chain(beginning, futures_util::stream::pending()))
    };
    let stale = service.append(&upload, 0, hanging(file[..700].to_vec()));
    let next = async {
        tokio::time::sleep(std::time::Duration::from_millis(200)).await;
        service.offset(&upload).await
    };
    let (stale, offset) = tokio::join!(stale, next);
    stale.problem(423);
    assert_eq!(offset, 700, "what the stale request brought is kept");
    // The one after it holds the only place for uploads, too.
    let stale = service.append(&upload, 700, hanging(file[700..900].to_vec()));
    let next = async {
        tokio::time::sleep(std::time::Duration::from_millis(200)).await;
        let early = service.append(&upload, 700, file[700..].to_vec()).await;
        early.problem(409);
        service.append(&upload, 900, file[900..].to_vec()).await.ok();
    };
    let (stale, ()) = tokio::join!(stale, next);
    stale.problem(423);
    assert_eq!(service.outcome(&upload).await.state, UploadState::Stored);
}

#[tokio::test]
async fn an_upload_goes_on_after_a_restart() {
    let service = Service::new();
    let file = nrrd(0);
    let upload = service.begin("a.nrrd", file.len()).await;
    service.append(&upload, 0, file[..1000].to_vec()).await.ok();
    let folder = service.stopped().await;
    // What a crash may leave: bytes that nobody was told are safe, and half-made files.
    let id = upload.rsplit('/').next().unwrap();
    let place = |name: &str| folder.path().join("data/uploads").join(name);
    let data = place(&format!("{id}.data"));
    let mut bytes = std::fs::read(&data).unwrap();
    bytes.extend([7; 50]);
    std::fs::write(&data, bytes).unwrap();
    std::fs::write(place("ffff.data"), b"x").unwrap();
    std::fs::write(place(&format!("{id}.1234.part")), b"{").unwrap();
    let service = Service::in_folder(folder, |_| {});
    assert_eq!(service.stored_files().len(), 2, "{:?}", service.stored_files());
    let head = service.tus("HEAD", &upload, &[], Body::empty()).await.ok();
    assert_eq!(head.headers["upload-offset"], "1000");
    assert_eq!(head.headers["upload-metadata"], "filename YS5ucnJk");
    service.append(&upload, 1000, file[1000..].to_vec()).await.ok();
    let outcome = service.outcome(&upload).await;
    assert_eq!(outcome.state, UploadState::Stored, "{outcome:?}");
    // How it ended is known after another one.
    let service = service.restarted().await;
    assert_eq!(service.outcome(&upload).await, outcome);
}

#[tokio::test]
async fn a_complete_upload_is_read_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let uploads = folder.path().join("data/uploads");
    std::fs::create_dir_all(&uploads).unwrap();
    let file = nrrd(0);
    for (id, attempts) in [("aa", 0), ("bb", 5)] {
        std::fs::write(uploads.join(format!("{id}.data")), &file).unwrap();
        let record = serde_json::json!({"version": 1, "length": file.len(), "offset": file.len(),
            "metadata": "filename YS5ucnJk", "attempts": attempts,
            "touched_unix_millis": std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap().as_millis() as u64});
        std::fs::write(uploads.join(format!("{id}.json")), record.to_string()).unwrap();
    }
    let service = Service::in_folder(folder, |_| {});
    let listening = service.listen().await;
    assert_eq!(service.outcome("aa").await.dataset.expect("a dataset").name, "a");
    // One that was read five times and never to an end would end the service again and again.
    let outcome = service.outcome("bb").await;
    assert_eq!(outcome.state, UploadState::Refused, "{outcome:?}");
    listening.stop.cancel();
}

#[tokio::test]
async fn what_fails_for_now_can_be_tried_again() {
    let service = Service::with(|config| config.limits.max_datasets = 1);
    let (first, second) = (nrrd(0), nrrd(2));
    let uploads = [service.begin("a.nrrd", first.len()).await, service.begin("b.nrrd", second.len()).await];
    service.append(&uploads[0], 0, first.clone()).await.ok();
    let dataset = service.outcome(&uploads[0]).await.dataset.unwrap();
    service.append(&uploads[1], 0, second.clone()).await.ok();
    let outcome = service.outcome(&uploads[1]).await;
    assert_eq!(outcome.state, UploadState::Failed, "{outcome:?}");
    assert!(outcome.problem.unwrap().detail.contains("max_datasets"));
    service.delete(&format!("/datasets/{}", dataset.id)).await.ok();
    service.append(&uploads[1], second.len(), Body::empty()).await.ok();
    assert_eq!(service.outcome(&uploads[1]).await.dataset.expect("a dataset").name, "b");
}

#[tokio::test]
async fn cancelling_gives_everything_back() {
    let service = Service::with(|config| config.limits.max_storage_bytes = 5000);
    let file = nrrd(0);
    let upload = service.begin("a.nrrd", file.len()).await;
    service.append(&upload, 0, file[..1000].to_vec()).await.ok();
    service.put("/datasets/b.nrrd", nrrd(2)).await.problem(507);
    let answer = service.tus("DELETE", &upload, &[], Body::empty()).await;
    assert_eq!(answer.status, StatusCode::NO_CONTENT);
    for method in ["HEAD", "GET", "PATCH", "DELETE"] {
        let answer = service.tus(method, &upload, &[BYTES, ("upload-offset", "1000")], Body::empty()).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{method}");
    }
    wait_until_stored(&service, 0).await;
    service.put("/datasets/b.nrrd", nrrd(2)).await.ok();
}

#[tokio::test]
async fn an_upload_that_receives_nothing_expires() {
    let service = Service::with(|config| config.upload_idle_seconds = 1);
    let upload = service.begin("a.nrrd", 5000).await;
    service.append(&upload, 0, vec![1; 1000]).await.ok();
    let head = service.tus("HEAD", &upload, &[], Body::empty()).await.ok();
    assert!(head.headers.contains_key("upload-expires"));
    tokio::time::sleep(std::time::Duration::from_millis(1100)).await;
    for method in ["GET", "PATCH", "DELETE"] {
        let answer = service.tus(method, &upload, &[BYTES, ("upload-offset", "1000")], Body::empty()).await;
        assert_eq!(answer.problem(410).kind, "/problems/gone", "{method}");
    }
    assert_eq!(service.tus("HEAD", &upload, &[], Body::empty()).await.status, StatusCode::GONE);
    assert_eq!(service.stored_files().len(), 1, "only that it was there: {:?}", service.stored_files());
    // Nobody has to ask: the service looks by itself.
    let left = service.begin("b.nrrd", 5000).await;
    tokio::time::sleep(std::time::Duration::from_millis(1100)).await;
    let tending = tokio::spawn(uploads::tend(service.app.clone()));
    let id = left.rsplit('/').next().unwrap().to_owned();
    for _ in 0..500 {
        if !service.stored_files().contains(&format!("uploads/{id}.data")) {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    tending.abort();
    assert!(!service.stored_files().contains(&format!("uploads/{id}.data")));
}

#[tokio::test]
async fn a_method_may_be_named_in_a_header() {
    let service = Service::new();
    let file = nrrd(0);
    let upload = service.begin("a.nrrd", file.len()).await;
    let meaning = |method: &'static str| [("x-http-method-override", method), BYTES, ("upload-offset", "0")];
    let answer = service.tus("POST", &upload, &meaning("PATCH"), file[..10].to_vec()).await;
    assert_eq!(
        (answer.status, &answer.headers["upload-offset"]),
        (StatusCode::NO_CONTENT, &"10".parse().unwrap())
    );
    let answer = service.tus("POST", &upload, &meaning("HEAD"), Body::empty()).await.ok();
    assert_eq!(answer.headers["upload-offset"], "10");
    service.tus("POST", &upload, &meaning("CONNECT"), Body::empty()).await.problem(400);
    service.tus("POST", &upload, &[], Body::empty()).await.problem(400);
    let answer = service.tus("POST", &upload, &meaning("DELETE"), Body::empty()).await;
    assert_eq!(answer.status, StatusCode::NO_CONTENT);
    // Elsewhere the header means nothing.
    let request = Request::builder().method(Method::GET).uri("/api/v1/datasets");
    let request = request.header("x-http-method-override", "DELETE").body(Body::empty()).unwrap();
    service.send(request).await.ok();
}
