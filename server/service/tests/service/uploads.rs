//! Uploads: every way in, and every way to be refused without leaving a trace.

use axum::body::{Body, Bytes};
use axum::http::{Method, StatusCode, header};
use tokio::io::AsyncWriteExt;

use crate::support::{Service, ball, nrrd};

#[tokio::test]
async fn equal_content_is_one_dataset() {
    let service = Service::new();
    let first = service.put("/datasets/a.nrrd", nrrd(0)).await;
    assert_eq!(first.status, StatusCode::CREATED);
    let id = first.json()["id"].as_str().unwrap().to_owned();
    assert_eq!(first.headers[header::LOCATION], format!("/api/v1/datasets/{id}"));
    let second = service.put("/datasets/b.nrrd", nrrd(0)).await;
    assert_eq!(second.status, StatusCode::OK);
    assert_eq!(second.json(), first.json(), "the first name stays");
    let third = service.form(&[("file", "c.nrrd", &nrrd(0))]).await;
    assert_eq!((third.status, third.json()), (StatusCode::OK, first.json()));
    let other = service.put("/datasets/a.nrrd", nrrd(2)).await;
    assert_eq!(other.status, StatusCode::CREATED);
    assert_ne!(other.json()["id"], first.json()["id"]);
}

#[tokio::test]
async fn many_at_once_store_one_dataset() {
    let service = Service::new();
    let uploads = (0..4).map(|_| service.put("/datasets/a.nrrd", nrrd(0)));
    let answers = futures_util::future::join_all(uploads).await;
    let created = answers.iter().filter(|answer| answer.status == StatusCode::CREATED).count();
    assert_eq!(created, 1);
    assert!(answers.iter().all(|answer| answer.status.is_success()));
    wait_until_stored(&service, 2).await;
}

#[tokio::test]
async fn a_header_and_its_data_are_one_dataset() {
    let service = Service::new();
    let header =
        b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 16 16\nencoding: raw\ndata file: ball.raw\n";
    let voxels = ball(0);
    let answer = service.form(&[("file", "ball.raw", &voxels), ("file", "ball.nhdr", header)]).await;
    assert_eq!(answer.status, StatusCode::CREATED, "{}", answer.json());
    assert_eq!(answer.json()["name"], "ball");
    assert_eq!(answer.json()["bytes"], voxels.len() + header.len());
    let missing = service.form(&[("file", "ball.nhdr", header)]).await.problem(422);
    assert!(missing.detail.contains("ball"), "the reader's words: {}", missing.detail);
}

#[tokio::test]
async fn a_metaimage_header_and_its_data_are_one_dataset() {
    let service = Service::new();
    let header = b"NDims = 3\nDimSize = 16 16 16\nElementSpacing = 1 1 2\nElementType = MET_UCHAR\n\
                   ElementDataFile = ball.raw\n";
    let answer = service.form(&[("file", "ball.raw", &ball(0)), ("file", "ball.mhd", header)]).await;
    assert_eq!(answer.status, StatusCode::CREATED, "{}", answer.json());
    assert_eq!(answer.json()["format"], "metaimage");
    assert_eq!(answer.json()["spacing"], serde_json::json!([1.0, 1.0, 2.0]));
}

#[tokio::test]
async fn a_zipped_ome_zarr_is_one_dataset() {
    let service = Service::new();
    let axes = serde_json::json!([{"name": "z"}, {"name": "y"}, {"name": "x"}]);
    let attributes = serde_json::json!({"multiscales": [{"axes": axes, "datasets": [{"path": "0"}]}]});
    let array = serde_json::json!({"zarr_format": 2, "shape": [16, 16, 16], "chunks": [16, 16, 16],
        "dtype": "|u1", "compressor": null, "fill_value": 0, "order": "C", "filters": null});
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let files = [
        (".zattrs", attributes.to_string().into_bytes()),
        ("0/.zarray", array.to_string().into_bytes()),
        ("0/0.0.0", ball(0)),
    ];
    for (name, bytes) in files {
        let name = format!("ball.ome.zarr/{name}");
        archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut archive, &bytes).unwrap();
    }
    let archive = archive.finish().unwrap().into_inner();
    let answer = service.put("/datasets/ball.ome.zarr.zip", archive).await;
    assert_eq!(answer.status, StatusCode::CREATED, "{}", answer.json());
    assert_eq!((&answer.json()["format"], &answer.json()["name"]), (&"ome-zarr".into(), &"ball".into()));
}

/// A slice of the ball as PNG.
fn png_slice(z: usize) -> Vec<u8> {
    let voxels = ball(0)[z * 256..(z + 1) * 256].to_vec();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::GrayImage::from_raw(16, 16, voxels)
        .unwrap()
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

#[tokio::test]
async fn slices_in_files_of_their_own_are_one_dataset_in_the_order_of_their_numbers() {
    let service = Service::new();
    let slices: Vec<_> = (0..16).map(|z| (format!("ball_{z}.png"), png_slice(z))).collect();
    let parts: Vec<_> =
        slices.iter().map(|(name, bytes)| ("file", name.as_str(), bytes.as_slice())).collect();
    let answer = service.form(&parts).await;
    assert_eq!(answer.status, StatusCode::CREATED, "{}", answer.json());
    let dataset = answer.json();
    assert_eq!((&dataset["format"], &dataset["name"]), (&"png".into(), &"ball".into()));
    assert_eq!(dataset["dims"], serde_json::json!([16, 16, 16]));
    let id = dataset["id"].as_str().unwrap().to_owned();
    let whole =
        service.put("/datasets/ball.nrrd", nrrd(0)).await.ok().json()["id"].as_str().unwrap().to_owned();
    let again = service.form(&parts).await;
    assert_eq!((again.status, again.json()), (StatusCode::OK, dataset));

    // Read again from what was stored, after the volumes in memory are gone.
    let service = service.restarted().await;
    let [of_slices, of_file] = [&id, &whole].map(|id| format!("/datasets/{id}/histogram"));
    let expected = service.get(&of_file).await.ok().json();
    // 2 and 10 would change places if names were sorted as text: other blocks would hold a value.
    assert_eq!(service.get(&of_slices).await.ok().json(), expected);
    let file = service.get(&format!("/datasets/{id}/scene")).await.ok().json();
    assert_eq!(file["volume"]["dataset"], id.as_str());
    service.delete(&format!("/datasets/{id}")).await.ok();
    assert_eq!(service.stored_files().len(), 2, "the other dataset stays");
}

#[tokio::test]
async fn slices_that_do_not_fit_together_are_refused_in_words() {
    let service = Service::new();
    let mut other = std::io::Cursor::new(Vec::new());
    image::GrayImage::new(16, 8).write_to(&mut other, image::ImageFormat::Png).unwrap();
    let parts: [(&str, &str, &[u8]); 2] =
        [("file", "a1.png", &png_slice(3)), ("file", "a2.png", other.get_ref())];
    let problem = service.form(&parts).await.problem(422);
    assert!(problem.detail.contains("a2.png"), "{}", problem.detail);
    let mixed: [(&str, &str, &[u8]); 2] =
        [("file", "a1.png", &png_slice(3)), ("file", "a2.tif", other.get_ref())];
    let problem = service.form(&mixed).await.problem(422);
    assert!(problem.detail.contains("files of one kind"), "{}", problem.detail);
    wait_until_stored(&service, 0).await;
}

#[tokio::test]
async fn raw_files_are_described_by_a_query_or_a_sidecar() {
    let service = Service::new();
    let by_query = service.put("/datasets/ball.raw?dims=16,16,16&type=uint8&spacing=1,2,3", ball(0)).await;
    assert_eq!(by_query.status, StatusCode::CREATED, "{}", by_query.json());
    assert_eq!(by_query.json()["spacing"], serde_json::json!([1.0, 2.0, 3.0]));
    let sidecar = br#"{"dims": [16, 16, 16], "type": "uint8"}"#;
    let by_sidecar = service.form(&[("file", "ball.raw", &ball(0)), ("file", "ball.json", sidecar)]).await;
    assert_eq!(by_sidecar.status, StatusCode::CREATED, "{}", by_sidecar.json());
    for (query, field) in
        [("dims=16,16&type=uint8", "dims"), ("dims=16,16,16", "type"), ("type=uint8", "dims")]
    {
        let problem = service.put(&format!("/datasets/ball.raw?{query}"), ball(0)).await.problem(422);
        assert_eq!(problem.field.as_deref(), Some(field));
    }
    let wrong = service.put("/datasets/ball.raw?dims=16,16,17&type=uint8", ball(0)).await.problem(422);
    assert!(wrong.detail.contains("ball.raw"), "{}", wrong.detail);
    service.put("/datasets/ball.raw?dimensions=1", ball(0)).await.problem(400);
}

#[tokio::test]
async fn what_no_reader_accepts_leaves_nothing_behind() {
    let service = Service::new();
    let cut = nrrd(0)[..200].to_vec();
    let problem = service.put("/datasets/cut.nrrd", cut).await.problem(422);
    assert_eq!(problem.kind, "/problems/unreadable-file");
    service.put("/datasets/x.bin", "no volume at all").await.problem(422);
    service.put("/datasets/empty.nrrd", "").await.problem(422);
    service.form(&[]).await.problem(422);
    let problem = service.form(&[("data", "a.nrrd", &nrrd(0))]).await.problem(422);
    assert_eq!(problem.field.as_deref(), Some("data"));
    service.form(&[("file", "a.nrrd", &nrrd(0)), ("file", "x/a.nrrd", &nrrd(2))]).await.problem(422);
    wait_until_stored(&service, 0).await;
}

#[tokio::test]
async fn hostile_names_become_plain_ones() {
    let service = Service::new();
    let answer = service.put("/datasets/..%2F..%2Fescape.nrrd", nrrd(0)).await;
    assert_eq!(answer.status, StatusCode::CREATED);
    assert_eq!(answer.json()["name"], "escape");
    let answer = service.form(&[("file", "../../../../tmp/../escape2.nrrd", &nrrd(2))]).await;
    assert_eq!(answer.status, StatusCode::CREATED);
    assert!(!service.folder.path().join("escape.nrrd").exists());
    assert_eq!(service.stored_files().len(), 4);
    for id in ["..%2F..%2Fetc%2Fpasswd", "..", "%00", "pillars%2F..%2Fpillars"] {
        service.get(&format!("/datasets/{id}")).await.problem(404);
        service.get(&format!("/datasets/{id}/thumbnail")).await.problem(404);
    }
}

#[tokio::test]
async fn limits_hold() {
    let service = Service::with(|config| {
        config.limits.max_upload_bytes = 5000;
        config.limits.max_storage_bytes = 6000;
        config.limits.max_upload_files = 2;
        config.limits.max_datasets = 2;
    });
    // Said beforehand, and found out underway.
    service.put("/datasets/a.nrrd", vec![0; 5001]).await.problem(413);
    let pieces = (0..100).map(|_| Ok::<_, std::io::Error>(Bytes::from(vec![0; 100])));
    let unannounced = Body::from_stream(futures_util::stream::iter(pieces));
    service.put("/datasets/a.nrrd", unannounced).await.problem(413);
    let small: &[u8] = b"x";
    service.form(&[("file", "a", small), ("file", "b", small), ("file", "c", small)]).await.problem(413);
    wait_until_stored(&service, 0).await;
    service.put("/datasets/a.nrrd", nrrd(0)).await.ok();
    let problem = service.put("/datasets/b.nrrd", nrrd(2)).await.problem(507);
    assert_eq!(problem.kind, "/problems/storage-full");
    // What was refused takes no room: this just fits.
    let small = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n12345678";
    service.put("/datasets/c.nrrd", small.to_vec()).await.ok();
    let problem = service.put("/datasets/d.nrrd", small[..70].to_vec()).await.problem(507);
    assert!(problem.detail.contains("max_datasets"), "{}", problem.detail);
}

#[tokio::test]
async fn too_many_uploads_at_once_are_asked_to_wait() {
    let service = Service::with(|config| config.limits.max_uploads = 1);
    let (sender, receiver) = tokio::sync::mpsc::channel::<Result<Bytes, std::io::Error>>(1);
    let stream = futures_util::stream::unfold(receiver, |mut receiver| async {
        receiver.recv().await.map(|piece| (piece, receiver))
    });
    let slow = service.put("/datasets/a.nrrd", Body::from_stream(stream));
    let other = async {
        sender.send(Ok(Bytes::from(nrrd(0)))).await.unwrap();
        sender.send(Ok(Bytes::new())).await.unwrap();
        let answer = service.put("/datasets/b.nrrd", nrrd(2)).await;
        drop(sender);
        answer
    };
    let (slow, other) = tokio::join!(slow, other);
    assert_eq!(slow.status, StatusCode::CREATED);
    other.problem(503);
    assert!(other.headers.contains_key(header::RETRY_AFTER));
}

#[tokio::test]
async fn an_upload_that_breaks_off_leaves_nothing() {
    let service = Service::new();
    let pieces = [Ok(Bytes::from(nrrd(0)[..1000].to_vec())), Err(std::io::Error::other("cable pulled"))];
    service.put("/datasets/a.nrrd", Body::from_stream(futures_util::stream::iter(pieces))).await.problem(400);
    wait_until_stored(&service, 0).await;
    // Over a socket: the connection goes away in the middle of the body.
    let listening = service.listen().await;
    let mut socket = tokio::net::TcpStream::connect(listening.address).await.unwrap();
    let head = "PUT /api/v1/datasets/a.nrrd HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4000\r\n\r\n";
    socket.write_all(head.as_bytes()).await.unwrap();
    socket.write_all(&nrrd(0)[..1000]).await.unwrap();
    socket.flush().await.unwrap();
    for _ in 0..200 {
        if !service.stored_files().is_empty() {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    assert_eq!(service.stored_files().len(), 1, "the upload is being received");
    drop(socket);
    wait_until_stored(&service, 0).await;
}

/// Folders that were not stored are removed in the background.
pub async fn wait_until_stored(service: &Service, files: usize) {
    for _ in 0..500 {
        if service.stored_files().len() == files {
            return;
        }
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    panic!("expected {files} files: {:?}", service.stored_files());
}

/// A DICOM slice of 4 x 3 pixels that names its patient.
pub fn slice(series: &str, z: i32) -> Vec<u8> {
    let mut bytes = vec![0; 128];
    bytes.extend(b"DICM");
    let mut element = |group: u16, number: u16, representation: &str, value: &[u8]| {
        bytes.extend(group.to_le_bytes());
        bytes.extend(number.to_le_bytes());
        bytes.extend(representation.as_bytes());
        let padded = value.len() + value.len() % 2;
        match representation {
            "OW" => bytes.extend((padded as u64 * 0x1_0000).to_le_bytes()[..6].iter()),
            _ => bytes.extend((padded as u16).to_le_bytes()),
        }
        bytes.extend(value);
        bytes.resize(bytes.len() + padded - value.len(), b' ');
    };
    element(2, 0x10, "UI", b"1.2.840.10008.1.2.1\0");
    element(8, 0x60, "CS", b"CT");
    element(8, 0x103E, "LO", format!("part {series}").as_bytes());
    element(0x10, 0x10, "PN", b"DOE^JANE");
    element(0x20, 0xE, "UI", format!("1.2.{series}").as_bytes());
    element(0x20, 0x32, "DS", format!("0\\0\\{z}").as_bytes());
    element(0x20, 0x37, "DS", b"1\\0\\0\\0\\1\\0");
    element(0x28, 2, "US", &[1, 0]);
    element(0x28, 4, "CS", b"MONOCHROME2");
    for (number, value) in [(0x10, 3), (0x11, 4), (0x100, 8), (0x101, 8), (0x102, 7), (0x103, 0)] {
        element(0x28, number, "US", &[value, 0]);
    }
    element(0x28, 0x30, "DS", b"1\\1");
    element(0x7FE0, 0x10, "OW", &(0..12).map(|i| i + z as u8).collect::<Vec<_>>());
    bytes
}

#[tokio::test]
async fn of_dicom_the_volumes_are_kept_and_no_patient() {
    let service = Service::new();
    let files: Vec<(String, Vec<u8>)> = [("1", 0), ("1", 2), ("1", 4), ("2", 0), ("2", 5)]
        .map(|(series, z)| (format!("DOE_JANE_{series}_{z}.dcm"), slice(series, z)))
        .into();
    let parts: Vec<(&str, &str, &[u8])> =
        files.iter().map(|(name, bytes)| ("file", name.as_str(), bytes.as_slice())).collect();
    let answer = service.form(&parts).await;
    assert_eq!(answer.status, StatusCode::CREATED, "{}", answer.json());
    let dataset = answer.json();
    assert_eq!(dataset["format"], "dicom");
    assert_eq!(dataset["name"], "CT part 1");
    assert_eq!(dataset["dims"], serde_json::json!([4, 3, 3]));
    assert_eq!(
        dataset["choices"],
        serde_json::json!(["CT part 1 (4 x 3, 3 slices)", "CT part 2 (4 x 3, 2 slices)"])
    );
    // A manifest and a folder of volumes; nothing of the upload.
    wait_until_stored(&service, 2).await;
    let mut folders = vec![service.folder.path().to_owned()];
    let mut read = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            assert!(!path.to_string_lossy().contains("DOE"), "{path:?}");
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let bytes = std::fs::read(&path).unwrap();
            assert!(!bytes.windows(3).any(|window| window == b"DOE"), "{path:?}");
            read += 1;
        }
    }
    assert!(read >= 3, "only {read} files were looked at");
    // Either series can be shown.
    let id = dataset["id"].as_str().unwrap();
    for (index, found) in [(0, true), (1, true), (2, false)] {
        let scene = serde_json::json!({"scene": {"version": 1, "volume": {"dataset": id, "index": index}}});
        let answer = service.json(Method::POST, "/sessions", scene).await;
        assert_eq!(answer.status.is_success(), found, "{index}: {}", answer.json());
    }
    let broken = service
        .form(&[("file", "a.dcm", &files[0].1[..files[0].1.len() - 6]), ("file", "b.dcm", &files[1].1)])
        .await;
    let problem = broken.problem(422);
    assert!(problem.detail.starts_with("a.dcm"), "{}", problem.detail);
}
