//! Tables on disk: CSV and JSON beside a bar chart.

use std::path::Path;

use plotters::prelude::*;
use serde_json::Value;

/// Rows of one suite. Every row has the same columns.
pub struct Table {
    /// File name without extension.
    pub name: &'static str,
    /// What was measured where, for the head of the JSON.
    pub about: Value,
    /// Column names with units.
    pub columns: Vec<&'static str>,
    /// Values by row.
    pub rows: Vec<Vec<Value>>,
}

impl Table {
    /// Writes `NAME.csv` and `NAME.json`, and prints the table.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        let plain = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let line = |cells: Vec<String>| cells.join(",");
        let mut csv = line(self.columns.iter().map(|c| (*c).to_owned()).collect()) + "\n";
        for row in &self.rows {
            csv += &(line(row.iter().map(plain).collect()) + "\n");
        }
        print!("{csv}");
        std::fs::write(folder.join(format!("{}.csv", self.name)), csv)?;
        let rows: Vec<Value> = self
            .rows
            .iter()
            .map(|row| self.columns.iter().zip(row).map(|(c, v)| ((*c).to_owned(), v.clone())).collect())
            .collect();
        let json = serde_json::json!({"about": self.about, "rows": rows});
        std::fs::write(folder.join(format!("{}.json", self.name)), serde_json::to_string_pretty(&json)?)?;
        Ok(())
    }
}

/// One horizontal bar a label, as SVG.
pub fn bar_chart(path: &Path, title: &str, bars: &[(String, f64)]) -> anyhow::Result<()> {
    const WIDTH: u32 = 720;
    const BAR: u32 = 26;
    const LABEL: u32 = 190;
    const MARGIN: u32 = 40;
    let longest = bars.iter().map(|bar| bar.1).fold(f64::MIN_POSITIVE, f64::max);
    let root = SVGBackend::new(path, (WIDTH, MARGIN + BAR * bars.len() as u32 + 10)).into_drawing_area();
    root.fill(&WHITE)?;
    root.draw(&Text::new(title.to_owned(), (10, 10), ("sans-serif", 16)))?;
    for (index, (label, value)) in bars.iter().enumerate() {
        let top = (MARGIN + BAR * index as u32) as i32;
        let length = (value / longest * f64::from(WIDTH - LABEL - 90)) as i32;
        let left = LABEL as i32;
        let area = [(left, top + 4), (left + length, top + BAR as i32 - 4)];
        root.draw(&Rectangle::new(area, RGBColor(70, 110, 170).filled()))?;
        root.draw(&Text::new(label.clone(), (10, top + 5), ("sans-serif", 13)))?;
        root.draw(&Text::new(format!("{value:.2}"), (left + length + 6, top + 5), ("sans-serif", 13)))?;
    }
    root.present()?;
    Ok(())
}
