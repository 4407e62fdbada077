//! `accuracy.html`: pictures, differences, plots and tables in one file that needs nothing else.

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine as _;
use image::{ExtendedColorType, ImageEncoder};
use serde_json::Value;

use super::{Errors, Measured, MethodOnScene, Point, plot};
use crate::bench::display::{bytes, displayed, luminance};
use crate::bench::flip::flip;
use crate::bench::references::Truth;

/// Luminance difference shown in full colour, over the root mean square luminance of the reference.
const FULL_COLOUR: f64 = 1.0;

const STYLE: &str = "body{font:15px/1.45 sans-serif;max-width:1120px;margin:2em auto;padding:0 1em;color:#222}
h2{margin-top:2.2em;border-top:1px solid #ccc;padding-top:.6em}
figure{display:inline-block;margin:0 10px 10px 0;vertical-align:top;width:200px}
figure img{width:200px;height:200px;image-rendering:pixelated;background:#000}
figcaption{font-size:12.5px;color:#444}
table{border-collapse:collapse;font-size:13px;margin:.6em 0}td,th{border:1px solid #ddd;padding:2px 7px;text-align:right}
td:nth-child(-n+2),th:nth-child(-n+2){text-align:left}tr.front td:nth-child(2){color:#b8391b;font-weight:600}
svg{max-width:100%;height:auto}";

/// Writes the page.
pub fn write(measured: &[Measured], about: &Value, out: &Path) -> anyhow::Result<()> {
    let mut html = String::new();
    writeln!(
        html,
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Tyndall: run time against error</title><style>{STYLE}</style>"
    )?;
    introduction(&mut html, about)?;
    for scene in measured {
        section(&mut html, scene)?;
    }
    html += "</html>\n";
    Ok(std::fs::write(out.join("accuracy.html"), html)?)
}

fn introduction(html: &mut String, about: &Value) -> anyhow::Result<()> {
    let device = &about["device"];
    let text = |value: &Value| escaped(value.as_str().unwrap_or_default());
    let software = if device["software"] == true { " (a software device: no GPU)" } else { "" };
    writeln!(
        html,
        "<h1>Run time against error</h1>
<p>Device: <b>{}</b>, {}{software}. Size <b>{}</b>: {} voxels and {} pixels along each axis. Time is {}.</p>
<p>Each method is drawn at every setting of its ladder and compared with two references of the path tracer on the processor: \
<b>full transport</b>, everything the scene asks for, and <b>the same transport</b>, what the method claims to draw. \
The first says how far it is from the truth, the second how well it does what it does. \
Errors are relative L2 of linear radiance with the reference's noise taken out, &plusmn; its standard error; bias of the mean (negative: too dark); \
95th percentile over pixels, and FLIP of the displayed pictures (0 equal, 1 largest), each with its <i>floor</i>: what a picture without error would get because the reference has noise. \
In the plots against full transport rings mark the Pareto front: nothing measured is both quicker and nearer to full transport; open dots are errors that are not told from 0.</p>
<p>Difference pictures: blue is too dark, red too bright, full colour at {:.0} % of the reference's root mean square luminance. FLIP: black none, white 1.</p>",
        text(&device["name"]),
        text(&device["driver"]),
        text(&about["size"]),
        about["volume"][0],
        about["image"][0],
        text(&about["clock"]),
        100.0 * FULL_COLOUR,
    )?;
    Ok(())
}

fn section(html: &mut String, scene: &Measured) -> anyhow::Result<()> {
    writeln!(html, "<h2 id=\"{0}\">{0}</h2><p>{1}.</p>", scene.standard.name, escaped(scene.standard.about))?;
    let film = &scene.loaded.file.film;
    let width = scene.full.made.width();
    let shown = |radiance: &[[f64; 3]]| png(&bytes(&displayed(radiance, film)), width);
    figure(html, &shown(&scene.full.mean)?, &format!("reference, full transport: {}", quality(&scene.full)))?;
    for method in &scene.methods {
        let name = method.entry.method.name();
        let points = match &method.points {
            Ok(points) => points,
            Err(refused) => {
                writeln!(html, "<p>{name} is left out: {}</p>", escaped(&refused.to_string()))?;
                continue;
            }
        };
        let Some(best) = points.last() else { continue };
        let picture = &best.drawing.radiance;
        writeln!(html, "<br>")?;
        figure(html, &shown(picture)?, &format!("{name}, {}", best.setting.label))?;
        let against = |truth: &Truth| png(&signed_difference(picture, &truth.mean), width);
        figure(html, &against(&scene.full)?, &caption("minus full transport", &best.full))?;
        let (a, b) = (displayed(&scene.full.mean, film), displayed(picture, film));
        let map = flip(&a, &b, width as usize);
        let grey: Vec<[f64; 3]> = map.iter().map(|&x| [x; 3]).collect();
        figure(
            html,
            &png(&bytes(&grey), width)?,
            &format!("FLIP to full transport, mean {:.3}", best.full.flip),
        )?;
        if let Some(same) = &method.same {
            let judge = method.entry.judge.name;
            figure(html, &shown(&same.mean)?, &format!("reference, transport “{judge}”: {}", quality(same)))?;
            figure(html, &against(same)?, &caption(&format!("minus transport “{judge}”"), &best.same))?;
        }
    }
    if !scene.has_points() {
        return Ok(());
    }
    writeln!(html, "<br>{}", plot::svg(scene)?)?;
    table(html, &scene.methods)
}

fn quality(truth: &Truth) -> String {
    let made = &truth.made;
    let mut text =
        format!("{} samples per pixel, {:.2} % standard error", made.samples, 100.0 * made.relative_error);
    if made.lost > 0 {
        let _ = write!(text, ", {} rays given up", made.lost);
    }
    if made.cut > 0.0 {
        let _ = write!(text, ", {:.1e} of the light cut", made.cut);
    }
    text
}

fn caption(what: &str, errors: &Errors) -> String {
    let linear = &errors.linear;
    format!(
        "{what}: {:.2} ± {:.2} %, bias {:+.2} %",
        100.0 * linear.relative_l2,
        100.0 * linear.uncertainty,
        100.0 * linear.bias
    )
}

fn table(html: &mut String, methods: &[MethodOnScene]) -> anyhow::Result<()> {
    writeln!(html, "<table><tr><th>method<th>setting<th>ms<th>work")?;
    for judge in ["same", "full"] {
        writeln!(html, "<th>L2 {judge}, %<th>bias, %<th>95th, %<th>floor<th>FLIP<th>floor")?;
    }
    for method in methods {
        for point in method.points.iter().flatten() {
            row(html, method.entry.method.name(), point)?;
        }
    }
    html.push_str("</table>\n");
    Ok(())
}

fn row(html: &mut String, method: &str, point: &Point) -> anyhow::Result<()> {
    let front = if point.pareto { " class=\"front\"" } else { "" };
    // The counter that is largest says most; what was saved, or could have been done, is no work.
    let done = |name: &str| !["skipped", "reused", "on_lattice"].iter().any(|saved| name.contains(saved));
    let work = point.drawing.counters.iter().filter(|(name, _)| done(name));
    let work = work
        .max_by_key(|(_, count)| **count)
        .map(|(name, count)| format!("{:.2} M {}", *count as f64 / 1e6, name.replace('_', " ")));
    writeln!(
        html,
        "<tr{front}><td>{method}<td>{}<td>{:.1}<td>{}",
        point.setting.label,
        point.drawing.millis,
        work.unwrap_or_default()
    )?;
    for errors in [&point.same, &point.full] {
        let linear = &errors.linear;
        writeln!(
            html,
            "<td>{:.2} ± {:.2}<td>{:+.2} ± {:.2}<td>{:.1}<td>{:.1}<td>{:.3}<td>{:.3}",
            100.0 * linear.relative_l2,
            100.0 * linear.uncertainty,
            100.0 * linear.bias,
            100.0 * linear.bias_uncertainty,
            100.0 * linear.percentile_95,
            100.0 * errors.percentile_95_floor,
            errors.flip,
            errors.flip_floor
        )?;
    }
    Ok(())
}

/// Luminance of `picture - reference`: blue below, red above, black equal.
fn signed_difference(picture: &[[f64; 3]], reference: &[[f64; 3]]) -> Vec<u8> {
    let squares: f64 = reference.iter().map(|&pixel| luminance(pixel).powi(2)).sum();
    let scale = FULL_COLOUR * (squares / reference.len() as f64).sqrt().max(f64::MIN_POSITIVE);
    let color = |(&a, &b): (&[f64; 3], &[f64; 3])| {
        let x = (luminance(a) - luminance(b)) / scale;
        let (over, more) = (x.abs().min(1.0), (x.abs() - 1.0).clamp(0.0, 1.0));
        if x > 0.0 {
            [over, 0.35 * over * over + 0.65 * more, more]
        } else {
            [more, 0.45 * over * over + 0.55 * more, over]
        }
    };
    let colors: Vec<[f64; 3]> = picture.iter().zip(reference).map(color).collect();
    bytes(&colors)
}

fn figure(html: &mut String, png: &[u8], caption: &str) -> anyhow::Result<()> {
    let data = base64::engine::general_purpose::STANDARD.encode(png);
    let caption = escaped(caption);
    writeln!(
        html,
        "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
    )?;
    Ok(())
}

fn png(rgb: &[u8], width: u32) -> anyhow::Result<Vec<u8>> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    encoder.write_image(rgb, width, rgb.len() as u32 / 3 / width, ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
