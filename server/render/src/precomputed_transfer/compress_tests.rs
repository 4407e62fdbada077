//! Compressed bakes against those they stand for.

use std::fs::DirEntry;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use scene::{PreparedVolume, Volume, Voxels};
use serde_json::{Value, json};

use super::NEARLY_MADE;
use super::compress::{Compressing, Shape};
use super::keeping::{Handed, Handing, Matrices};
use super::store::{BakeStore, Outgoing};
use super::tests::{TARGET, draw, edited, error, image_light, image_of, radiance, snapshot};
use crate::test_support::{Folder, balls, renderer};
use crate::{DrawRequest, Renderer, View};

fn clusters(count: u32) -> Value {
    json!({"illumination": {"transfer_clusters": count}})
}

/// Of a sky with a bright patch and of a sun, less is off than the matrices are.
#[test]
fn pictures_are_nearly_those_of_the_whole_matrices() {
    let volume = balls(20);
    let sun = json!([{"type": "directional", "direction": [-1, -1, -0.5], "irradiance": [3, 3, 3]}]);
    for lights in [json!([image_light([0.0, 30.0, 0.0])]), sun] {
        let mut last = f64::MAX;
        for count in [32, 128] {
            let of = |patch: Value| snapshot(&volume, &[json!({"lights": lights}), patch], 19, 1);
            let mut view = View::new();
            let whole = draw(&mut view, &of(json!({})));
            let expected = radiance(&view);
            let drawn = draw(&mut view, &of(clusters(count)));
            let (l2, mean) = error(&radiance(&view), &expected);
            let left_out = drawn.counters["transfer_compression_error_ppm"] as f64 * 1e-6;
            println!("{count}: {l2} {mean}, matrices {left_out}");
            assert!(left_out > 1e-3 && left_out < last && l2 < left_out && mean.abs() < 0.5 * left_out);
            assert_eq!(drawn.counters["transfer_rays_marched"], 0, "the bake is there");
            assert!(drawn.gpu_bytes["light"] < whole.gpu_bytes["light"] / 2, "matrices are given back");
            last = left_out;
        }
    }
}

#[test]
fn edits_of_light_never_touch_a_compressed_bake() {
    let volume = balls(20);
    let lit = |light: Value| vec![clusters(32), json!({"lights": [light]})];
    let sun = json!({"type": "directional", "direction": [-1, -1, -0.5], "irradiance": [3, 2, 1]});
    let denser = json!({"density": 2});
    let mut counters = edited(
        &volume,
        &[
            (lit(image_light([0.0; 3])), 3),
            (lit(image_light([10.0, 40.0, -20.0])), 3),
            (lit(image_light([10.0, 40.0, -20.0])), 50),
            (lit(sun.clone()), 50),
            ([lit(sun), vec![denser]].concat(), 50),
        ],
    );
    let last = counters.pop().unwrap();
    let left_out = counters[0]["transfer_compression_error_ppm"];
    for counters in &counters[1..] {
        assert_eq!((counters["transfer_rays_marched"], counters["transfer_photons_traced"]), (0, 0));
        assert!(counters["transfer_rows_lit"] > 100);
        assert_eq!(counters["transfer_compression_error_ppm"], left_out);
    }
    assert!(last["transfer_rays_marched"] > 0, "matter is baked anew");
}

#[test]
fn slices_and_edits_meanwhile_change_no_bit() {
    let volume = balls(20);
    let of = |density: f64, epoch| snapshot(&volume, &[clusters(64), json!({"density": density})], 0, epoch);
    let mut view = View::new();
    // The second bake follows from the first.
    let mut renderer = renderer();
    let usual = std::mem::replace(&mut renderer.transfer_pipelines.most_stale, 1.0);
    for (step, scene) in [of(1.0, 1), of(2.0, 2)].iter().enumerate() {
        let budget = Some(Duration::from_millis(1));
        loop {
            let request = DrawRequest { snapshot: scene, target: TARGET, budget };
            let drawn = renderer.draw(&mut view, &request).unwrap();
            let marched = drawn.counters.get("transfer_rays_marched").is_some_and(|&count| count > 0);
            // The first is given up while it is compressed.
            if drawn.complete || step == 0 && !marched && drawn.illumination > 0.99 {
                break;
            }
        }
    }
    renderer.transfer_pipelines.most_stale = usual;
    drop(renderer);
    assert_eq!(radiance(&view), image_of(&of(2.0, 3)));
}

/// Whether it is baked or compressed is told, and there is more light as soon as it is compressed.
#[test]
fn what_is_left_of_a_made_bake_is_told() {
    let (scene, mut view, mut renderer) =
        (snapshot(&balls(20), &[clusters(64)], 0, 1), View::new(), renderer());
    let (mut slices, mut share) = ([0; 2], 0.0);
    loop {
        let request =
            DrawRequest { snapshot: &scene, target: TARGET, budget: Some(Duration::from_millis(1)) };
        let drawn = renderer.draw(&mut view, &request).unwrap();
        if drawn.illumination == 1.0 {
            break;
        }
        let is_made = drawn.counters.contains_key("transfer_made");
        assert_eq!(is_made, drawn.illumination > NEARLY_MADE, "{}", drawn.illumination);
        assert!(drawn.illumination >= share);
        share = drawn.illumination;
        slices[usize::from(is_made)] += 1;
    }
    assert!(slices[0] > 4 && slices[1] > 0, "baked and compressed in {slices:?} slices");
}

/// Bakes are given to a thread that writes them.
fn wait_for_a_file(folder: &Path) {
    let is_bake = |entry: std::io::Result<DirEntry>| entry.unwrap().path().extension().unwrap() == "bake";
    let began = Instant::now();
    while !std::fs::read_dir(folder).unwrap().any(is_bake) {
        assert!(began.elapsed() < Duration::from_secs(20), "no bake was written");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn other_clusters_come_from_the_file() {
    let (folder, volume) = (Folder::new(), balls(20));
    let expected = [32, 64, 0].map(|count| image_of(&snapshot(&volume, &[clusters(count)], 0, 1)));
    let alone = renderer();
    let mut renderer = Renderer::new(alone.gpu().clone()).unwrap();
    renderer.keep_bakes(Some(Arc::new(BakeStore::open(folder.path(), 1 << 30).unwrap())));
    let mut view = View::new();
    for (edit, count) in [32, 64, 0, 32].into_iter().enumerate() {
        let scene = snapshot(&volume, &[clusters(count)], 0, edit as u32 + 1);
        let request = DrawRequest { snapshot: &scene, target: TARGET, budget: None };
        let drawn = renderer.draw(&mut view, &request).unwrap();
        // Whole matrices are there to be compressed.
        let loaded = u64::from(edit == 1 || edit == 2);
        assert_eq!(drawn.counters["bakes_loaded"], loaded, "{edit}");
        assert_eq!(drawn.counters["transfer_rays_marched"] > 0, edit == 0);
        assert!(renderer.radiance(&view).unwrap().rgb == expected[edit % 3], "{edit}");
        wait_for_a_file(folder.path());
    }
}

#[test]
fn little_and_nothing_are_compressed_as_well() {
    let nothing = json!({"transfer_function": {"points": [{"s": 0, "extinction": 0}]}});
    let drawn = draw(&mut View::new(), &snapshot(&balls(8), &[clusters(256), nothing], 0, 1));
    assert!(!drawn.counters.contains_key("transfer_compression_error_ppm"));
    let voxel = Arc::new(PreparedVolume::new(Volume::new([1; 3], Voxels::U8(vec![255])), &|_| {}));
    let of = |count| snapshot(&voxel, &[clusters(count), json!({"value_range": [0, 255]})], 0, 1);
    let (l2, _) = error(&image_of(&of(256)), &image_of(&of(0)));
    assert!(l2 < 1e-3, "{l2}");
}

const SMALL: Shape = Shape { lights: 3, coefficients: 2, channels: 2, rows: 4, photon_factor: 10.0 };

#[test]
fn both_matrices_are_added_up_whatever_the_pieces() {
    let direct = (0..24).map(|i| (i as f32).to_bits());
    // Whole numbers of 64 bits, low words and high words; some are negative.
    let sum = |i: i64| (i << 33) * if i % 3 == 0 { -1 } else { 1 } + i;
    let words = |half: u32| (0..48).map(move |i| (sum(i) as u64 >> (32 * half)) as u32);
    let all: Vec<u32> = direct.chain(words(0)).chain(words(1)).collect();
    for piece in [4, 20, 1000] {
        let (outgoing, pieces) = Outgoing::with_room(200);
        let given = bytemuck::cast_slice::<u32, u8>(&all).chunks(piece);
        given.for_each(|piece| assert_eq!(outgoing.give(piece.to_vec()), Ok(true)));
        let matrices = SMALL.gather(&pieces).unwrap();
        for (line, row) in (0..12).flat_map(|line| (0..4).map(move |row| (line, row))) {
            let scattered = (10.0 * sum((line * 4 + row) as i64) as f64) as f32;
            let expected = ((line % 6) * 4 + row) as f32 + scattered;
            assert_eq!(matrices[(line, row)], expected);
        }
    }
    let (outgoing, pieces) = Outgoing::with_room(1);
    drop(outgoing);
    assert!(SMALL.gather(&pieces).is_none());
}

#[test]
fn a_thread_ends_with_who_asked_for_it() {
    let compressing = Compressing::new(SMALL, 32).unwrap();
    let abandoned = compressing.abandoned.clone();
    drop(compressing);
    assert!(abandoned.load(Ordering::Relaxed));
    let began = Instant::now();
    while Arc::strong_count(&abandoned) > 1 {
        assert!(began.elapsed() < Duration::from_secs(20), "its thread is still there");
        std::thread::sleep(Duration::from_millis(1));
    }
    // Who hands over is told.
    let renderer = renderer();
    let buffer = super::buffers::filled(renderer.gpu(), "matrix", &[0; 64]).unwrap();
    let (outgoing, pieces) = Outgoing::with_room(1);
    drop(pieces);
    let handed = Handing::new(outgoing).step(renderer.gpu(), &Matrices(vec![&buffer, &buffer])).unwrap();
    assert_eq!(handed, Handed::Refused);
}

#[test]
fn directions_take_no_more_room_than_rows() {
    let of = |rows: usize, wanted| Shape { rows, ..SMALL }.clusters(wanted);
    assert_eq!([of(10_000, 128), of(300, 128), of(3, 128), of(10_000, 256)], [128, 60, 1, 256]);
}
