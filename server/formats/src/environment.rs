//! Environment images: Radiance HDR and OpenEXR, equirectangular, brought to a budget of texels.
//!
//! Shrinking is an exact average over solid angle: a texel of the result holds the radiance of
//! the sphere's patch it covers, so that the light that comes from any patch made of whole texels
//! stays what it was. Rows run from the top pole, polar angle `theta`; a row between `theta_0`
//! and `theta_1` covers a solid angle in proportion to `cos theta_0 - cos theta_1`.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers};
use image::ImageDecoder;
use image::codecs::hdr::HdrDecoder;

use crate::Limits;
use crate::error::FormatError;
use crate::stream::Stream;

/// Most texels of an environment along x and y.
pub const ENVIRONMENT_BUDGET: [usize; 2] = [2048, 1024];
/// Largest radiance of a texel; beyond it products of radiance and solid angle leave single
/// precision. Suns in the pictures at hand reach 34,000.
pub const MAX_RADIANCE: f32 = 1e9;
/// What an OpenEXR file starts with.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Radiance from all directions, linear RGB.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    /// Texels around the horizon.
    pub width: usize,
    /// Texels from the top pole to the bottom one.
    pub height: usize,
    /// Red, green and blue of each texel, rows from the top; finite, from 0 to [`MAX_RADIANCE`].
    pub rgb: Vec<f32>,
    /// What was changed, one sentence each, for the user to see.
    pub notices: Vec<String>,
}

/// Reads an environment image of any size that the limits allow and shrinks it to
/// [`ENVIRONMENT_BUDGET`]. The format is told by content.
///
/// # Errors
///
/// [`FormatError`] if the file is neither, is damaged, has no red, green and blue, or is too
/// large: [`Limits::max_axis`] bounds its edges and [`Limits::max_decoded_bytes`] its texels, at
/// 12 bytes each.
pub fn read_environment(path: &Path, limits: &Limits) -> Result<Environment, FormatError> {
    let mut stream = Stream::open(path)?;
    let start = stream.peek_up_to(EXR_MAGIC.len());
    if start == EXR_MAGIC {
        return read_exr(path, limits);
    }
    if start.starts_with(b"#?") {
        return read_hdr(path, limits);
    }
    Err(FormatError::field(
        &stream.file,
        "format",
        start.escape_ascii(),
        "Radiance HDR (#?RADIANCE) or OpenEXR at the start of the file",
    ))
}

/// Refuses sizes beyond the limits.
fn check_size(file: &str, width: usize, height: usize, limits: &Limits) -> Result<(), FormatError> {
    let longest = width.max(height);
    if longest > limits.max_axis as usize {
        let (what, got) = ("texels along an axis", longest.to_string());
        let limit = u64::from(limits.max_axis);
        return Err(FormatError::TooLarge { file: file.to_owned(), what, got, limit });
    }
    if width == 0 || height == 0 {
        return Err(FormatError::field(file, "size", format!("{width} x {height}"), "at least one texel"));
    }
    // Both are below 2^32 by now.
    let bytes = width as u64 * height as u64 * 12;
    if bytes > limits.max_decoded_bytes {
        let (what, got) = ("bytes of texels", bytes.to_string());
        return Err(FormatError::TooLarge {
            file: file.to_owned(),
            what,
            got,
            limit: limits.max_decoded_bytes,
        });
    }
    Ok(())
}

fn read_hdr(path: &Path, limits: &Limits) -> Result<Environment, FormatError> {
    let (file, reader, file_bytes) = Stream::open(path)?.into_plain()?;
    let damaged =
        |error: image::ImageError| FormatError::corrupt(&file, format!("the image is damaged: {error}"));
    // The header is read line by line without a bound of its own.
    let bounded: BufReader<std::io::Take<BufReader<File>>> = BufReader::new(reader.take(file_bytes));
    let decoder = HdrDecoder::new(bounded).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    check_size(&file, width as usize, height as usize, limits)?;
    // Every row is announced by four bytes at least.
    if file_bytes / 4 < u64::from(height) {
        let available = format!("{file_bytes} are there");
        return Err(FormatError::Truncated { file, needed: 4 * u64::from(height), available });
    }
    let bytes = decoder.total_bytes();
    if bytes > limits.max_voxel_bytes {
        let (what, got) = ("bytes of texels in memory", bytes.to_string());
        return Err(FormatError::TooLarge { file, what, got, limit: limits.max_voxel_bytes });
    }
    let mut texels = vec![0; bytes as usize];
    decoder.read_image(&mut texels).map_err(damaged)?;
    let mut shrinking = Shrinking::new(width as usize, height as usize);
    let (words, _) = texels.as_chunks::<4>();
    for (at, rgb) in words.as_chunks::<3>().0.iter().enumerate() {
        let rgb = rgb.map(f32::from_ne_bytes);
        shrinking.add(at % width as usize, at / width as usize, rgb);
    }
    Ok(shrinking.finish())
}

fn read_exr(path: &Path, limits: &Limits) -> Result<Environment, FormatError> {
    let (file, reader, _) = Stream::open(path)?.into_plain()?;
    check_exr(&file, reader, limits)?;
    let (_, reader, _) = Stream::open(path)?.into_plain()?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| Shrinking::new(size.width(), size.height()),
            |shrinking: &mut Shrinking, at, (r, g, b): (f32, f32, f32)| {
                shrinking.add(at.x(), at.y(), [r, g, b]);
            },
        )
        .first_valid_layer()
        .all_attributes()
        // One thread adds up the texels in one order: the result is the same everywhere.
        .non_parallel()
        .from_buffered(reader)
        .map_err(|error| unreadable(&file, error))?;
    Ok(image.layer_data.channel_data.pixels.finish())
}

fn unreadable(file: &str, error: exr::error::Error) -> FormatError {
    FormatError::corrupt(file, format!("the image cannot be read: {error}"))
}

/// Refuses sizes beyond the limits. The decoder reserves memory for a whole block of texels by
/// what the header says, for every layer it meets.
fn check_exr(file: &str, reader: BufReader<File>, limits: &Limits) -> Result<(), FormatError> {
    let meta = exr::meta::MetaData::read_from_buffered(reader, false);
    for header in &meta.map_err(|error| unreadable(file, error))?.headers {
        let (width, height) = (header.layer_size.width(), header.layer_size.height());
        check_size(file, width, height, limits)?;
        let block = header.max_block_pixel_size();
        let texels = block.width().min(width) as u64 * block.height().min(height) as u64;
        let bytes = texels.saturating_mul(header.channels.bytes_per_pixel as u64);
        if bytes > limits.max_voxel_bytes {
            let (file, what, got) = (file.to_owned(), "bytes of a block of texels", bytes.to_string());
            return Err(FormatError::TooLarge { file, what, got, limit: limits.max_voxel_bytes });
        }
    }
    Ok(())
}

/// An image that is being averaged down to the budget.
struct Shrinking {
    size: [usize; 2],
    source_size: [usize; 2],
    /// Sums of radiance times solid angle per texel of the result.
    sums: Vec<[f64; 3]>,
    /// Shares of each source column in at most two columns of the result.
    columns: Vec<Shares>,
    /// The same for rows, in solid angle.
    rows: Vec<Shares>,
    negative: u64,
    not_finite: u64,
    too_bright: u64,
}

/// Where a source column or row goes: first target, and weights of it and those that follow.
struct Shares {
    first: usize,
    weights: Vec<f64>,
}

impl Shrinking {
    fn new(width: usize, height: usize) -> Self {
        let size = [width.min(ENVIRONMENT_BUDGET[0]), height.min(ENVIRONMENT_BUDGET[1])];
        // Position of an edge between rows, as the share of the sphere above it.
        let above = |share: f64| 0.5 * (1.0 - (std::f64::consts::PI * share).cos());
        Self {
            size,
            source_size: [width, height],
            sums: vec![[0.0; 3]; size[0] * size[1]],
            columns: shares(width, size[0], |share| share),
            rows: shares(height, size[1], above),
            negative: 0,
            not_finite: 0,
            too_bright: 0,
        }
    }

    fn add(&mut self, x: usize, y: usize, rgb: [f32; 3]) {
        let (mut negative, mut not_finite, mut too_bright) = (false, false, false);
        let clean = rgb.map(|value| {
            negative |= value < 0.0;
            not_finite |= !value.is_finite();
            too_bright |= value.is_finite() && value > MAX_RADIANCE;
            if value.is_finite() { f64::from(value.clamp(0.0, MAX_RADIANCE)) } else { 0.0 }
        });
        self.negative += u64::from(negative);
        self.not_finite += u64::from(not_finite);
        self.too_bright += u64::from(too_bright);
        let (Some(column), Some(row)) = (self.columns.get(x), self.rows.get(y)) else { return };
        for (dy, row_weight) in row.weights.iter().enumerate() {
            for (dx, column_weight) in column.weights.iter().enumerate() {
                let sum = &mut self.sums[(row.first + dy) * self.size[0] + column.first + dx];
                for (sum, value) in sum.iter_mut().zip(clean) {
                    *sum += row_weight * column_weight * value;
                }
            }
        }
    }

    fn finish(self) -> Environment {
        let [width, height] = self.size;
        let [source_width, source_height] = self.source_size;
        let mut notices = Vec::new();
        if self.size != self.source_size {
            notices.push(format!(
                "the image of {source_width} x {source_height} texels is averaged to {width} x {height}"
            ));
        }
        for (count, what) in [
            (self.negative, "had negative radiance, which counts as 0".to_owned()),
            (self.not_finite, "were not finite and count as 0".to_owned()),
            (self.too_bright, format!("were brighter than {MAX_RADIANCE:e}, which they count as")),
        ] {
            if count > 0 {
                notices.push(format!("{count} of {} texels {what}", source_width * source_height));
            }
        }
        let rgb = self.sums.iter().flatten().map(|sum| *sum as f32).collect();
        Environment { width, height, rgb, notices }
    }
}

/// How `source` equal steps spread over `target` equal steps, where `measure` gives the size of
/// everything before an edge. The weights that arrive in each target sum to 1.
fn shares(source: usize, target: usize, measure: impl Fn(f64) -> f64) -> Vec<Shares> {
    if source == target {
        return (0..source).map(|first| Shares { first, weights: vec![1.0] }).collect();
    }
    // Edges in units of 1 / (source * target), so that common edges are common exactly.
    let at = |edge: usize| measure(edge as f64 / (source as f64 * target as f64));
    (0..source)
        .map(|i| {
            let (start, end) = (i * target, (i + 1) * target);
            let (first, last) = (start / source, (end - 1) / source);
            let weights = (first..=last).map(|t| {
                let (low, high) = (t * source, (t + 1) * source);
                (at(end.min(high)) - at(start.max(low))) / (at(high) - at(low))
            });
            Shares { first, weights: weights.collect() }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_every_target_sum_to_one() {
        let above = |share: f64| 0.5 * (1.0 - (std::f64::consts::PI * share).cos());
        for (source, target) in [(4096, 1024), (3000, 1024), (1025, 1024), (7, 3)] {
            let mut sums = vec![0.0; target];
            for share in shares(source, target, above) {
                for (k, weight) in share.weights.iter().enumerate() {
                    assert!(*weight >= 0.0);
                    sums[share.first + k] += weight;
                }
            }
            assert!(sums.iter().all(|sum| (sum - 1.0).abs() < 1e-9), "{source} {target}");
        }
    }

    #[test]
    fn the_light_of_the_sphere_is_kept() {
        // A smooth image and a sun of one texel, at a size that no texel of the result fits.
        let (width, height) = (2500, 1300);
        let radiance = |x: usize, y: usize| match (x, y) {
            (1234, 321) => 34_000.0,
            _ => 1.0 + (x as f32 * 0.01).sin() + y as f32 * 0.001,
        };
        let solid_angle = |y: usize, height: usize| {
            let theta = |y: usize| std::f64::consts::PI * y as f64 / height as f64;
            theta(y).cos() - theta(y + 1).cos()
        };
        let mut shrinking = Shrinking::new(width, height);
        let mut before = 0.0;
        for y in 0..height {
            for x in 0..width {
                let value = radiance(x, y);
                shrinking.add(x, y, [value, 0.5 * value, 0.0]);
                before += f64::from(value) * solid_angle(y, height) / width as f64;
            }
        }
        let environment = shrinking.finish();
        assert_eq!([environment.width, environment.height], ENVIRONMENT_BUDGET);
        let mut after = 0.0;
        for (at, rgb) in environment.rgb.as_chunks::<3>().0.iter().enumerate() {
            let y = at / environment.width;
            after += f64::from(rgb[0]) * solid_angle(y, environment.height) / environment.width as f64;
        }
        assert!((after / before - 1.0).abs() < 1e-6, "{after} {before}");
    }
}
