//! Tables on disk: CSV and JSON beside a chart.

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
    pub columns: Vec<String>,
    /// Values by row.
    pub rows: Vec<Vec<Value>>,
}

impl Table {
    /// Writes `NAME.csv` and `NAME.json`, and prints the table.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        let csv = self.csv();
        print!("{csv}");
        std::fs::write(folder.join(format!("{}.csv", self.name)), csv)?;
        let rows: Vec<Value> = self
            .rows
            .iter()
            .map(|row| self.columns.iter().zip(row).map(|(c, v)| (c.clone(), v.clone())).collect())
            .collect();
        let json = serde_json::json!({"about": self.about, "rows": rows});
        std::fs::write(folder.join(format!("{}.json", self.name)), serde_json::to_string_pretty(&json)?)?;
        Ok(())
    }

    /// RFC 4180; `null` is an empty cell.
    fn csv(&self) -> String {
        let cell = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) if text.contains([',', '"', '\n']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let line = |cells: Vec<String>| cells.join(",") + "\n";
        let rows = self.rows.iter().map(|row| line(row.iter().map(cell).collect()));
        line(self.columns.clone()) + &rows.collect::<String>()
    }

    /// A table in Markdown of some of the columns.
    pub fn markdown(&self, columns: &[&str]) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut text = line(columns.iter().map(|c| (*c).to_owned()).collect());
        text += &line(columns.iter().map(|_| "---".to_owned()).collect());
        let at: Vec<usize> =
            columns.iter().filter_map(|name| self.columns.iter().position(|column| column == name)).collect();
        for row in &self.rows {
            let cell = |&index: &usize| match &row[index] {
                Value::Null => String::new(),
                Value::String(text) => text.replace('|', "\\|"),
                other => other.to_string(),
            };
            text += &line(at.iter().map(cell).collect());
        }
        text
    }
}

/// Column names.
pub fn columns(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

/// Four digits that count; `null` for what is not finite.
pub fn rounded(value: f64) -> Value {
    if !value.is_finite() {
        return Value::Null;
    }
    // Through text: the shortest decimal of four digits is the number meant.
    format!("{value:.3e}").parse().map_or(Value::Null, |value: f64| serde_json::json!(value))
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

/// A named curve.
pub struct Line {
    pub label: String,
    /// Positive on both axes.
    pub points: Vec<(f64, f64)>,
}

/// Curves over two logarithmic axes, as SVG.
pub fn line_chart(path: &Path, title: &str, x: &str, y: &str, lines: &[Line]) -> anyhow::Result<()> {
    const SIZE: (u32, u32) = (960, 640);
    let points = || lines.iter().flat_map(|line| &line.points).filter(|point| point.0 > 0.0 && point.1 > 0.0);
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::MAX, f64::MIN_POSITIVE), |(a, b), v| (a.min(v), b.max(v)));
        (low.min(high) * 0.8, high * 1.25)
    };
    let (left, right) = range(&mut points().map(|point| point.0));
    let (bottom, top) = range(&mut points().map(|point| point.1));
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .build_cartesian_2d((left..right).log_scale(), (bottom..top).log_scale())?;
    chart.configure_mesh().x_desc(x).y_desc(y).draw()?;
    for (index, line) in lines.iter().enumerate() {
        let color = Palette99::pick(index).to_rgba();
        let points = line.points.iter().copied().filter(|point| point.1 > 0.0);
        let drawn = chart.draw_series(LineSeries::new(points, color.stroke_width(2)).point_size(3))?;
        drawn
            .label(&line.label)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}
