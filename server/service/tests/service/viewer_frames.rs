//! Viewers: which frames come, and which do not.

use std::time::{Duration, Instant};

use proto::control::{ClientMessage, ServerMessage};
use proto::frame::{FLAG_MOVING, FrameFormat};
use proto::scene_file::Camera;
use serde_json::json;

use crate::support::{Event, Service, camera_at};

#[tokio::test]
async fn the_picture_at_rest_is_final_lossless_and_equals_the_still() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 96, 64).await;
    let frames = viewer.frames_until_final().await;
    assert!(frames[0].header.flags & FLAG_MOVING != 0, "the first picture comes at once, reduced or not");
    let numbers: Vec<u32> = frames.iter().map(|frame| frame.header.frame).collect();
    assert_eq!(numbers, (1..=frames.len() as u32).collect::<Vec<_>>());
    let last = &frames.last().unwrap().header;
    assert_eq!(last.format, FrameFormat::WebpLossless as u8);
    assert_eq!((last.width, last.height, last.viewport_width, last.viewport_height), (96, 64, 96, 64));
    assert_eq!((last.samples_per_pixel, last.seq, last.snapshot_epoch, last.quality), (4, 1, 1, 0));
    let still = service.get(&format!("/sessions/{}/snapshot?width=96&height=64", session.id)).await.ok();
    let still = image::load_from_memory(&still.body).unwrap().to_rgb8();
    let shown = frames.last().unwrap().pixels();
    assert!(still.pixels().any(|pixel| pixel.0 != still.get_pixel(0, 0).0), "not one colour");
    assert_eq!(shown, still);
    assert_ne!(frames[0].pixels(), still, "the comparison can fail");
}

#[tokio::test]
async fn every_frame_is_followed_by_its_report() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    let (mut expected, mut reports, mut last) = (None, 0, false);
    while !last || expected.is_some() {
        match viewer.event().await {
            Event::Frame(frame) => {
                assert_eq!(expected, None, "a frame before the report of the one before");
                expected = Some(frame.header.frame);
                last = frame.is_final();
            }
            Event::Message(ServerMessage::Report { frame, report }) => {
                assert_eq!(expected.take(), Some(frame));
                assert!(report.plan.iter().any(|pass| pass.pass == "ray_cast"));
                assert!(report.counters.contains_key("samples_taken"), "{report:?}");
                reports += 1;
            }
            Event::Message(_) => {}
            Event::Closed(code) => panic!("closed with {code}"),
        }
    }
    assert!(reports >= 2);
}

#[tokio::test]
async fn a_burst_of_200_cameras_shows_the_newest() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 96, 64).await;
    viewer.frames_until_final().await;
    for seq in 2..=201 {
        viewer.camera(seq, camera_at(f64::from(seq))).await;
    }
    let frames = viewer.frames_until_final().await;
    assert!(frames.len() <= 20, "{} frames for one burst", frames.len());
    let seqs: Vec<u32> = frames.iter().map(|frame| frame.header.seq).collect();
    assert!(seqs.is_sorted(), "never an older state: {seqs:?}");
    assert_eq!(*seqs.last().unwrap(), 201);
    assert!(seqs.iter().filter(|&&seq| seq < 201).count() <= 10, "{seqs:?}");
    let still = service.get(&format!("/sessions/{}/snapshot?width=96&height=64", session.id)).await.ok();
    let still = image::load_from_memory(&still.body).unwrap().to_rgb8();
    assert_eq!(frames.last().unwrap().pixels(), still, "the session's camera is the newest, too");
    let scene = service.get(&format!("/sessions/{}", session.id)).await.ok().json();
    assert_eq!(scene["epoch"], 1, "cameras do not count as edits");
    let stored: Camera = serde_json::from_value(scene["scene"]["camera"].clone()).unwrap();
    assert_eq!(stored, camera_at(201.0));
}

#[tokio::test]
async fn a_steady_drag_shows_progress() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 320, 240).await;
    viewer.frames_until_final().await;
    let (mut seq, mut frames) = (1, 0);
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(3) {
        seq += 1;
        viewer.camera(seq, camera_at(f64::from(seq) * 2.0)).await;
        if let Some(Event::Frame(frame)) = viewer.event_within(Duration::from_millis(16)).await {
            assert!(frame.header.flags & FLAG_MOVING != 0, "no refinement while it moves");
            frames += 1;
        }
    }
    assert!(frames >= 4, "{frames} frames in three seconds");
    assert_eq!(viewer.frames_until_final().await.last().unwrap().header.seq, seq);
}

#[tokio::test]
async fn at_most_two_frames_are_in_flight() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.acknowledges = false;
    viewer.viewport(1, 64, 48).await;
    let mut newest = 0;
    for seq in 2..80 {
        viewer.camera(seq, camera_at(f64::from(seq))).await;
        // Acknowledging what was never sent opens nothing.
        viewer.acknowledge(1000 + seq).await;
        if let Some(Event::Frame(frame)) = viewer.event_within(Duration::from_millis(20)).await {
            newest = frame.header.frame;
        }
    }
    while let Some(event) = viewer.event_within(Duration::from_millis(300)).await {
        if let Event::Frame(frame) = event {
            newest = frame.header.frame;
        }
    }
    assert_eq!(newest, 2);
    // An acknowledgement lets the newest state through.
    viewer.acknowledge(2).await;
    viewer.acknowledges = true;
    let frames = viewer.frames_until_final().await;
    assert!(frames.iter().all(|frame| frame.header.seq == 79), "never an older state");
}

#[tokio::test]
async fn hidden_viewers_get_no_frames() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    viewer.frames_until_final().await;
    viewer.send(&ClientMessage::Visible { visible: false }).await;
    viewer.camera(2, camera_at(90.0)).await;
    let end = Instant::now() + Duration::from_millis(700);
    while let Some(event) = viewer.event_within(end.saturating_duration_since(Instant::now())).await {
        assert!(!matches!(event, Event::Frame(_)), "a hidden viewer got a frame");
    }
    viewer.send(&ClientMessage::Visible { visible: true }).await;
    assert_eq!(viewer.frames_until_final().await.last().unwrap().header.seq, 2);
}

#[tokio::test]
async fn at_rest_nothing_is_sent() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    viewer.frames_until_final().await;
    // The report of the final frame.
    viewer.message_of(|message| matches!(message, ServerMessage::Report { .. }).then_some(())).await;
    let event = viewer.event_within(Duration::from_secs(1)).await;
    assert!(event.is_none(), "{event:?}");
}

#[tokio::test]
async fn an_edit_that_cannot_be_seen_sends_a_report_and_no_frame() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    let last = viewer.frames_until_final().await.last().unwrap().header.frame;
    viewer.message_of(|message| matches!(message, ServerMessage::Report { .. }).then_some(())).await;
    viewer.patch(2, json!({"scattering": {"orders": 1}, "clip": {"shadows": false}})).await;
    let (mut scene, mut report) = (false, false);
    while let Some(event) = viewer.event_within(Duration::from_millis(800)).await {
        match event {
            Event::Frame(_) => panic!("a frame for nothing"),
            Event::Message(ServerMessage::Scene { epoch, seq, .. }) => {
                assert_eq!((epoch, seq), (2, 2));
                scene = true;
            }
            Event::Message(ServerMessage::Report { frame, report: told }) => {
                assert_eq!(frame, last);
                assert!(told.plan.iter().all(|pass| !pass.runs), "{told:?}");
                report = true;
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(scene && report);
}

#[tokio::test]
async fn tone_mapping_alone_casts_no_ray() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    let before = viewer.frames_until_final().await.last().unwrap().clone();
    viewer.message_of(|message| matches!(message, ServerMessage::Report { .. }).then_some(())).await;
    viewer.patch(2, json!({"film": {"exposure_stops": 2}})).await;
    let mut after = None;
    let mut reports = 0;
    while after.is_none() || reports < 2 {
        match viewer.event().await {
            Event::Frame(frame) if frame.is_final() => after = Some(frame),
            Event::Frame(frame) => {
                assert_eq!((frame.header.width, frame.header.height), (64, 48), "the film was there");
            }
            Event::Message(ServerMessage::Report { report, .. }) => {
                let cast = report.plan.iter().find(|pass| pass.pass == "ray_cast").unwrap();
                assert!(!cast.runs, "{}", cast.reason);
                reports += 1;
            }
            _ => {}
        }
    }
    assert_ne!(after.unwrap().pixels(), before.pixels());
}

#[tokio::test]
async fn a_light_in_layers_is_recoloured_at_full_size_without_a_path() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    viewer.frames_until_final().await;
    let lights = |power: f64| {
        json!([{"id": "sun", "type": "directional", "direction": [-0.3, -1, -0.4],
            "irradiance": [power, power, power]}])
    };
    let layered = json!({"method": "path_traced", "paths_per_pixel": 2, "light_layers": true});
    viewer.patch(2, json!({"illumination": layered, "lights": lights(1.0)})).await;
    let before = loop {
        let frame = viewer.frames_until_final().await.pop().unwrap();
        if frame.header.seq == 2 {
            break frame;
        }
    };
    viewer.message_of(|message| matches!(message, ServerMessage::Report { .. }).then_some(())).await;
    viewer.patch(3, json!({"lights": lights(4.0)})).await;
    let (mut after, mut mixes) = (None, 0);
    while after.is_none() || mixes == 0 {
        match viewer.event().await {
            Event::Frame(frame) => {
                assert_eq!((frame.header.width, frame.header.height), (64, 48), "the layers were there");
                after = frame.is_final().then_some(frame).or(after);
            }
            Event::Message(ServerMessage::Report { report, .. }) if report.changes.len() == 1 => {
                let mixed = report.plan.iter().find(|pass| pass.pass == "mix_lights").unwrap();
                assert_eq!(mixed.reason, "mixed anew: light `sun` recoloured");
                assert_eq!(report.counters["paths"], 0);
                mixes += 1;
            }
            _ => {}
        }
    }
    assert_ne!(after.unwrap().pixels(), before.pixels());
}

#[tokio::test]
async fn another_size_is_another_picture() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let mut viewer = listening.viewer(&session.id).await;
    viewer.viewport(1, 64, 48).await;
    viewer.frames_until_final().await;
    viewer.send(&ClientMessage::Viewport { seq: 2, width: 40, height: 60, pixel_ratio: 1.5 }).await;
    let frames = viewer.frames_until_final().await;
    for frame in &frames {
        assert_eq!((frame.header.viewport_width, frame.header.viewport_height), (60, 90));
    }
    let last = frames.last().unwrap();
    assert_eq!((last.pixels().width(), last.pixels().height(), last.header.seq), (60, 90, 2));
    viewer.send(&ClientMessage::Viewport { seq: 3, width: 0, height: 60, pixel_ratio: 1.0 }).await;
    let rejected = viewer.message_of(|message| match message {
        ServerMessage::Rejected { seq, field, .. } => Some((seq, field)),
        _ => None,
    });
    assert_eq!(rejected.await, (3, "width".to_owned()));
}
