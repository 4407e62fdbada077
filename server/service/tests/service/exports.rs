//! Turntables and films: how far they have come, cancelling them, what bounds them.

use std::io::Read as _;
use std::time::{Duration, Instant};

use axum::http::{Method, StatusCode, header};
use proto::rest::{Export, ExportState};
use serde_json::{Value, json};

use crate::support::{Answer, SOON, Service, small_scene};

/// A small turntable.
fn wish() -> Value {
    json!({"width": 40, "height": 30, "frames": 6, "turns": 1.0, "frames_per_second": 12, "samples": 1})
}

/// One that takes far longer than a test waits.
fn long_wish() -> Value {
    json!({"width": 1024, "height": 768, "frames": 1440, "turns": 2.0, "frames_per_second": 60, "samples": 4096})
}

async fn begin(service: &Service, session: &str, wish: Value) -> Answer {
    service.json(Method::POST, &format!("/sessions/{session}/exports"), wish).await
}

fn document(answer: &Answer) -> Export {
    assert!(answer.status.is_success(), "{}", String::from_utf8_lossy(&answer.body));
    serde_json::from_slice(&answer.body).unwrap()
}

async fn asked(service: &Service, id: &str) -> Export {
    document(&service.get(&format!("/exports/{id}")).await)
}

/// Waits until an export is as wanted; what was heard on the way.
async fn until(service: &Service, id: &str, wanted: impl Fn(&Export) -> bool) -> Vec<Export> {
    let deadline = Instant::now() + SOON;
    let mut heard = Vec::new();
    loop {
        let export = asked(service, id).await;
        let over = wanted(&export);
        heard.push(export);
        if over {
            return heard;
        }
        assert!(Instant::now() < deadline, "{:?}", heard.last());
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

fn files(service: &Service) -> usize {
    std::fs::read_dir(service.folder.path().join("data/exports")).unwrap().count()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_turntable_is_drawn_and_told_about_and_kept_as_a_file() {
    let service = Service::new();
    let session = service.session().await;
    let answer = begin(&service, &session.id, wish()).await;
    assert_eq!(answer.status, StatusCode::CREATED);
    let export = document(&answer);
    assert_eq!(answer.headers[header::LOCATION], format!("/api/v1/exports/{}", export.id));
    assert_eq!((export.width, export.height, export.frames), (40, 30, 6));
    let heard = until(&service, &export.id, |export| export.state == ExportState::Done).await;
    assert!(heard.is_sorted_by_key(|export| export.frames_done), "progress never goes back");
    assert!(heard.is_sorted_by_key(|export| export.bytes));
    let done = heard.last().unwrap();
    assert_eq!((done.frames_done, done.seconds_left), (6, None));
    for export in heard.iter().filter(|export| export.frames_done > 0 && export.state == ExportState::Drawing)
    {
        assert!(export.seconds_left.is_some_and(|left| (0.0..60.0).contains(&left)), "{export:?}");
    }

    let file = service.get(&format!("/exports/{}/file", export.id)).await.ok();
    assert_eq!(file.headers[header::CONTENT_TYPE], "image/apng");
    assert_eq!(file.headers[header::CONTENT_DISPOSITION], "attachment");
    assert_eq!(file.body.len() as u64, done.bytes);
    let mut reader = png::Decoder::new(std::io::Cursor::new(&file.body)).read_info().unwrap();
    assert_eq!(reader.info().animation_control().unwrap().num_frames, 6);
    let mut pictures = Vec::new();
    for _ in 0..6 {
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pictures.push(pixels);
    }
    for other in 1..6 {
        assert_ne!(pictures[0], pictures[other], "the camera moves");
    }

    // The first picture is that of the session's camera, bit by bit.
    service
        .json(
            Method::PATCH,
            &format!("/sessions/{}/scene", session.id),
            json!({"sampling": {"samples_per_pixel": 1}}),
        )
        .await
        .ok();
    let still = service.get(&format!("/sessions/{}/snapshot?width=40&height=30", session.id)).await.ok();
    assert_eq!(image::load_from_memory(&still.body).unwrap().to_rgb8().into_raw(), pictures[0]);

    assert_eq!(service.delete(&format!("/exports/{}", export.id)).await.status, StatusCode::NO_CONTENT);
    service.get(&format!("/exports/{}", export.id)).await.problem(404);
    assert_eq!(files(&service), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_archive_has_every_picture() {
    let service = Service::new();
    let session = service.session().await;
    let mut wish = wish();
    wish["format"] = json!("zip");
    let export = document(&begin(&service, &session.id, wish).await);
    until(&service, &export.id, |export| export.state == ExportState::Done).await;
    let file = service.get(&format!("/exports/{}/file", export.id)).await.ok();
    assert_eq!(file.headers[header::CONTENT_TYPE], "application/zip");
    let archive = zip::ZipArchive::new(std::io::Cursor::new(file.body)).unwrap();
    let mut names: Vec<_> = archive.file_names().map(|name| name.unwrap().into_owned()).collect();
    names.sort_unstable();
    let expected: Vec<_> = (1..=6).map(|frame| format!("frame-{frame:04}.png")).collect();
    assert_eq!(names, expected);
}

/// A view of a film: at a time, from a place, with an angle.
fn view(seconds: f64, position: [f64; 3], fov: f64) -> Value {
    let camera = json!({"position": position, "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": fov});
    json!({"seconds": seconds, "camera": camera})
}

/// A small film through three views.
fn film() -> Value {
    let keys = [
        view(0.0, [0.0, 0.0, 2.0], 40.0),
        view(0.2, [2.0, 0.5, 0.0], 30.0),
        view(0.4, [0.0, 0.5, -1.5], 50.0),
    ];
    let mut film = wish();
    film["keys"] = json!(keys);
    film["frames"] = json!(5);
    film["format"] = json!("zip");
    film.as_object_mut().unwrap().remove("turns");
    film
}

#[tokio::test(flavor = "multi_thread")]
async fn a_film_comes_through_its_views() {
    let service = Service::new();
    let session = service.session().await;
    let sampling = json!({"sampling": {"samples_per_pixel": 1}});
    service.json(Method::PATCH, &format!("/sessions/{}/scene", session.id), sampling).await.ok();
    let export = document(&begin(&service, &session.id, film()).await);
    until(&service, &export.id, |export| export.state == ExportState::Done).await;
    let file = service.get(&format!("/exports/{}/file", export.id)).await.ok();
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(file.body)).unwrap();
    assert_eq!(archive.len(), 5);
    let mut pictures = Vec::new();
    for index in 0..5 {
        let mut png = Vec::new();
        archive.by_index(index).unwrap().read_to_end(&mut png).unwrap();
        pictures.push(image::load_from_memory(&png).unwrap().to_rgb8().into_raw());
    }
    // At the views, the pictures are those of their cameras, bit by bit.
    for (index, key) in film()["keys"].as_array().unwrap().iter().enumerate() {
        let patch = json!({"camera": key["camera"]});
        service.json(Method::PATCH, &format!("/sessions/{}/scene", session.id), patch).await.ok();
        let still = service.get(&format!("/sessions/{}/snapshot?width=40&height=30", session.id)).await.ok();
        let expected = image::load_from_memory(&still.body).unwrap().to_rgb8().into_raw();
        assert_eq!(expected, pictures[2 * index], "view {index}");
    }
    assert_ne!(pictures[1], pictures[0]);
    assert_ne!(pictures[1], pictures[2]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_film_that_cannot_be_is_refused_by_its_field() {
    let service = Service::new();
    let session = service.session().await;
    let one = || view(0.0, [0.0, 0.0, 2.0], 40.0);
    let next = |seconds| view(seconds, [2.0, 0.0, 0.0], 40.0);
    let mut flat = next(1.0);
    flat["camera"].as_object_mut().unwrap().remove("fov_y_degrees");
    flat["camera"]["orthographic_height"] = json!(1.0);
    let many: Vec<Value> = (0..65).map(|index| next(f64::from(index))).collect();
    for (field, keys) in [
        ("turns", json!([])),
        ("keys", json!([one()])),
        ("keys", json!(many)),
        ("keys[1].seconds", json!([one(), next(0.0)])),
        ("keys[1].seconds", json!([one(), next(4000.0)])),
        ("keys[0].seconds", json!([next(-1.0), one()])),
        ("keys[1].camera", json!([one(), flat])),
        ("keys[1].camera.target", json!([one(), view(1.0, [0.0; 3], 40.0)])),
        ("keys[1].camera.fov_y_degrees", json!([one(), view(1.0, [1.0; 3], 400.0)])),
    ] {
        let mut film = film();
        film["keys"] = keys;
        let problem = begin(&service, &session.id, film).await.problem(422);
        assert_eq!(problem.field.as_deref(), Some(field), "{}", problem.detail);
    }
    for (field, other) in [("keys", "turns"), ("camera", "camera")] {
        let mut film = film();
        film[other] = if other == "turns" { json!(1.0) } else { one()["camera"].clone() };
        let problem = begin(&service, &session.id, film).await.problem(422);
        assert_eq!(problem.field.as_deref(), Some(field), "{}", problem.detail);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn deleting_an_export_stops_its_work_and_lets_the_next_one_begin() {
    let service = Service::new();
    let session = service.session().await;
    let long = document(&begin(&service, &session.id, long_wish()).await);
    until(&service, &long.id, |export| export.state == ExportState::Drawing).await;
    let next = document(&begin(&service, &session.id, wish()).await);
    assert_eq!(asked(&service, &next.id).await.state, ExportState::Waiting);
    service.get(&format!("/exports/{}/file", long.id)).await.problem(409);

    // It is the last in line: viewers, stills and whoever asks are answered meanwhile.
    service.get(&format!("/sessions/{}/snapshot", session.id)).await.ok();
    assert_eq!(asked(&service, &long.id).await.state, ExportState::Drawing);

    assert_eq!(service.delete(&format!("/exports/{}", long.id)).await.status, StatusCode::NO_CONTENT);
    until(&service, &next.id, |export| export.state == ExportState::Done).await;
    assert_eq!(files(&service), 1, "nothing is left of the one that was stopped");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_who_moves_is_served_beside_an_export() {
    let service = Service::new();
    let session = service.session().await;
    let export = document(&begin(&service, &session.id, long_wish()).await);
    until(&service, &export.id, |export| export.state == ExportState::Drawing).await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    let frames = viewer.frames_until_final().await;
    assert!(frames.last().unwrap().is_final());
    service.delete(&format!("/exports/{}", export.id)).await.ok();
}

#[tokio::test(flavor = "multi_thread")]
async fn limits_are_errors_in_words() {
    let service = Service::with(|config| {
        config.limits.max_exports = 1;
        config.limits.max_export_bytes = 3000;
    });
    let session = service.session().await;
    for (field, value) in [
        ("frames", json!(1)),
        ("frames", json!(100_000)),
        ("turns", json!(0.0)),
        ("turns", json!(11.0)),
        ("width", json!(0)),
        ("width", json!(100_000)),
        ("frames_per_second", json!(0)),
        ("samples", json!(0)),
        ("format", json!("gif")),
        ("colour", json!(1)),
        (
            "camera",
            json!({"position": [0, 0, 0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40.0}),
        ),
    ] {
        let mut wish = wish();
        wish[field] = value;
        let problem = begin(&service, &session.id, wish).await.problem(422);
        assert!(problem.field.is_some_and(|named| named.starts_with(field)), "{field}: {}", problem.detail);
    }
    begin(&service, "nobody", wish()).await.problem(404);

    let mut large = wish();
    (large["width"], large["height"]) = (json!(200), json!(150));
    let export = document(&begin(&service, &session.id, large).await);
    let problem = begin(&service, &session.id, wish()).await.problem(503);
    assert!(problem.detail.contains("limits.max_exports"), "{}", problem.detail);
    let heard = until(&service, &export.id, |export| export.state == ExportState::Failed).await;
    let failed = heard.last().unwrap();
    let detail = &failed.problem.as_ref().unwrap().detail;
    assert!(detail.contains("limits.max_export_bytes"), "{detail}");
    assert_eq!(failed.bytes, 0);
    service.get(&format!("/exports/{}/file", export.id)).await.problem(409);
}

#[tokio::test(flavor = "multi_thread")]
async fn exports_expire_and_do_not_survive_a_restart() {
    let service = Service::with(|config| config.export_keep_seconds = 0);
    let session = service.session().await;
    let export = document(&begin(&service, &session.id, wish()).await);
    let deadline = Instant::now() + SOON;
    while service.get(&format!("/exports/{}", export.id)).await.status != StatusCode::NOT_FOUND {
        assert!(Instant::now() < deadline);
        tokio::time::sleep(Duration::from_millis(5)).await;
    }

    let service = Service::new();
    let session = service.json(Method::POST, "/sessions", json!({"scene": small_scene()})).await.json();
    let export = document(&begin(&service, session["id"].as_str().unwrap(), wish()).await);
    until(&service, &export.id, |export| export.state == ExportState::Done).await;
    assert_eq!(files(&service), 1);
    let service = service.restarted().await;
    let problem = service.get(&format!("/exports/{}", export.id)).await.problem(404);
    assert!(problem.detail.contains("do not survive a restart"), "{}", problem.detail);
    assert_eq!(files(&service), 0);
}
