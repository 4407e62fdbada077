//! Resumable uploads: what is wrong, damaged or too much is answered with a problem document, and
//! changes nothing.

use axum::body::{Body, Bytes};
use axum::http::{Request, StatusCode, header};

use crate::support::{BYTES, Service, UPLOADS, nrrd};
use crate::uploads::wait_until_stored;

#[tokio::test]
async fn requests_that_are_not_understood_change_nothing() {
    let service = Service::with(|config| config.limits.max_upload_bytes = 10_000);
    let long = format!("filename {}", "A".repeat(5000));
    let creations: [(&[(&str, &str)], u16); 14] = [
        (&[], 400),
        (&[("upload-length", "")], 400),
        (&[("upload-length", "-1")], 400),
        (&[("upload-length", "1e3")], 400),
        (&[("upload-length", "99999999999999999999999")], 400),
        (&[("upload-defer-length", "1")], 400),
        (&[("upload-length", "10001")], 413),
        (&[("upload-length", "5"), ("upload-metadata", "filename %%%")], 400),
        (&[("upload-length", "5"), ("upload-metadata", "a YQ==,a YQ==")], 400),
        (&[("upload-length", "5"), ("upload-metadata", &long)], 400),
        (&[("upload-length", "5"), ("upload-checksum", "md5 AAAA")], 400),
        (&[("upload-length", "5"), ("content-length", "6"), BYTES], 413),
        (&[("upload-length", "5"), ("content-length", "5"), ("content-type", "text/plain")], 415),
        (&[("upload-length", "5"), ("content-length", "5")], 415),
    ];
    for (headers, status) in creations {
        let answer = service.tus("POST", UPLOADS, headers, Body::empty()).await;
        assert_eq!(answer.problem(status).status, status, "{headers:?}");
        assert_eq!(answer.headers["tus-resumable"], "1.0.0");
    }
    wait_until_stored(&service, 0).await;

    let upload = service.begin("a.nrrd", 100).await;
    service.append(&upload, 0, vec![1; 50]).await.ok();
    let appendices: [(&[(&str, &str)], u16); 9] = [
        (&[("upload-offset", "50")], 415),
        (&[("upload-offset", "50"), ("content-type", "application/octet-stream")], 415),
        (&[BYTES], 400),
        (&[BYTES, ("upload-offset", "fifty")], 400),
        (&[BYTES, ("upload-offset", "49")], 409),
        (&[BYTES, ("upload-offset", "51")], 409),
        (&[BYTES, ("upload-offset", "50"), ("content-length", "51")], 413),
        (&[BYTES, ("upload-offset", "50"), ("upload-checksum", "sha1 ?")], 400),
        (&[BYTES, ("upload-offset", "50"), ("upload-checksum", "sha512 AAAA")], 400),
    ];
    for (headers, status) in appendices {
        let answer = service.tus("PATCH", &upload, headers, vec![2; 50]).await;
        assert_eq!(answer.problem(status).status, status, "{headers:?}");
        assert_eq!(service.offset(&upload).await, 50, "{headers:?}");
    }
    // Longer than announced, and found out underway.
    let pieces = (0..20).map(|_| Ok::<_, std::io::Error>(Bytes::from(vec![3; 10])));
    let unannounced = Body::from_stream(futures_util::stream::iter(pieces));
    service.append(&upload, 50, unannounced).await.problem(413);
    assert_eq!(service.offset(&upload).await, 50);
    for id in ["nothing", "..%2Fdatasets%2Fx", "%00"] {
        service.tus("PATCH", id, &[BYTES, ("upload-offset", "0")], Body::empty()).await.problem(404);
        assert_eq!(service.tus("HEAD", id, &[], Body::empty()).await.status, StatusCode::NOT_FOUND);
    }
    service.tus("PUT", &upload, &[], Body::empty()).await.problem(405);
}

#[tokio::test]
async fn other_versions_are_told_which_one_is_spoken() {
    let service = Service::new();
    let upload = service.begin("a.nrrd", 10).await;
    for version in [None, Some("0.2.2"), Some("1.0.1")] {
        for (method, path) in [("POST", UPLOADS), ("PATCH", &upload), ("DELETE", &upload)] {
            let mut request = Request::builder().method(method).uri(path).header("upload-length", "5");
            if let Some(version) = version {
                request = request.header("tus-resumable", version);
            }
            let answer = service.send(request.body(Body::empty()).unwrap()).await;
            answer.problem(412);
            assert_eq!(answer.headers["tus-version"], "1.0.0");
        }
    }
    assert_eq!(service.offset(&upload).await, 0);
    // What became of an upload is asked without tus.
    service.send(Request::get(&upload).body(Body::empty()).unwrap()).await.ok();
}

#[tokio::test]
async fn damaged_bytes_are_thrown_away() {
    let service = Service::new();
    let upload = service.begin("a.nrrd", 34).await;
    let send = async |offset: usize, sum: &str, bytes: &'static str| {
        let offset = offset.to_string();
        let headers = [BYTES, ("upload-offset", &offset), ("upload-checksum", sum)];
        service.tus("PATCH", &upload, &headers, bytes).await
    };
    let sums = [
        "sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0=",
        "sha256 uU0nuZNNPgilLlLX2n2r+sSE7+N6U4DukIj3rOLvzek=",
        "crc32 DUoRhQ==",
    ];
    for (index, sum) in sums.into_iter().enumerate() {
        let problem = send(index * 11, sum, "hello w0rld").await.problem(460);
        assert_eq!(problem.kind, "/problems/checksum-mismatch");
        assert_eq!(service.offset(&upload).await, index * 11);
        send(index * 11, sum, "hello world").await.ok();
        assert_eq!(service.offset(&upload).await, (index + 1) * 11);
    }
    // Checked bytes that break off cannot be checked.
    let other = service.begin("b.nrrd", 33).await;
    let pieces = [Ok(Bytes::from("hello")), Err(std::io::Error::other("cable pulled"))];
    let broken = Body::from_stream(futures_util::stream::iter(pieces));
    let headers = [BYTES, ("upload-offset", "0"), ("upload-checksum", sums[0])];
    service.tus("PATCH", &other, &headers, broken).await.problem(400);
    assert_eq!(service.offset(&other).await, 0);
    // A beginning that is damaged leaves no upload that nobody knows of.
    let files = service.stored_files().len();
    let headers = [BYTES, ("upload-length", "33"), ("upload-checksum", sums[0])];
    service.tus("POST", UPLOADS, &headers, "hello w0rld").await.problem(460);
    wait_until_stored(&service, files).await;
}

#[tokio::test]
async fn what_no_reader_accepts_is_told_and_removed() {
    let service = Service::new();
    for (name, bytes) in [("cut.nrrd", nrrd(0)[..200].to_vec()), ("empty.nrrd", Vec::new())] {
        let upload = service.begin(name, bytes.len()).await;
        if !bytes.is_empty() {
            service.append(&upload, 0, bytes.clone()).await.ok();
        }
        let outcome = service.outcome(&upload).await;
        assert_eq!(outcome.problem.expect("a problem").status, 422);
        // Ended: what is sent again adds nothing.
        service.append(&upload, bytes.len(), Body::empty()).await.ok();
        service.append(&upload, bytes.len() + 1, Body::empty()).await.problem(409);
    }
    wait_until_stored(&service, 2).await;
    assert!(
        service.stored_files().iter().all(|name| name.ends_with(".json")),
        "{:?}",
        service.stored_files()
    );
}

#[tokio::test]
async fn unfinished_uploads_are_bounded() {
    let service = Service::with(|config| {
        config.limits.max_unfinished_uploads = 2;
        config.limits.max_unfinished_bytes = 1000;
        config.limits.max_storage_bytes = 5000;
        config.limits.max_uploads = 1;
    });
    let begin =
        async |length: &str| service.tus("POST", UPLOADS, &[("upload-length", length)], Body::empty()).await;
    let problem = begin("1001").await.problem(507);
    assert!(problem.detail.contains("max_unfinished_bytes"), "{}", problem.detail);
    let first = begin("600").await.ok();
    begin("600").await.problem(507);
    begin("400").await.ok();
    let answer = begin("1").await;
    let problem = answer.problem(503);
    assert!(problem.detail.contains("max_unfinished_uploads"), "{}", problem.detail);
    assert!(answer.headers.contains_key(header::RETRY_AFTER));
    // They take the room they will need.
    service.put("/datasets/b.nrrd", nrrd(2)).await.problem(507);
    // Only so many are received at once, of all kinds.
    let upload = first.headers[header::LOCATION].to_str().unwrap();
    let hanging = Body::from_stream(futures_util::stream::pending::<Result<Bytes, std::io::Error>>());
    let slow =
        tokio::time::timeout(std::time::Duration::from_millis(500), service.put("/datasets/c.nrrd", hanging));
    let other = async {
        tokio::time::sleep(std::time::Duration::from_millis(100)).await;
        let answer = service.append(upload, 0, vec![1; 10]).await;
        answer.problem(503);
        assert!(answer.headers.contains_key(header::RETRY_AFTER));
    };
    let (slow, ()) = tokio::join!(slow, other);
    assert!(slow.is_err(), "it hangs");
    service.append(upload, 0, vec![1; 10]).await.ok();
}
