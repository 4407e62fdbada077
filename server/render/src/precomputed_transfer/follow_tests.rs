//! Bakes that follow edits of matter against bakes from the beginning.

use std::sync::Arc;
use std::time::Duration;

use scene::Snapshot;
use serde_json::{Value, json};

use super::buffers::batch_of;
use super::passes::Sources;
use super::tests::{TARGET, snapshot};
use super::{Pipelines, store::BakeStore};
use crate::test_support::{Folder, balls, renderer};
use crate::{DrawRequest, Drawn, Renderer, View};

fn draw(renderer: &mut Renderer, view: &mut View, snapshot: &Arc<Snapshot>) -> Drawn {
    let drawn = renderer.draw(view, &DrawRequest { snapshot, target: TARGET, budget: None }).unwrap();
    assert!(drawn.complete && drawn.illumination == 1.0);
    drawn
}

/// Rows, direct light, what beams lost, and sums of photons; and the picture.
fn result(renderer: &mut Renderer, view: &View) -> (Vec<Vec<u8>>, Vec<f32>) {
    let gpu = renderer.gpu().clone();
    let light = view.light.lock();
    let bake = light.precomputed_transfer().unwrap().bake().unwrap();
    let contents = bake.held.as_ref().map_or(Vec::new(), |held| {
        let read = |buffer: &wgpu::Buffer| gpu.read_buffer(buffer, buffer.size()).unwrap();
        let buffers = [&held.direct, &held.fallen, &held.low_words, &held.high_words].map(read);
        [vec![bytemuck::cast_slice(&held.texels).to_vec()], buffers.to_vec()].concat()
    });
    drop(light);
    (contents, renderer.radiance(view).unwrap().rgb)
}

/// Whether a view holds what one would that had never seen another scene; else what differs.
fn equal(renderer: &mut Renderer, view: &View, snapshot: &Arc<Snapshot>) -> Result<(), String> {
    let (contents, picture) = result(renderer, view);
    let mut fresh = View::new();
    draw(renderer, &mut fresh, snapshot);
    let (expected, expected_picture) = result(renderer, &fresh);
    let names = ["rows", "direct light", "what beams lost", "low words", "high words"];
    assert_eq!(contents.len(), expected.len());
    for (name, (found, expected)) in names.iter().zip(contents.iter().zip(&expected)) {
        if found != expected {
            return Err((*name).into());
        }
    }
    let differs = |(a, b): (&f32, &f32)| a.to_bits() != b.to_bits();
    match picture.iter().zip(&expected_picture).position(differs) {
        Some(value) => Err(format!("value {value} of the picture")),
        None => Ok(()),
    }
}

/// Points of matter of the balls' three values, and of the ramps around them.
fn matter(extinctions: [f64; 4], red: f64) -> Value {
    let [thin, first, second, third] = extinctions;
    let point = |s: f64, extinction: f64, albedo: [f64; 3]| json!({"s": s, "extinction": extinction, "albedo": albedo});
    json!({"transfer_function": {"points": [
        point(0.1, 0.0, [0.9, 0.9, 0.9]), point(0.2, thin, [0.9, 0.9, 0.9]),
        point(0.37, first, [red, 0.5, 0.3]), point(0.5, second, [0.4, 0.9, 0.5]),
        point(0.7, second, [0.4, 0.9, 0.5]), point(0.85, third, [0.6, 0.6, 0.95]),
        point(1.0, third, [0.6, 0.6, 0.95])]}})
}

fn few() -> Value {
    json!({"illumination": {"transfer_photons": 8192, "transfer_grid": 12, "transfer_bands": 2},
        "value_range": [0, 230]})
}

const USUAL: [f64; 4] = [4.0, 12.0, 20.0, 40.0];

fn edits() -> Vec<(&'static str, Value)> {
    let clip = |low: f64, high: f64| json!({"clip": {"box": [[0, low, 0], [1, high, 1]]}});
    vec![
        ("colour of one ball", matter(USUAL, 0.2)),
        ("another ball denser", matter([4.0, 12.0, 20.0, 90.0], 0.2)),
        ("opaque", matter([4.0, 12.0, 20.0, 4000.0], 0.2)),
        ("gone", matter([4.0, 12.0, 20.0, 0.0], 0.2)),
        ("thin matter gone, too", matter([0.0, 0.0, 20.0, 0.0], 0.2)),
        ("one back", matter([0.0, 0.0, 20.0, 30.0], 0.9)),
        ("all back", matter(USUAL, 0.9)),
        ("clip box", clip(0.0, 0.55)),
        ("another clip box", clip(0.1, 0.55)),
        ("clipped matter casts no shadows", json!({"clip": {"shadows": false}})),
        ("a clip plane, too", json!({"clip": {"planes": [{"normal": [1, 0.3, 0], "offset": -0.1}]}})),
        ("window", json!({"value_range": [0, 200]})),
        ("nothing is clipped", json!({"clip": {"planes": [], "box": [[0, 0, 0], [1, 1, 1]]}})),
        (
            "a surface",
            json!({"materials": {"shiny": {"surface": 0.8, "brdf": {"type": "lambert", "diffuse": 0.8}}},
            "transfer_function": {"points": [{"s": 0.1, "extinction": 0},
                {"s": 0.3, "extinction": 20, "albedo": [0.4, 0.9, 0.5], "material": "shiny"}]}}),
        ),
    ]
}

/// Whatever can be followed is.
const ALWAYS: f64 = 1.0;

/// Edits one after the other; an error names the first after which something is not that of a bake from the
/// beginning. How many photons were kept in all.
fn follow(renderer: &mut Renderer, edits: &[(&str, Value)], most_stale: f64) -> Result<u64, String> {
    let usual = std::mem::replace(&mut renderer.transfer_pipelines.most_stale, most_stale);
    let found = follow_on(renderer, edits);
    renderer.transfer_pipelines.most_stale = usual;
    found
}

fn follow_on(renderer: &mut Renderer, edits: &[(&str, Value)]) -> Result<u64, String> {
    let volume = balls(16);
    let mut patches = vec![few(), matter(USUAL, 0.9)];
    let mut view = View::new();
    draw(renderer, &mut view, &snapshot(&volume, &patches, 0, 1));
    let mut all_kept = 0;
    for (epoch, (name, edit)) in edits.iter().enumerate() {
        patches.push(edit.clone());
        let snapshot = snapshot(&volume, &patches, 0, epoch as u32 + 2);
        let drawn = draw(renderer, &mut view, &snapshot);
        let count = |what: &str| drawn.counters.get(what).copied().unwrap_or(0);
        let (again, kept) = (count("transfer_photons_retraced"), count("transfer_photons_kept"));
        eprintln!("{name}: {again} photons again, {kept} kept, {} rays", count("transfer_rays_marched"));
        all_kept += kept;
        equal(renderer, &view, &snapshot).map_err(|what| format!("{name}: {what}"))?;
    }
    Ok(all_kept)
}

#[test]
fn edits_leave_what_a_new_bake_would_be() {
    let mut renderer = renderer();
    let usual = renderer.transfer_pipelines.most_stale;
    let [few, most] = [usual, ALWAYS].map(|share| follow(&mut renderer, &edits(), share).unwrap());
    assert!(few > 2 * 8192 && most > few + 8192, "{few} {most}");
}

#[test]
fn so_do_edits_by_chance() {
    let mut state = 77_u32;
    let mut chance = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    let mut now = (USUAL, 0.9);
    let edits: Vec<(&str, Value)> = (0..10)
        .map(|_| {
            let which = (5.0 * chance()) as usize;
            match which {
                4 => now.1 = chance(),
                _ => now.0[which] = if chance() < 0.3 { 0.0 } else { 100.0 * chance() * chance() },
            }
            ("by chance", matter(now.0, now.1))
        })
        .collect();
    follow(&mut renderer(), &edits, ALWAYS).unwrap();
}

/// Without any one of its remedies the bake is wrong after some edit, and the comparison finds it.
#[test]
fn every_remedy_is_needed() {
    type Pick = fn(&mut Sources) -> &mut std::borrow::Cow<'static, str>;
    let carry: Pick = |sources| &mut sources.carry;
    let enter: Pick = |sources| &mut sources.enter;
    let march: Pick = |sources| &mut sources.march;
    let move_rows: Pick = |sources| &mut sources.move_rows;
    let mutants = [
        (
            "bins that photons met",
            carry,
            "histories[path.light] = vec4u(bins_met, blocks); }",
            "histories[path.light] = vec4u(vec2u(0u), blocks); }",
        ),
        ("blocks", carry, "blocks |= blocks_on_way", "_ = blocks_on_way"),
        (
            "taking out what was there",
            carry,
            "select(0, transfer.sign, counts)",
            "select(0, max(transfer.sign, 0), counts)",
        ),
        (
            "leaving what comes before a change",
            enter,
            "if is_listed && transfer.sign > 0 { path.density = paths[local].density; }",
            "",
        ),
        ("rows that move", move_rows, "let old_row = old_row_of[row];", "let old_row = row;"),
        ("taking out what beams lost", march, "~amount + 1u", "0u"),
        (
            "beams that met a change",
            march,
            "(way.ray, way.from_t, to_t) < to_t",
            "(way.ray, way.from_t, to_t) > to_t",
        ),
        (
            "what comes before a change",
            march,
            "is_listed)) - margin;",
            "is_listed)) + (1.0 + f32(transfer.sign));",
        ),
    ];
    let gpu = renderer().gpu().clone();
    for (what, pick, original, broken) in mutants {
        let mut sources = Sources::default();
        let source = pick(&mut sources);
        assert!(source.contains(original), "{what}: the shader has not `{original}`");
        *source = source.replacen(original, broken, 1).into();
        let mut renderer = renderer();
        let whole =
            std::mem::replace(&mut renderer.transfer_pipelines, Pipelines::of_sources(gpu.clone(), sources));
        let found = follow(&mut renderer, &edits(), ALWAYS);
        renderer.transfer_pipelines = whole;
        eprintln!("without {what}: {found:?}");
        assert!(found.is_err(), "without {what} nothing is wrong");
    }
}

/// Edits that come while the one before is followed.
#[test]
fn interrupted_updates_leave_nothing_behind() {
    let mut renderer = renderer();
    let volume = balls(16);
    let photons = 2 * batch_of(renderer.gpu()) + 5000;
    let mut patches = vec![few(), matter(USUAL, 0.9), json!({"illumination": {"transfer_photons": photons}})];
    let mut view = View::new();
    let usual = std::mem::replace(&mut renderer.transfer_pipelines.most_stale, ALWAYS);
    draw(&mut renderer, &mut view, &snapshot(&volume, &patches, 0, 1));
    let (mut unfinished, mut old) = (0, 0);
    for (epoch, (_, edit)) in edits().into_iter().take(9).enumerate() {
        patches.push(edit);
        let snapshot = snapshot(&volume, &patches, 0, epoch as u32 + 2);
        for _ in 0..epoch % 4 {
            let budget = Some(Duration::from_micros(1));
            let drawn = renderer
                .draw(&mut view, &DrawRequest { snapshot: &snapshot, target: TARGET, budget })
                .unwrap();
            unfinished += usize::from(!drawn.complete);
            old += usize::from(drawn.illumination_epoch < snapshot.epoch);
        }
        if epoch % 4 == 3 {
            draw(&mut renderer, &mut view, &snapshot);
            equal(&mut renderer, &view, &snapshot).unwrap();
        }
    }
    renderer.transfer_pipelines.most_stale = usual;
    assert!(unfinished > 5 && old > 3, "{unfinished} were interrupted, {old} showed old light");
}

/// What followed from another bake is stored as its own, and followed from when it was loaded.
#[test]
fn followed_bakes_are_stored_and_stored_ones_followed() {
    let folder = Folder::new();
    let volume = balls(16);
    let of = |patch: Value, epoch: u32| snapshot(&volume, &[few(), matter(USUAL, 0.9), patch], 0, epoch);
    let (a, b, c) =
        (of(json!({}), 1), of(matter(USUAL, 0.2), 2), of(matter([4.0, 12.0, 20.0, 60.0], 0.2), 3));
    let alone = renderer();
    let keeper = |gpu| {
        let mut renderer = Renderer::new(gpu).unwrap();
        let store = BakeStore::with_checkpoints(folder.path(), 1 << 30, Duration::ZERO).unwrap();
        renderer.keep_bakes(Some(Arc::new(store)));
        renderer.transfer_pipelines.most_stale = ALWAYS;
        renderer
    };
    let work = |drawn: &Drawn| {
        ["bakes_loaded", "bakes_stored", "transfer_photons_traced"].map(|name| drawn.counters[name])
    };
    let mut first = keeper(alone.gpu().clone());
    let mut view = View::new();
    draw(&mut first, &mut view, &a);
    let followed = draw(&mut first, &mut view, &b);
    assert!(followed.counters["transfer_photons_kept"] > 0 && followed.counters["bakes_stored"] == 1);
    let expected = result(&mut first, &view);
    // Back again: the file is there.
    assert_eq!(work(&draw(&mut first, &mut view, &of(json!({}), 4)))[0], 1);
    drop((view, first));
    let mut second = keeper(alone.gpu().clone());
    let mut view = View::new();
    assert_eq!(work(&draw(&mut second, &mut view, &b)), [1, 0, 0]);
    assert!(result(&mut second, &view) == expected);
    let followed = draw(&mut second, &mut view, &c);
    assert!(followed.counters["transfer_photons_kept"] > 0, "{:?}", followed.counters);
    second.keep_bakes(None);
    equal(&mut second, &view, &c).unwrap();
}

/// Of an edit of colour beams know nothing, and photons that did not meet it.
#[test]
fn an_edit_of_colour_marches_no_beam() {
    let mut renderer = renderer();
    let volume = balls(16);
    let mut view = View::new();
    let usual = std::mem::replace(&mut renderer.transfer_pipelines.most_stale, ALWAYS);
    let before = snapshot(&volume, &[few(), matter(USUAL, 0.9)], 0, 1);
    draw(&mut renderer, &mut view, &before);
    let shares = renderer.stale_shares(&view).unwrap().unwrap();
    let after = snapshot(&volume, &[few(), matter(USUAL, 0.3)], 0, 2);
    let drawn = draw(&mut renderer, &mut view, &after);
    renderer.transfer_pipelines.most_stale = usual;
    let count = |name: &str| drawn.counters[name];
    let (again, kept) = (count("transfer_photons_retraced"), count("transfer_photons_kept"));
    assert_eq!((count("transfer_rays_marched"), again + kept), (0, 8192));
    assert!(again > 0 && kept > 0 && count("transfer_photons_traced") == again);
    // What edits of single bins are told to cost fits what the edit of several did.
    let changed = scene::Changes::between(&before.scene, &after.scene).bins;
    let of_changed = (0..64).filter(|bin| changed >> bin & 1 == 1).map(|bin| shares.of_bins[bin]);
    let (most, sum) = of_changed.fold((0.0_f32, 0.0), |(most, sum), one| (most.max(one), sum + one));
    let share = again as f32 / 8192.0;
    assert!(shares.counted == 8192 && most <= share + 1e-6 && share <= sum + 1e-6, "{most} {share} {sum}");
}
