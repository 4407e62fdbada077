//! Error over time of one scene: against full transport on the left, against what each method claims
//! on the right.

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

use super::{Errors, Measured, Point};

const SIZE: (u32, u32) = (1080, 430);
/// The Pareto front's rings, and the noise of the reference.
const MARK: RGBColor = RGBColor(200, 60, 30);
const NOISE: RGBColor = RGBColor(140, 140, 140);

type Panel<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Writes `accuracy-SCENE.svg`.
pub fn write(measured: &Measured, out: &Path) -> anyhow::Result<()> {
    let svg = svg(measured)?;
    Ok(std::fs::write(out.join(format!("accuracy-{}.svg", measured.standard.name)), svg)?)
}

/// The plot as text.
pub fn svg(measured: &Measured) -> anyhow::Result<String> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (left, right) = root.split_horizontally(SIZE.0 / 2);
        let name = measured.standard.name;
        let full = measured.full.made.relative_error;
        panel(&left, measured, &format!("{name}: against full transport"), |point| &point.full, Some(full))?;
        panel(
            &right,
            measured,
            &format!("{name}: against what the method claims"),
            |point| &point.same,
            None,
        )?;
        root.present()?;
    }
    Ok(text)
}

/// Where a point stands: the error, or what it could be where it is not told from 0.
fn height(errors: &Errors) -> f64 {
    errors.linear.relative_l2.max(errors.linear.uncertainty)
}

fn told_from_0(errors: &Errors) -> bool {
    errors.linear.relative_l2 > 2.0 * errors.linear.uncertainty
}

fn panel(
    area: &Panel<'_>,
    measured: &Measured,
    title: &str,
    errors: fn(&Point) -> &Errors,
    noise: Option<f64>,
) -> anyhow::Result<()> {
    let points = || measured.methods.iter().flat_map(|method| method.points.iter().flatten());
    let place = |point: &Point| (point.drawing.millis, height(errors(point)));
    let places: Vec<(f64, f64)> = points().map(place).filter(|place| place.1 > 0.0).collect();
    if places.is_empty() {
        // Every picture is the reference to the last bit: nothing to show on a logarithmic axis.
        return Ok(());
    }
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::MAX, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
        // A decade at least, or the axis has no number on it.
        let low = low.min(0.1 * high);
        (low * 0.6)..(high * 1.8)
    };
    let across = range(&mut places.iter().map(|place| place.0));
    let up = range(&mut places.iter().map(|place| place.1).chain(noise.filter(|noise| *noise > 0.0)));
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(38)
        .y_label_area_size(66)
        .build_cartesian_2d(across.clone().log_scale(), up.log_scale())?;
    chart
        .configure_mesh()
        .x_desc("wall clock, ms")
        .y_desc("relative L2 error")
        .x_label_formatter(&|x| short(*x))
        .y_label_formatter(&|y| short(*y))
        .light_line_style(WHITE)
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    if let Some(noise) = noise.filter(|noise| *noise > 0.0) {
        let line = vec![(across.start, noise), (across.end, noise)];
        chart
            .draw_series(DashedLineSeries::new(line, 4, 4, NOISE.into()))?
            .label("noise of the reference")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], NOISE));
    }
    for (index, method) in measured.methods.iter().enumerate() {
        let Ok(points) = &method.points else { continue };
        let color = Palette99::pick(index).to_rgba();
        let line: Vec<_> = points.iter().map(place).filter(|place| place.1 > 0.0).collect();
        chart
            .draw_series(LineSeries::new(line, color.stroke_width(2)))?
            .label(method.entry.method.name())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
        for point in points {
            let (x, y) = place(point);
            if y <= 0.0 {
                continue;
            }
            let errors = errors(point);
            let fill = if told_from_0(errors) { color.filled() } else { color.stroke_width(1) };
            chart.draw_series([Circle::new((x, y), 3, fill)])?;
            let spread = errors.linear.uncertainty;
            let low = (y - spread).max(y * 0.02);
            chart.draw_series([PathElement::new([(x, low), (x, y + spread)], color.stroke_width(1))])?;
            // The front is that of full transport.
            if point.pareto && noise.is_some() {
                chart.draw_series([Circle::new((x, y), 7, MARK.stroke_width(1))])?;
            }
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font(("sans-serif", 12))
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.2))
        .draw()?;
    Ok(())
}

/// A number on an axis.
fn short(value: f64) -> String {
    let digits = if value >= 1.0 { 0 } else { (-value.log10()).ceil() as usize };
    format!("{value:.digits$}")
}
