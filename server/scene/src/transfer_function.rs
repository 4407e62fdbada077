//! Transfer functions: from `s` in 0..1 to matter, and which bins an edit touches.

use glam::DVec3;
use proto::scene_file::SceneFile;

use crate::bins::{BIN_COUNT, Bins};
use crate::material::Material;

/// Bins are widened by this share of the data's range (of the window, where that is smaller)
/// when the transfer function is looked at: hardware filtering and f32 arithmetic move a value by
/// far less, so that no sample is ever skipped, or kept, wrongly.
const BIN_SLACK: f64 = 1.0 / 65536.0;

/// Pieces narrower than this in `s` are jumps to what reads them in single precision.
const JUMP: f64 = 1e-5;

/// Matter at one control point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Position, 0..1.
    pub s: f64,
    /// Extinction per world unit, density included.
    pub sigma_t: f64,
    /// Linear RGB, 0..1.
    pub albedo: DVec3,
    /// Emitted radiance, linear RGB.
    pub emission: DVec3,
    /// Index into the scene's materials; valid up to the next point.
    pub material: usize,
}

/// Piecewise linear in `s`, constant beyond the ends; of two points at one `s` the later holds.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    /// At least one, `s` ascending.
    pub points: Vec<Point>,
}

impl TransferFunction {
    /// Resolves opacity, density and material names. Material 0 is isotropic scattering; the
    /// others stand in the order of `materials`.
    pub fn from_file(file: &SceneFile) -> (Self, Vec<Material>) {
        let mut materials = vec![Material::default()];
        let mut names = Vec::new();
        for (name, material) in &file.materials {
            names.push(name.as_str());
            materials.push(Material::from_file(material));
        }
        let material = |name: &Option<String>| {
            name.as_deref().and_then(|name| names.iter().position(|&n| n == name)).map_or(0, |i| i + 1)
        };
        let points = file.transfer_function.points.iter().map(|point| Point {
            s: point.s,
            sigma_t: point.sigma_t() * file.density,
            albedo: DVec3::from_array(point.albedo),
            emission: DVec3::from_array(point.emission),
            material: material(&point.material),
        });
        (Self { points: points.collect() }, materials)
    }

    /// Matter just above `s` (the value at `s` itself).
    pub fn at(&self, s: f64) -> Point {
        self.between(self.points.partition_point(|point| point.s <= s), s)
    }

    /// Integral of extinction over `s`, from one value to a larger one.
    pub fn integral(&self, from: f64, to: f64) -> f64 {
        let inside = self.points.iter().map(|point| point.s).filter(|&s| from < s && s < to);
        let mut low = from;
        inside
            .chain([to])
            .map(|high| {
                let mean = 0.5 * (self.at(low).sigma_t + self.below(high).sigma_t);
                mean * (high - std::mem::replace(&mut low, high))
            })
            .sum()
    }

    /// Matter just below `s`.
    fn below(&self, s: f64) -> Point {
        self.between(self.points.partition_point(|point| point.s < s), s)
    }

    /// Matter at `s` on the piece before point `next`.
    fn between(&self, next: usize, s: f64) -> Point {
        let before = self.points[next.saturating_sub(1)];
        if next == 0 || next == self.points.len() {
            return Point { s, ..before };
        }
        let after = self.points[next];
        let t = (s - before.s) / (after.s - before.s);
        Point {
            s,
            sigma_t: before.sigma_t + t * (after.sigma_t - before.sigma_t),
            albedo: before.albedo.lerp(after.albedo, t),
            emission: before.emission.lerp(after.emission, t),
            material: before.material,
        }
    }

    /// Largest extinction in the closed interval, limits from both sides of its ends included.
    pub fn largest_sigma_t(&self, low: f64, high: f64) -> f64 {
        let inside = self.points.iter().filter(|p| (low..=high).contains(&p.s));
        [self.at(low), self.at(high)].iter().chain(inside).fold(0.0, |largest, p| p.sigma_t.max(largest))
    }
}

/// A transfer function with what it refers to: what `s` means, and what material indices mean.
#[derive(Clone, Copy)]
pub struct Classification<'a> {
    /// The function.
    pub function: &'a TransferFunction,
    /// Its materials.
    pub materials: &'a [Material],
    /// Data values at `s` = 0 and 1.
    pub value_range: [f64; 2],
}

impl Classification<'_> {
    /// `s` of a data value, not clamped (the function is constant beyond the ends).
    fn s(&self, value: f64) -> f64 {
        let [low, high] = self.value_range;
        if high > low { (value - low) / (high - low) } else { 0.0 }
    }

    /// Bins in which matter can occur.
    pub fn bins_with_matter(&self, bins: &Bins) -> u64 {
        self.mask(bins, |low, high| {
            let [low, high] = clamped([self.s(low), self.s(high)]);
            self.function.largest_sigma_t(low, high) > 0.0
        })
    }

    /// Largest extinction that values of each bin can have, per world unit.
    pub fn largest_sigma_t(&self, bins: &Bins) -> [f64; BIN_COUNT] {
        let slack = self.slack(bins);
        std::array::from_fn(|bin| {
            let [low, high] = bins.interval(bin);
            let [low, high] = clamped([self.s(low - slack), self.s(high + slack)]);
            self.function.largest_sigma_t(low, high)
        })
    }

    /// How fast extinction changes with the data value at most in each bin, per world unit and data value;
    /// infinite where it jumps.
    pub fn steepest_sigma_t(&self, bins: &Bins) -> [f64; BIN_COUNT] {
        let slack = self.slack(bins);
        let window = self.value_range[1] - self.value_range[0];
        std::array::from_fn(|bin| {
            let [low, high] = bins.interval(bin);
            let [low, high] = [self.s(low - slack), self.s(high + slack)];
            let pieces = self.function.points.windows(2);
            let inside = pieces.filter(|piece| piece[1].s > low && piece[0].s < high || window <= 0.0);
            let slope = |piece: &[Point]| {
                let (width, change) = (piece[1].s - piece[0].s, (piece[1].sigma_t - piece[0].sigma_t).abs());
                match change > 0.0 {
                    true if width < JUMP || window <= 0.0 => f64::INFINITY,
                    true => change / (width * window),
                    false => 0.0,
                }
            };
            inside.map(slope).fold(0.0, f64::max)
        })
    }

    /// Of each bin the smallest and largest data value at which there is matter; `None`: there is none.
    /// As for all that bins decide, they are a little wider than they are.
    pub fn matter_in_bins(&self, bins: &Bins) -> [Option<[f64; 2]>; BIN_COUNT] {
        let slack = self.slack(bins);
        let [window_low, window_high] = self.value_range;
        let data_value = |s: f64| window_low + s * (window_high - window_low);
        std::array::from_fn(|bin| {
            let [low, high] = bins.interval(bin);
            let [low, high] = [low - slack, high + slack];
            let [s_low, s_high] = clamped([self.s(low), self.s(high)]);
            if self.function.largest_sigma_t(s_low, s_high) <= 0.0 {
                return None;
            }
            let mut cuts = vec![s_low, s_high];
            let inside = self.function.points.iter().filter(|p| (s_low..=s_high).contains(&p.s));
            cuts.extend(inside.map(|p| p.s));
            cuts.sort_by(f64::total_cmp);
            // Ends of pieces with matter, places where it stands alone included.
            let in_matter = |a: f64, b: f64| self.function.largest_sigma_t(a, b) > 0.0;
            let found = cuts.windows(2).filter(|piece| in_matter(piece[0], piece[1]));
            let (first, last) =
                found.fold((s_high, s_low), |(first, last), piece| (piece[0].min(first), piece[1].max(last)));
            // Beyond the window's ends the function is constant.
            let first = if first <= s_low || window_high <= window_low { low } else { data_value(first) };
            let last = if last >= s_high || window_high <= window_low { high } else { data_value(last) };
            Some([first, last])
        })
    }

    /// Bins that may hold a data value, once it has been interpolated and rounded.
    pub fn bins_near(&self, value: f64, bins: &Bins) -> u64 {
        self.mask(bins, |low, high| (low..=high).contains(&value))
    }

    /// Extinction at a data value, per world unit.
    pub fn sigma_t_at(&self, value: f64) -> f64 {
        self.function.at(self.s(value).clamp(0.0, 1.0)).sigma_t
    }

    /// Albedo and material at a data value.
    pub(crate) fn surface_at(&self, value: f64) -> (DVec3, &Material) {
        let point = self.function.at(self.s(value).clamp(0.0, 1.0));
        (point.albedo, &self.materials[point.material])
    }

    /// Bins in which any property of matter differs from `other`'s.
    pub fn changed_bins(&self, other: &Classification<'_>, bins: &Bins) -> u64 {
        self.mask(bins, |low, high| differs(self, other, low, high))
    }

    /// By how much bins are widened, in data values.
    fn slack(&self, bins: &Bins) -> f64 {
        let data_range = bins.edges[BIN_COUNT] - bins.edges[0];
        let window = self.value_range[1] - self.value_range[0];
        BIN_SLACK * if window > 0.0 { data_range.max(window) } else { data_range }
    }

    fn mask(&self, bins: &Bins, holds: impl Fn(f64, f64) -> bool) -> u64 {
        let slack = self.slack(bins);
        (0..BIN_COUNT)
            .filter(|&bin| {
                let [low, high] = bins.interval(bin);
                (low < high || bin == BIN_COUNT - 1) && holds(low - slack, high + slack)
            })
            .fold(0, |mask, bin| mask | 1 << bin)
    }
}

fn clamped(interval: [f64; 2]) -> [f64; 2] {
    interval.map(|s| s.clamp(0.0, 1.0))
}

/// Whether two classifications differ anywhere in an interval of data values.
///
/// Both are linear between their breakpoints, so they are equal on a piece exactly when they are
/// equal at its two ends, seen from inside.
fn differs(a: &Classification<'_>, b: &Classification<'_>, low: f64, high: f64) -> bool {
    let data_value =
        |c: &Classification<'_>, s: f64| c.value_range[0] + s * (c.value_range[1] - c.value_range[0]);
    let breakpoints = |c: &Classification<'_>| {
        let ends = [0.0, 1.0].map(|s| data_value(c, s));
        c.function.points.iter().map(|p| data_value(c, p.s)).chain(ends).collect::<Vec<_>>()
    };
    let mut cuts: Vec<f64> =
        breakpoints(a).into_iter().chain(breakpoints(b)).filter(|v| (low..high).contains(v)).collect();
    cuts.extend([low, high]);
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    let same = |x: Point, y: Point| x.albedo == y.albedo && x.emission == y.emission;
    cuts.windows(2).any(|piece| {
        // The matter at both ends of the piece, in both classifications. A breakpoint belongs to
        // the piece that starts there, so its `s` is taken from the table, not recomputed.
        let ends = |c: &Classification<'_>| {
            let [window_low, window_high] = c.value_range;
            if piece[1] <= window_low || window_high <= window_low {
                return [c.function.at(0.0); 2];
            }
            if piece[0] >= window_high {
                return [c.function.at(1.0); 2];
            }
            let exact = |value: f64| {
                let points = c.function.points.iter();
                let s = points.map(|p| p.s).chain([0.0, 1.0]).find(|&s| data_value(c, s) == value);
                s.unwrap_or_else(|| c.s(value))
            };
            [c.function.at(exact(piece[0])), c.function.below(exact(piece[1]))]
        };
        let ([a0, a1], [b0, b1]) = (ends(a), ends(b));
        if a0.sigma_t != b0.sigma_t || a1.sigma_t != b1.sigma_t {
            return true;
        }
        let empty = a0.sigma_t == 0.0 && a1.sigma_t == 0.0;
        let materials_differ = || a.materials[a0.material] != b.materials[b0.material];
        !empty && (!same(a0, b0) || !same(a1, b1) || materials_differ())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Volume, Voxels};

    fn point(s: f64, sigma_t: f64) -> Point {
        Point { s, sigma_t, albedo: DVec3::ONE, emission: DVec3::ZERO, material: 0 }
    }

    fn bins() -> Bins {
        let values: Vec<f32> = (0..6400).map(|i| i as f32 / 6399.0).collect();
        Bins::of(&Volume::new([6400, 1, 1], Voxels::F32(values)), [0.0, 1.0])
    }

    fn classify<'a>(function: &'a TransferFunction, materials: &'a [Material]) -> Classification<'a> {
        Classification { function, materials, value_range: [0.0, 1.0] }
    }

    #[test]
    fn interpolates_steps_and_holds_beyond_the_ends() {
        let tf = TransferFunction {
            points: vec![point(0.2, 1.0), point(0.4, 3.0), point(0.4, 10.0), point(0.6, 0.0)],
        };
        let sigma = |s: f64| tf.at(s).sigma_t;
        assert_eq!(sigma(0.0), 1.0);
        assert!((sigma(0.3) - 2.0).abs() < 1e-12);
        assert_eq!(sigma(0.4), 10.0, "the later of two points holds at and above");
        assert!((tf.below(0.4).sigma_t - 3.0).abs() < 1e-12);
        assert!((sigma(0.5) - 5.0).abs() < 1e-9);
        assert_eq!(sigma(1.0), 0.0);
    }

    #[test]
    fn matter_bins_are_exactly_those_with_extinction() {
        let tf = TransferFunction {
            points: vec![point(0.0, 0.0), point(0.5, 0.0), point(0.5, 9.0), point(0.75, 0.0)],
        };
        let materials = [Material::default()];
        let bins = bins();
        let mask = classify(&tf, &materials).bins_with_matter(&bins);
        for bin in 0..BIN_COUNT {
            let [low, high] = bins.interval(bin);
            assert_eq!(
                mask >> bin & 1 == 1,
                high > 0.5 - 2e-5 && low < 0.75 + 2e-5,
                "bin {bin} {low}..{high}"
            );
        }
    }

    #[test]
    fn an_edit_touches_only_its_bins() {
        let materials = [Material::default()];
        let before = TransferFunction { points: vec![point(0.0, 0.0), point(0.5, 2.0), point(1.0, 2.0)] };
        let mut after = before.clone();
        after.points.insert(2, point(0.75, 5.0));
        let bins = bins();
        let mask = classify(&before, &materials).changed_bins(&classify(&after, &materials), &bins);
        assert_eq!(mask, bins.mask_of_interval(0.5 - 2e-5, 1.0), "{mask:064b}");
        let same = classify(&before, &materials).changed_bins(&classify(&before, &materials), &bins);
        assert_eq!(same, 0);
    }

    #[test]
    fn colour_of_nothing_is_no_change() {
        let materials = [Material::default()];
        let before = TransferFunction { points: vec![point(0.0, 0.0), point(0.5, 0.0), point(1.0, 2.0)] };
        let mut after = before.clone();
        after.points[0].albedo = DVec3::ZERO;
        let bins = bins();
        let changed = |a: &TransferFunction, b: &TransferFunction| {
            classify(a, &materials).changed_bins(&classify(b, &materials), &bins)
        };
        assert_eq!(changed(&before, &after), 0, "no matter below 0.5");
        after.points[1].albedo = DVec3::ZERO;
        assert_ne!(changed(&before, &after), 0, "the ramp above 0.5 starts from the new colour");
    }

    #[test]
    fn a_window_edit_is_an_edit_like_any_other() {
        let tf = TransferFunction { points: vec![point(0.0, 0.0), point(1.0, 2.0)] };
        let materials = [Material::default()];
        let a = classify(&tf, &materials);
        let b = Classification { value_range: [0.0, 0.5], ..a };
        let mask = a.changed_bins(&b, &bins());
        assert_eq!(mask, u64::MAX, "a linear ramp changes everywhere above 0: {mask:064b}");
    }

    #[test]
    fn a_renamed_material_is_no_change_a_different_one_is() {
        let rough = Material { surface: 0.5, ..Material::default() };
        let tf = |material| TransferFunction {
            points: vec![Point { material, ..point(0.0, 1.0) }, point(1.0, 1.0)],
        };
        let (one, two) = (tf(1), tf(2));
        let bins = bins();
        let a = [Material::default(), rough.clone()];
        let b = [Material::default(), Material::default(), rough];
        assert_eq!(classify(&one, &a).changed_bins(&classify(&two, &b), &bins), 0);
        assert_ne!(classify(&one, &a).changed_bins(&classify(&one, &b), &bins), 0);
    }
}
