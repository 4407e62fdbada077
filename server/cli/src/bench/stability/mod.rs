//! Suite `stability`: numbers that hurt, for every method of the ladder.

mod case;
mod data;
mod independence;
mod judge;
mod light;
mod matter;
mod random;
mod view;

use std::path::Path;
use std::time::Instant;

use anyhow::bail;
use serde_json::{Value, json};

use super::drawing::Canvas;
use super::methods::Entry;
use super::report::{Table, columns, rounded};
use case::Case;
use judge::Outcome;

/// Scenes made by chance, and in the short form.
const RANDOM_SCENES: u32 = 300;
const RANDOM_SCENES_QUICK: u32 = 24;

/// Draws every case with every method that is to be measured.
///
/// # Errors
/// Anything that is not as it must be, after the whole table was written; a lost device.
pub fn run(entries: &[&Entry], quick: bool, out: &Path) -> anyhow::Result<()> {
    let mut canvas = Canvas::open()?;
    let mut table = Table {
        name: "stability",
        about: json!({"device": canvas.device(), "quick": quick,
            "error": "relative L2 against the closed form or the reference of the method's transport, its noise taken out"}),
        columns: columns(&[
            "method",
            "group",
            "case",
            "verdict",
            "relative_l2",
            "uncertainty",
            "bias",
            "slices",
            "longest_slice_millis",
            "truncated_share",
            "compared_with",
        ]),
        rows: Vec::new(),
    };
    let cases: Vec<Case> = [matter::cases(), data::cases(), light::cases(), view::cases()]
        .into_iter()
        .flatten()
        .filter(|case| !quick || case.quick)
        .collect();
    let reference_time = if quick { judge::REFERENCE_TIME_QUICK } else { judge::REFERENCE_TIME };
    let mut faults = Vec::new();
    for &entry in entries {
        let before = table.rows.len();
        let mut lost = false;
        for case in &cases {
            let begun = Instant::now();
            let outcome = judge::judge(&mut canvas, entry, case, reference_time);
            let seconds = begun.elapsed().as_secs_f64();
            eprintln!(
                "tyndall: stability: {}: {}: {}: {seconds:.1} s",
                entry.method.name(),
                case.group,
                case.name
            );
            lost = outcome.device_lost;
            table.rows.push(row(entry, case.group, &case.name, &outcome));
            if lost {
                break;
            }
        }
        if !lost {
            table.rows.extend(independence_rows(&mut canvas, entry)?);
            let scenes = if quick { RANDOM_SCENES_QUICK } else { RANDOM_SCENES };
            table.rows.push(random_row(&mut canvas, entry, scenes));
        }
        let wrong = |row: &&Vec<Value>| row[3] != "right" && row[3] != "left out";
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let faulty = table.rows[before..].iter().filter(wrong);
        faults.extend(faulty.map(|row| [0, 1, 2, 3].map(|i| text(&row[i])).join(": ")));
        if lost {
            faults.push(format!("{}: the device was lost, the rest was not drawn", entry.method.name()));
            break;
        }
    }
    table.write(out)?;
    let shown = [
        "method",
        "group",
        "case",
        "verdict",
        "relative_l2",
        "uncertainty",
        "longest_slice_millis",
        "compared_with",
    ];
    std::fs::write(out.join("stability.md"), heading(&table, &canvas) + &table.markdown(&shown))?;
    if faults.is_empty() {
        return Ok(());
    }
    bail!("{} of {} rows are not as they must be:\n{}", faults.len(), table.rows.len(), faults.join("\n"))
}

fn heading(table: &Table, canvas: &Canvas) -> String {
    let device = canvas.device();
    let count = table.rows.len();
    format!(
        "# Stability\n\n{count} rows, drawn by `{}`, {}. What each column says is in [the README](README.md).\n\n",
        device.name, device.driver
    )
}

fn row(entry: &Entry, group: &str, name: &str, outcome: &Outcome) -> Vec<Value> {
    let verdict = match &outcome.fault {
        Some(fault) => fault.clone(),
        None if outcome.note.starts_with("left out") => "left out".into(),
        None => "right".into(),
    };
    let error = |pick: fn(&reference::statistics::Difference) -> f64| {
        outcome.error.as_ref().map_or(Value::Null, |error| rounded(pick(error)))
    };
    vec![
        json!(entry.method.name()),
        json!(group),
        json!(name),
        json!(verdict),
        error(|error| error.relative_l2),
        error(|error| error.uncertainty),
        error(|error| error.bias),
        json!(outcome.slices),
        rounded(outcome.longest_slice_millis),
        outcome.truncated.map_or(Value::Null, rounded),
        json!(outcome.note),
    ]
}

fn independence_rows(canvas: &mut Canvas, entry: &Entry) -> anyhow::Result<Vec<Vec<Value>>> {
    let pairs = independence::measure(canvas, entry)?;
    let row = |pair: &independence::Pair| {
        let fault = (!pair.is_right())
            .then(|| format!("brightness changes by {:.4}, at most {}", pair.ratio - 1.0, pair.tolerance));
        let note = format!("brightness ratio {:.5}, within {}", pair.ratio, pair.tolerance);
        let outcome = Outcome { fault, note, ..Outcome::default() };
        let mut cells = row(entry, "brightness", &pair.name, &outcome);
        cells[6] = rounded(pair.ratio - 1.0);
        cells
    };
    Ok(pairs.iter().map(row).collect())
}

fn random_row(canvas: &mut Canvas, entry: &Entry, count: u32) -> Vec<Value> {
    let many = random::many(canvas, entry, count);
    eprintln!("tyndall: stability: by chance, largest error: {}", many.worst);
    let at = |share: f64| {
        let index = (share * many.errors.len() as f64) as usize;
        many.errors.get(index.min(many.errors.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
    };
    let fault = many.failed.map(|(scene, why)| format!("{why}; smallest scene found: {scene}"));
    let note = format!(
        "relative L2 against the reference: median {:.3}, nine tenths below {:.3}, worst {:.3}; stated, not judged",
        at(0.5),
        at(0.9),
        at(1.0)
    );
    row(
        entry,
        "by chance",
        &format!("{} scenes", many.scenes),
        &Outcome { fault, note, ..Outcome::default() },
    )
}
