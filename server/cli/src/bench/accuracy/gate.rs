//! What the quick form must give: work and errors of a run that was looked at. Time is no part of it.
//!
//! `--quick` writes `accuracy-expected.json`; a change for good reason is accepted by copying it over
//! the file of that name beside this one.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Measured;

/// The run that was looked at.
const ACCEPTED: &str = include_str!("accuracy-expected.json");
/// Work may exceed the accepted by this share: rays end by a threshold on sums that devices round
/// each in their way.
const WORK_TOLERANCE: f64 = 0.01;
/// Errors may exceed the accepted by this share, and by this much of the reference's brightness.
const ERROR_TOLERANCE: f64 = 0.05;
const ERROR_ROOM: f64 = 5e-4;
/// The same where a method's own noise is in the error: another device rounds, and draws other paths.
const NOISY_ERROR_TOLERANCE: f64 = 0.25;

/// One picture of the quick form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Expected {
    /// Relative L2 against the same and against full transport.
    same: f64,
    full: f64,
    /// Exact work.
    work: BTreeMap<String, u64>,
}

type Run = BTreeMap<String, Expected>;

/// Compares with the accepted run.
///
/// # Errors
/// What got worse, in words.
pub fn check(measured: &[Measured], out: &Path) -> anyhow::Result<()> {
    let mut noisy = Vec::new();
    let mut run = Run::new();
    for scene in measured {
        for method in &scene.methods {
            for point in method.points.iter().flatten() {
                let name = format!(
                    "{}: {}, {}",
                    scene.standard.name,
                    method.entry.method.name(),
                    point.setting.label
                );
                if method.entry.noisy {
                    noisy.push(name.clone());
                }
                let [same, full] = [&point.same, &point.full].map(|errors| errors.linear.relative_l2);
                run.insert(name, Expected { same, full, work: point.drawing.counters.clone() });
            }
        }
    }
    std::fs::write(out.join("accuracy-expected.json"), serde_json::to_string_pretty(&run)? + "\n")?;
    let accepted: Run = serde_json::from_str(ACCEPTED)?;
    let scenes: Vec<&str> = measured.iter().map(|scene| scene.standard.name).collect();
    let of_these = |name: &String| scenes.iter().any(|scene| name.starts_with(&format!("{scene}: ")));
    let accepted: Run = accepted.into_iter().filter(|(name, _)| of_these(name)).collect();
    let worse = worse(&run, &accepted, &noisy);
    if worse.is_empty() {
        return Ok(());
    }
    let out = out.join("accuracy-expected.json");
    anyhow::bail!("worse than the accepted run (this one is in {}):\n{}", out.display(), worse.join("\n"))
}

/// What is worse than accepted, a line each.
fn worse(run: &Run, accepted: &Run, noisy: &[String]) -> Vec<String> {
    let mut lines = Vec::new();
    for name in accepted.keys().filter(|name| !run.contains_key(*name)) {
        lines.push(format!("{name}: was not measured"));
    }
    for (name, found) in run {
        let Some(expected) = accepted.get(name) else {
            lines.push(format!("{name}: nothing is accepted for it yet"));
            continue;
        };
        let share = if noisy.contains(name) { NOISY_ERROR_TOLERANCE } else { ERROR_TOLERANCE };
        for (judge, found, expected) in
            [("same", found.same, expected.same), ("full", found.full, expected.full)]
        {
            if found.is_nan() || found > expected * (1.0 + share) + ERROR_ROOM {
                lines.push(format!("{name}: error to {judge} transport {found:.5}, accepted {expected:.5}"));
            }
        }
        for (counter, &count) in &found.work {
            let most = expected.work.get(counter).map_or(0.0, |&accepted| accepted as f64);
            if count as f64 > most * (1.0 + WORK_TOLERANCE) && is_work(counter) {
                lines.push(format!("{name}: {counter} {count}, accepted {most}"));
            }
        }
    }
    lines
}

/// Counters of what was saved are no work.
fn is_work(counter: &str) -> bool {
    !["skipped", "reused"].iter().any(|saved| counter.contains(saved))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(same: f64, taken: u64) -> Run {
        let work = [("samples_taken".to_owned(), taken), ("samples_skipped".to_owned(), 9)];
        [("pillars: local, x".to_owned(), Expected { same, full: 0.3, work: work.into() })].into()
    }

    #[test]
    fn the_accepted_run_can_be_read() {
        let accepted: Run = serde_json::from_str(ACCEPTED).unwrap();
        assert!(!accepted.is_empty());
    }

    #[test]
    fn more_work_and_more_error_are_noticed() {
        let accepted = run(0.02, 1000);
        let worse = |run: &Run| worse(run, &accepted, &[]);
        assert_eq!(worse(&accepted), [""; 0]);
        assert_eq!(worse(&run(0.0205, 1009)), [""; 0], "within tolerance");
        assert_eq!(worse(&run(0.01, 500)), [""; 0], "better");
        assert_eq!(worse(&run(0.03, 1000)).len(), 1);
        assert_eq!(worse(&run(f64::NAN, 1000)).len(), 1);
        assert_eq!(worse(&run(0.02, 1100)).len(), 1);
        assert_eq!(worse(&Run::new()).len(), 1, "not measured");
        assert_eq!(super::worse(&accepted, &Run::new(), &[]).len(), 1, "unknown");
    }
}
