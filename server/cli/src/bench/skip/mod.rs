//! Suite `skip`: for each kind of "not needed" the work with and without it, and that the picture is
//! the same.

mod empty_space;
mod kinds;
mod watching;

use std::path::Path;

use anyhow::bail;
use proto::scene_file::Builtin;
use serde_json::{Value, json};

use super::drawing::Canvas;
use super::methods::LADDER;
use super::report::{Table, columns, rounded};

/// Voxels and pixels along each axis, and in the short form.
const VOXELS: usize = 96;
const PIXELS: u32 = 256;
const VOXELS_QUICK: usize = 32;
const PIXELS_QUICK: u32 = 32;
/// Standard errors by which means of random estimates may differ.
const SIGMAS: f64 = 4.0;

/// How alike two pictures have to be.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Same {
    /// Bit for bit.
    Bits,
    /// Every channel, up to a share of the largest.
    Within(f64),
    /// In the mean: both are random estimates.
    OnAverage,
}

/// One kind of work that nothing needs; first where it is done, then where it is left out.
struct Row {
    kind: &'static str,
    how: &'static str,
    /// What is counted.
    unit: &'static str,
    work: [u64; 2],
    millis: [f64; 2],
    /// Largest difference of the pictures, over the largest channel.
    difference: f64,
    same: Same,
    /// Mean of the second picture over that of the first.
    mean_ratio: f64,
    /// Standard error of `mean_ratio`; 0 where the pictures are no random estimates.
    mean_uncertainty: f64,
}

impl Row {
    fn is_same(&self) -> bool {
        match self.same {
            Same::Bits => self.difference == 0.0,
            Same::Within(tolerance) => self.difference <= tolerance,
            Same::OnAverage => (self.mean_ratio - 1.0).abs() <= SIGMAS * self.mean_uncertainty,
        }
    }

    /// Leaving out never adds work.
    fn is_cheaper(&self) -> bool {
        self.work[1] <= self.work[0]
    }

    fn cells(&self, method: &str) -> Vec<Value> {
        let same = match self.same {
            Same::Bits => "bit for bit".to_owned(),
            Same::Within(tolerance) => format!("within {tolerance:e}"),
            Same::OnAverage => "on average".to_owned(),
        };
        vec![
            json!(method),
            json!(self.kind),
            json!(self.how),
            json!(self.unit),
            json!(self.work[0]),
            json!(self.work[1]),
            rounded(self.millis[0]),
            rounded(self.millis[1]),
            json!(same),
            rounded(self.difference),
            json!(self.is_same() && self.is_cheaper()),
        ]
    }
}

/// Measures empty space on `scenes` (not in the short form), and every kind with every method.
///
/// # Errors
/// A picture that is not the same, after all tables were written.
pub fn run(scenes: &[Builtin], quick: bool, out: &Path) -> anyhow::Result<()> {
    if !quick {
        empty_space::run(scenes, out)?;
    }
    let (voxels, pixels) = if quick { (VOXELS_QUICK, PIXELS_QUICK) } else { (VOXELS, PIXELS) };
    let mut canvas = Canvas::open()?;
    let mut table = Table {
        name: "skip-kinds",
        about: json!({"device": canvas.device(), "volume": [voxels, voxels, voxels], "image": [pixels, pixels],
            "clock": "wall clock; a view of which nothing has to be drawn against an empty one"}),
        columns: columns(&[
            "method",
            "not_needed",
            "how",
            "unit",
            "work_done",
            "work_left_out",
            "millis_done",
            "millis_left_out",
            "same",
            "largest_difference",
            "right",
        ]),
        rows: Vec::new(),
    };
    let mut wrong = Vec::new();
    let mut note = |table: &mut Table, method: &str, rows: Vec<Row>| {
        for row in rows {
            if !(row.is_same() && row.is_cheaper()) {
                wrong.push(format!(
                    "{method}: {} ({}): {:?}, work {:?}",
                    row.kind, row.how, row.difference, row.work
                ));
            }
            table.rows.push(row.cells(method));
        }
    };
    for entry in LADDER {
        let rows = kinds::measure(&mut canvas, entry, voxels, pixels, quick)?;
        note(&mut table, entry.method.name(), rows);
    }
    // The service draws with a device of its own.
    drop(canvas);
    note(&mut table, "service", watching::measure()?);
    table.write(out)?;
    if wrong.is_empty() {
        return Ok(());
    }
    bail!("not as it must be:\n{}", wrong.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn different_pictures_and_more_work_are_wrong() {
        let mean_uncertainty = 0.01;
        let row = |work, difference, same, mean_ratio| {
            let row = Row {
                kind: "",
                how: "",
                unit: "",
                work,
                millis: [0.0; 2],
                difference,
                same,
                mean_ratio,
                mean_uncertainty,
            };
            row.is_same() && row.is_cheaper()
        };
        assert!(row([5, 5], 0.0, Same::Bits, 1.0));
        assert!(!row([5, 6], 0.0, Same::Bits, 1.0));
        assert!(!row([5, 5], 1e-9, Same::Bits, 1.0));
        assert!(row([5, 5], 1e-6, Same::Within(1e-5), 1.0) && !row([5, 5], 1e-4, Same::Within(1e-5), 1.0));
        assert!(row([5, 5], 0.5, Same::OnAverage, 1.01) && !row([5, 5], 0.0, Same::OnAverage, 0.9));
    }
}
