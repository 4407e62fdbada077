//! Drawing a case and saying what came of it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use reference::statistics::{Difference, difference};
use reference::{Progress, Request};
use render::RenderError;

use super::case::{Case, Expect};
use crate::bench::drawing::{Canvas, Drawing};
use crate::bench::methods::Entry;
use crate::bench::scenes::Loaded;

/// What a slice is asked to take, and what it may take: far more than a busy software device needs to
/// compile, far less than work that is not cut into slices.
const SLICE: Duration = Duration::from_millis(50);
const LONGEST_SLICE_MILLIS: f64 = 10_000.0;
/// Longest a picture may take: paths in white matter of 1e6 are long.
const PATIENCE: Duration = Duration::from_secs(180);
/// Samples and time of a reference; the first pass is finished whatever it takes.
const REFERENCE_SAMPLES: u32 = 256;
pub const REFERENCE_TIME: Duration = Duration::from_millis(1200);
/// The time in the short form.
pub const REFERENCE_TIME_QUICK: Duration = Duration::from_millis(300);
/// Standard errors by which a picture may differ from what it should be.
const SIGMAS: f64 = 4.0;
/// A random estimate of fewer pixels is not judged: its paths are too few for a normal mean.
const FEWEST_PIXELS: usize = 16;
/// Radiance below this share of the brightest thing in sight is black.
const BLACK: f64 = 1e-12;

/// What came of a case with a method.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// Why it is wrong; `None`: as it must be.
    pub fault: Option<String>,
    /// What was refused, or what the picture is compared with.
    pub note: String,
    /// Calls that drew, and the longest, milliseconds.
    pub slices: u32,
    pub longest_slice_millis: f64,
    /// Against the closed form or the reference.
    pub error: Option<Difference>,
    /// Energy that the method says it cut or clamped, as a share.
    pub truncated: Option<f64>,
    /// Whether the device is gone: nothing more can be drawn.
    pub device_lost: bool,
}

impl Outcome {
    fn wrong(fault: impl Into<String>) -> Self {
        Self { fault: Some(fault.into()), ..Self::default() }
    }
}

/// Draws a case; a reference takes about `reference_time`.
pub fn judge(canvas: &mut Canvas, entry: &Entry, case: &Case, reference_time: Duration) -> Outcome {
    let loaded = match case.load() {
        Ok(loaded) => loaded,
        Err(error) => return Outcome::wrong(format!("no voxels: {error:#}")),
    };
    let loaded = match (loaded, case.expect) {
        (Ok(_), Expect::Refused(field)) => return Outcome::wrong(format!("`{field}` was not refused")),
        (Err(refused), Expect::Refused(field)) => {
            let right = refused.field.starts_with(field);
            let fault = (!right).then(|| format!("`{field}` should be named: {refused}"));
            return Outcome { fault, note: format!("refused: {refused}"), ..Outcome::default() };
        }
        (Err(refused), _) => return Outcome::wrong(format!("refused: {refused}")),
        (Ok(loaded), _) => loaded,
    };
    let (drawing, mut outcome) = match draw(canvas, entry, &loaded, case.image) {
        Ok(drawn) => drawn,
        Err(outcome) => return *outcome,
    };
    if outcome.fault.is_none() {
        compare(entry, case, &loaded, &drawing, reference_time, &mut outcome);
    }
    outcome
}

/// A picture, and what can be said of it alone.
///
/// # Errors
/// What came instead of a picture.
pub fn draw(
    canvas: &mut Canvas,
    entry: &Entry,
    loaded: &Loaded,
    image: [u32; 2],
) -> Result<(Drawing, Outcome), Box<Outcome>> {
    let scene = entry.usually(&loaded.file).and_then(|file| loaded.scene(&file));
    let scene = match scene {
        Ok(scene) => scene,
        Err(refused) => return Err(Box::new(Outcome::wrong(format!("refused: {refused}")))),
    };
    if let Err(refused) = render::check(&scene) {
        return Err(Box::new(Outcome { note: format!("left out: {refused}"), ..Outcome::default() }));
    }
    let drawn = catch_unwind(AssertUnwindSafe(|| canvas.draw(&scene, image, Some(SLICE), PATIENCE)));
    let drawing = match drawn {
        Err(panic) => return Err(Box::new(Outcome::wrong(format!("panic: {}", panic_text(&*panic))))),
        Ok(Err(error)) => {
            let device_lost = matches!(error, RenderError::DeviceLost(_));
            return Err(Box::new(Outcome { device_lost, ..Outcome::wrong(error.to_string()) }));
        }
        Ok(Ok(drawing)) => drawing,
    };
    let bad = |x: &f64| !x.is_finite() || *x < 0.0;
    let first_bad = drawing.radiance.iter().flatten().position(bad);
    let slow = drawing.longest_slice_millis > LONGEST_SLICE_MILLIS;
    let fault = match first_bad {
        Some(at) => {
            let count = drawing.radiance.iter().flatten().filter(|x| bad(x)).count();
            let value = drawing.radiance[at / 3][at % 3];
            Some(format!("{count} values are no radiance, the first is {value} in pixel {}", at / 3))
        }
        None => slow.then(|| format!("a slice took {:.0} ms", drawing.longest_slice_millis)),
    };
    let outcome = Outcome {
        fault,
        slices: drawing.slices,
        longest_slice_millis: drawing.longest_slice_millis,
        truncated: (entry.truncated)(&drawing.counters),
        ..Outcome::default()
    };
    Ok((drawing, outcome))
}

fn compare(
    entry: &Entry,
    case: &Case,
    loaded: &Loaded,
    drawing: &Drawing,
    reference_time: Duration,
    outcome: &mut Outcome,
) {
    let exact = vec![[0.0; 3]; drawing.radiance.len()];
    let (truth, truth_error, tolerance) = match case.expect {
        Expect::Refused(_) => return,
        Expect::Radiance(radiance, tolerance) => {
            outcome.note = format!("closed form, {:.4e}", radiance[0]);
            (vec![radiance; drawing.radiance.len()], exact.clone(), Some(tolerance))
        }
        Expect::Reference(_) | Expect::Stated(_) => {
            match reference(entry, loaded, case.image, reference_time) {
                Err(refused) => {
                    outcome.fault = Some(format!("the reference refuses it: {refused}"));
                    return;
                }
                Ok((estimate, note)) => {
                    outcome.note = note;
                    let tolerance = match case.expect {
                        Expect::Reference(tolerance) => Some(tolerance),
                        Expect::Stated(why) => {
                            outcome.note += &format!("; stated, not judged: {why}");
                            None
                        }
                        _ => None,
                    };
                    (estimate.mean, estimate.standard_error, tolerance)
                }
            }
        }
    };
    if is_black(&truth) {
        let brightest = drawing.radiance.iter().flatten().fold(0.0, |a: f64, b| a.max(*b));
        outcome.note += ", black";
        outcome.fault = (brightest > BLACK).then(|| format!("{brightest:e} where nothing shines"));
        return;
    }
    let found = difference(&drawing.radiance, &drawing.standard_error, &truth, &truth_error);
    outcome.error = Some(found);
    let Some(tolerance) = tolerance else { return };
    let tolerance = match case.expect {
        Expect::Reference(_) => entry.tolerance_in(&case.name, tolerance),
        _ => tolerance,
    };
    if entry.noisy && drawing.radiance.len() < FEWEST_PIXELS {
        outcome.note += "; stated, not judged: few paths";
        return;
    }
    // Noise of a random estimate is no fault, its mean is to be right.
    let (what, error, uncertainty) = match entry.noisy {
        true => ("bias", found.bias.abs(), found.bias_uncertainty),
        false => ("relative L2", found.relative_l2, found.uncertainty),
    };
    let room = tolerance + SIGMAS * uncertainty;
    if error.is_nan() || error > room {
        outcome.fault = Some(format!("{what} {error:.3e}, at most {room:.3e}"));
    }
}

fn is_black(picture: &[[f64; 3]]) -> bool {
    picture.iter().flatten().all(|x| *x <= BLACK)
}

type Reference = (reference::Estimate, String);

/// The reference of the method's transport, as good as it gets in about `time`.
pub fn reference(
    entry: &Entry,
    loaded: &Loaded,
    [width, height]: [u32; 2],
    time: Duration,
) -> Result<Reference, String> {
    let mut file = loaded.file.clone();
    if let Some(orders) = entry.judge.orders {
        file.scattering.orders = proto::scene_file::Orders::AtMost(orders);
    }
    let scene = loaded.scene(&file).map_err(|refused| refused.to_string())?;
    let request = Request {
        transport: entry.judge.transport,
        time: Some(time),
        ..Request::new(width, height, REFERENCE_SAMPLES)
    };
    let estimate = catch_unwind(|| reference::render(&scene, &request, &Progress::default()))
        .map_err(|panic| format!("panic: {}", panic_text(&*panic)))?
        .map_err(|refused| refused.to_string())?;
    let mut note = format!(
        "reference `{}`, {} samples, {:.1} % noise",
        entry.judge.name,
        estimate.samples,
        100.0 * estimate.relative_error
    );
    if estimate.lost > 0 {
        note += &format!(", {} rays lost", estimate.lost);
    }
    Ok((estimate, note))
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::bench::methods::LADDER;

    fn outcome(case: &Case) -> Outcome {
        let mut canvas = Canvas::open().unwrap();
        judge(&mut canvas, &LADDER[0], case, REFERENCE_TIME)
    }

    #[test]
    fn wrong_expectations_are_noticed() {
        let usual = || Case::new("test", "usual", json!({}));
        let slab = |radiance: f64| {
            Case::new("test", "slab", super::super::case::slab(1.0, 0.0, 2.0))
                .expect(Expect::Radiance([radiance; 3], 1e-3))
        };
        let right = 0.5 * (-1.0f64).exp() + 2.0 * (1.0 - (-1.0f64).exp());
        assert_eq!(outcome(&slab(right)).fault, None);
        assert!(outcome(&slab(1.01 * right)).fault.unwrap().contains("relative L2"));
        assert!(outcome(&usual().expect(Expect::Refused("lights"))).fault.unwrap().contains("not refused"));
        let elsewhere = Case::new("test", "bad", json!({"density": -1})).expect(Expect::Refused("camera"));
        assert!(outcome(&elsewhere).fault.unwrap().contains("should be named"));
        let bad = Case::new("test", "bad", json!({"density": -1}));
        assert!(outcome(&bad).fault.unwrap().contains("refused: density"));
        assert_eq!(outcome(&usual()).fault, None);
        // No error is below that, however few samples the reference has on a busy machine.
        assert!(outcome(&usual().expect(Expect::Reference(-1.0))).fault.unwrap().contains("relative L2"));
    }
}
