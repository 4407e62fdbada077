//! Tests of what becomes of the light that photons carry.

use std::f64::consts::PI;
use std::sync::Arc;

use serde_json::{Value, json};

use super::PhotonPipelines;
use super::tests::{draw, snapshot};
use crate::test_support::{balls, renderer};
use crate::{Renderer, View, shaders};

/// Most interactions of a photon.
const SLOTS: usize = 16;
const PHOTONS: usize = 4096;

type Rgb = [f64; 3];

/// What a photon has been through.
struct Way {
    /// Throughput at each interaction.
    at: Vec<Rgb>,
    /// That with which it left the volume; 0: it did not.
    left_with: Rgb,
}

/// Follows the photons of a light through matter that only scatters and absorbs.
fn ways(renderer: &mut Renderer, light: &Value, extinction: f64, albedo: Rgb) -> Vec<Way> {
    let volume = balls(24);
    let matter = json!({"materials": {"m": {"phase": {"type": "henyey_greenstein", "g": 0.5}}},
        "lights": [light],
        "illumination": {"photons": PHOTONS, "photon_events": SLOTS, "photon_grid": 8, "direct_grid": 4},
        "transfer_function": {"points": [
            {"s": 0.1, "extinction": 0, "albedo": albedo, "material": "m"},
            {"s": 0.4, "extinction": extinction, "albedo": albedo, "material": "m"}]}});
    let mut view = View::new();
    draw(renderer, &mut view, &snapshot(&volume, &[matter], 1));
    let buffers = view.light.lock().photon_map().unwrap().contents(renderer.gpu()).unwrap();
    let [_, ends, _, ways, histories] = &buffers["lamp"][..] else { panic!("one chunk") };
    let word = |bytes: &[u8], index: usize| f32::from_le_bytes(bytes[4 * index..][..4].try_into().unwrap());
    let number = |bytes: &[u8], index: usize| f64::from(word(bytes, index));
    let of_photon = |photon: usize| {
        let count = word(ends, 8 * photon + 4).to_bits() as usize;
        let slots = photon * SLOTS..photon * SLOTS + count;
        let carried = |slot: usize| {
            [number(ways, 4 * slot + 3), number(histories, 8 * slot + 4), number(histories, 8 * slot + 5)]
        };
        let left_with = [5, 6, 7].map(|i| number(ends, 8 * photon + i));
        Way { at: slots.map(carried).collect(), left_with }
    };
    (0..PHOTONS).map(of_photon).collect()
}

/// Where light went, one channel, and how far chance may have it (a standard error).
#[derive(Default)]
struct Balance {
    emitted: f64,
    escaped: f64,
    absorbed: f64,
    cut: f64,
    variance: f64,
}

impl Balance {
    fn of(emitted: &[Rgb], ways: &[Way], albedo: Rgb, channel: usize) -> Self {
        let mut balance = Self::default();
        for (emitted, way) in emitted.iter().zip(ways) {
            balance.emitted += emitted[channel];
            balance.escaped += way.left_with[channel];
            for (place, carried) in way.at.iter().enumerate() {
                if place + 1 == SLOTS {
                    balance.cut += carried[channel];
                    continue;
                }
                let brightest = |rgb: Rgb| rgb.into_iter().fold(0.0, f64::max);
                let on = [0, 1, 2].map(|c| carried[c] * albedo[c]);
                let survival = brightest(on) / brightest(*carried);
                balance.absorbed += carried[channel] - on[channel];
                // It goes on with on / survival, or not at all.
                balance.variance += on[channel].powi(2) * (1.0 / survival - 1.0);
            }
        }
        balance
    }

    fn lost(&self) -> f64 {
        self.emitted - self.escaped - self.absorbed - self.cut
    }

    /// Whether what is lost can be chance, or rounding where there is none.
    fn holds(&self) -> bool {
        self.lost().abs() <= 3.0 * self.variance.sqrt() + 2e-5 * self.emitted
    }
}

fn lights() -> Vec<(&'static str, Value, Option<f64>)> {
    // Of a cube of edge 1: its shadows, over the cross-section of the sphere around it.
    let cross_section = PI * (0.5 * 3.0_f64.sqrt() * 1.001).powi(2);
    let shadow = (0.6 + 0.64 + 0.48) / cross_section;
    vec![
        ("directional", json!({"direction": [-0.6, -0.64, -0.48], "irradiance": [3, 3, 3]}), Some(shadow)),
        // A convex body's mean shadow is a quarter of its surface.
        ("environment", json!({"radiance": [1, 0.6, 0.3]}), Some(1.5 / cross_section)),
        ("point", json!({"position": [1.2, 0.9, 0.7], "intensity": [5, 5, 5]}), Some(1.0)),
        ("point", json!({"position": [0.02, 0.01, 0.45], "intensity": [0.2, 0.2, 0.2]}), Some(1.0)),
        (
            "rectangle",
            json!({"center": [0.3, 0.2, 1.4], "normal": [-0.2, -0.1, -1], "up": [0, 1, 0],
            "size": [0.8, 0.5], "radiance": [6, 6, 6]}),
            None,
        ),
    ]
}

fn light(kind: &str, mut file: Value) -> Value {
    json_patch::merge(&mut file, &json!({"id": "lamp", "type": kind}));
    file
}

/// What lights emit through matter that is not there: it leaves as it was emitted, in the mean what the
/// light sends towards the volume where that is known in closed form.
fn emitted(renderer: &mut Renderer, light: &Value, mean: Option<f64>) -> Vec<Rgb> {
    let ways = ways(renderer, light, 0.0, [1.0; 3]);
    assert!(ways.iter().all(|way| way.at.is_empty()));
    let emitted: Vec<Rgb> = ways.iter().map(|way| way.left_with).collect();
    let (count, sum) = (emitted.len() as f64, emitted.iter().map(|rgb| rgb[0]).sum::<f64>());
    let squares: f64 = emitted.iter().map(|rgb| (rgb[0] - sum / count).powi(2)).sum();
    if let Some(mean) = mean {
        let error = (sum / count - mean).abs();
        assert!(error <= 3.0 * squares.sqrt() / count + 1e-4 * mean, "{} for {mean}: {light}", sum / count);
    }
    emitted
}

/// Whatever the light: what photons carry when they set out is what leaves, is absorbed, or is cut after
/// the last interaction; to the digit where nothing is left to chance, and within three standard errors
/// where roulette ends photons.
#[test]
fn what_is_emitted_escapes_or_is_absorbed_or_cut() {
    let mut renderer = renderer();
    for (kind, file, mean) in lights() {
        let light = light(kind, file);
        let emitted = emitted(&mut renderer, &light, mean);
        for albedo in [[1.0; 3], [0.9, 0.6, 0.3], [0.5; 3]] {
            let ways = ways(&mut renderer, &light, 30.0, albedo);
            let met = ways.iter().filter(|way| !way.at.is_empty()).count();
            assert!(met > PHOTONS / 20, "{met} photons meet matter: {light}");
            // They set out as they would through empty space.
            let set_out = |(way, emitted): (&Way, &Rgb)| way.at.first().is_none_or(|first| first == emitted);
            assert!(ways.iter().zip(&emitted).all(set_out));
            for channel in 0..3 {
                let balance = Balance::of(&emitted, &ways, albedo, channel);
                let Balance { emitted, escaped, absorbed, cut, .. } = balance;
                let (lost, sigma) = (balance.lost(), balance.variance.sqrt());
                if channel == 0 || albedo[0] != albedo[1] {
                    eprintln!(
                        "{kind} albedo {}: emitted {emitted:.2} = escaped {escaped:.2} + absorbed {absorbed:.2} \
                         + cut {cut:.2} + {lost:.3} (sigma {sigma:.3})",
                        albedo[channel]
                    );
                }
                assert!(balance.holds(), "{lost} lost, sigma {sigma}: {light}");
                assert!(escaped > 0.0 && (absorbed > 0.0) == (albedo[channel] < 1.0), "{light}");
            }
        }
    }
}

/// Light that is weighed wrongly where it scatters is noticed.
#[test]
fn light_that_is_lost_or_gained_is_noticed() {
    let light = light("point", lights()[2].1.clone());
    let mut renderer = renderer();
    let gpu = renderer.gpu().clone();
    let emitted = emitted(&mut renderer, &light, Some(1.0));
    for (what, original, broken, albedo) in [
        (
            "a gain of 2 %",
            "scattered_light(at, way) / density;",
            "1.02 * scattered_light(at, way) / density;",
            [1.0; 3],
        ),
        ("roulette without its weight", "= scattered_on / survival;", "= scattered_on;", [0.9, 0.6, 0.3]),
    ] {
        assert!(shaders::TRACE_PHOTONS.contains(original), "{what}");
        let mutant = shaders::TRACE_PHOTONS.replacen(original, broken, 1);
        let pipelines = PhotonPipelines::of_sources(gpu.clone(), mutant.into(), shaders::TAKE_UP.into());
        let whole = std::mem::replace(&mut renderer.photon_pipelines, Arc::new(pipelines));
        let ways = ways(&mut renderer, &light, 30.0, albedo);
        renderer.photon_pipelines = whole;
        let balance = Balance::of(&emitted, &ways, albedo, 0);
        eprintln!("{what}: {} lost, sigma {}", balance.lost(), balance.variance.sqrt());
        assert!(!balance.holds(), "{what}: not noticed");
    }
}
