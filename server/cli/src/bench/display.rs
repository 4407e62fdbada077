//! From linear radiance to displayed colours, on the processor: pictures and references of one scene
//! are shown alike. The same operators as `shaders/film/tone_map.wgsl`.

use proto::scene_file::{Film, ToneMapping};

/// Largest radiance kept.
const BRIGHTEST: f64 = 1e6;

/// Displayed sRGB colours, 0..1.
pub fn displayed(radiance: &[[f64; 3]], film: &Film) -> Vec<[f64; 3]> {
    let exposure = film.exposure_stops.exp2();
    let operator = |color: [f64; 3]| match film.tone_mapping {
        ToneMapping::Linear => color,
        ToneMapping::Reinhard => {
            let luminance = luminance(color);
            color.map(|x| x / (1.0 + luminance))
        }
        ToneMapping::Neutral => neutral(color),
    };
    let kept = |x: f64| if x.is_nan() { 0.0 } else { (exposure * x).clamp(0.0, BRIGHTEST) };
    radiance.iter().map(|pixel| operator(pixel.map(kept)).map(|x| srgb(x.clamp(0.0, 1.0)))).collect()
}

/// Of a linear colour (Rec. 709).
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Khronos PBR Neutral (2024).
fn neutral(color: [f64; 3]) -> [f64; 3] {
    const START: f64 = 0.8 - 0.04;
    const DESATURATION: f64 = 0.15;
    let darkest = color.into_iter().fold(f64::INFINITY, f64::min);
    let toe = if darkest < 0.08 { darkest - 6.25 * darkest * darkest } else { 0.04 };
    let shifted = color.map(|x| x - toe);
    let peak = shifted.into_iter().fold(f64::NEG_INFINITY, f64::max);
    if peak < START {
        return shifted;
    }
    let room = 1.0 - START;
    let compressed = 1.0 - room * room / (peak + room - START);
    let fade = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    shifted.map(|x| {
        let scaled = x * compressed / peak;
        scaled + fade * (compressed - scaled)
    })
}

/// 8-bit values of displayed colours.
pub fn bytes(displayed: &[[f64; 3]]) -> Vec<u8> {
    displayed.iter().flatten().map(|x| (255.0 * x).round().clamp(0.0, 255.0) as u8).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proto::scene_file::Builtin;
    use render::{DrawRequest, View};
    use scene::plan::Target;
    use scene::{Scene, Snapshot};

    use super::*;
    use crate::bench::drawing::Canvas;
    use crate::bench::scenes::prepared;

    /// The device's own tone mapping, for all operators, of a picture with highlights and darkness.
    #[test]
    fn agrees_with_the_shader() {
        let mut canvas = Canvas::open().unwrap();
        let volume = prepared(scene::builtin::build(Builtin::NestedShells, [16; 3], &|_| {}));
        for tone_mapping in [ToneMapping::Neutral, ToneMapping::Linear, ToneMapping::Reinhard] {
            let mut file = scene::builtin::scene(Builtin::NestedShells).unwrap();
            file.film = Film { exposure_stops: 0.8, tone_mapping };
            let scene = Scene::new(&file, volume.clone()).unwrap();
            let snapshot = Arc::new(Snapshot { epoch: 1, scene });
            let target = Target { width: 24, height: 24, samples_per_pixel: 1 };
            let mut view = View::new();
            let renderer = canvas.renderer();
            renderer.draw(&mut view, &DrawRequest { snapshot: &snapshot, target, budget: None }).unwrap();
            let picture = renderer.picture(&mut view).unwrap().rgb();
            let radiance = renderer.radiance(&view).unwrap().rgb;
            let pixels: Vec<[f64; 3]> =
                radiance.as_chunks::<3>().0.iter().map(|pixel| pixel.map(f64::from)).collect();
            let shown = bytes(&displayed(&pixels, &file.film));
            let farthest = picture.iter().zip(&shown).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(farthest <= Some(1), "{tone_mapping:?}: {farthest:?}");
            assert!(picture.iter().any(|&byte| byte > 200) && picture.iter().any(|&byte| byte < 60));
        }
    }
}
