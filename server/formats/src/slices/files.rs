//! Folders of slices: which files, in which order, and one slice of them.

use std::cmp::Ordering;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use image::codecs::png::PngDecoder;
use image::{ColorType, ImageDecoder};
use proto::scene_file::VoxelType;

use super::Page;
use super::tiff_page::TiffPages;
use crate::error::{FormatError, file_name};
use crate::stream::Stream;

/// Most slices of a folder.
const MAX_FILES: usize = 1 << 16;
/// Largest PNG that is decoded, bytes of its pixels.
const MAX_PNG_BYTES: u64 = 1 << 30;

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Whether a file is a PNG by its name.
pub(super) fn is_png(path: &Path) -> bool {
    extension(path) == "png"
}

/// The slices of a folder, numbers in names counted as numbers; empty if there are none.
///
/// # Errors
///
/// A folder that cannot be listed, with TIFF and PNG files mixed, or with too many files.
pub(crate) fn files_of(folder: &Path) -> Result<Vec<PathBuf>, FormatError> {
    let name = file_name(folder);
    let (mut tiff, mut png) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(FormatError::io(&name, "open"))? {
        let entry = entry.map_err(FormatError::io(&name, "read"))?;
        // Links are no files here: a folder from a stranger must not lead elsewhere.
        if !entry.file_type().is_ok_and(|kind| kind.is_file()) || is_hidden(&entry.path()) {
            continue;
        }
        match extension(&entry.path()).as_str() {
            "tif" | "tiff" => tiff.push(entry.path()),
            "png" => png.push(entry.path()),
            _ => {}
        }
        if tiff.len() + png.len() > MAX_FILES {
            let (what, got) = ("slices", "more".to_owned());
            return Err(FormatError::TooLarge { file: name, what, got, limit: MAX_FILES as u64 });
        }
    }
    if !tiff.is_empty() && !png.is_empty() {
        let got = format!("{} TIFF and {} PNG files", tiff.len(), png.len());
        return Err(FormatError::field(&name, "slices", got, "files of one kind"));
    }
    let mut files = if png.is_empty() { tiff } else { png };
    files.sort_by(|a, b| natural(&file_name(a), &file_name(b)));
    Ok(files)
}

fn is_hidden(path: &Path) -> bool {
    file_name(path).starts_with('.')
}

/// Compares names so that `a2` comes before `a10`.
fn natural(a: &str, b: &str) -> Ordering {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let (mut left, mut right) = (a, b);
    loop {
        let (in_left, in_right) = (digits(left), digits(right));
        if in_left > 0 && in_right > 0 {
            let (x, y) = (&left[..in_left], &right[..in_right]);
            let (x, y) = (x.trim_start_matches('0'), y.trim_start_matches('0'));
            let order = x.len().cmp(&y.len()).then_with(|| x.cmp(y));
            if order.is_ne() {
                return order;
            }
            (left, right) = (&left[in_left..], &right[in_right..]);
            continue;
        }
        let (mut x, mut y) = (left.chars(), right.chars());
        match (x.next(), y.next()) {
            (None, None) => return a.cmp(b),
            (x, y) if x != y => return x.cmp(&y),
            _ => (left, right) = (x.as_str(), y.as_str()),
        }
    }
}

/// Size and type of a slice.
pub(super) fn page_of(path: &Path) -> Result<Page, FormatError> {
    if !is_png(path) {
        let mut notices = Vec::new();
        let mut pages = TiffPages::open(path)?;
        let walked = pages.walk(&crate::ReadOptions::default(), &mut notices)?;
        return match walked.places.len() {
            1 => Ok(walked.page),
            count => {
                let expected = "files of one page in a folder of slices";
                Err(FormatError::field(&file_name(path), "pages", count, expected))
            }
        };
    }
    let decoder = png(path)?;
    let (width, height) = decoder.dimensions();
    let (components, voxel_type) = match decoder.color_type() {
        ColorType::L8 => (1, VoxelType::Uint8),
        ColorType::La8 => (2, VoxelType::Uint8),
        ColorType::Rgb8 => (3, VoxelType::Uint8),
        ColorType::Rgba8 => (4, VoxelType::Uint8),
        ColorType::L16 => (1, VoxelType::Uint16),
        ColorType::La16 => (2, VoxelType::Uint16),
        ColorType::Rgb16 => (3, VoxelType::Uint16),
        ColorType::Rgba16 => (4, VoxelType::Uint16),
        other => {
            let expected = "8 or 16 bits per sample";
            return Err(FormatError::field(&file_name(path), "colour type", format!("{other:?}"), expected));
        }
    };
    Ok(Page { width, height, components, voxel_type, is_half: false })
}

fn png(path: &Path) -> Result<PngDecoder<BufReader<File>>, FormatError> {
    let (file, reader, _) = Stream::open(path)?.into_plain()?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_PNG_BYTES);
    PngDecoder::with_limits(reader, limits).map_err(|error| damaged(&file, &error))
}

fn damaged(file: &str, error: &image::ImageError) -> FormatError {
    FormatError::corrupt(file, format!("the image cannot be read: {error}"))
}

/// Decodes a slice, which must be like the first, to little-endian bytes.
pub(super) fn decode(path: &Path, expected: Page) -> Result<Vec<u8>, FormatError> {
    let file = file_name(path);
    let page = page_of(path)?;
    if page != expected {
        let got = format!("{} x {}", page.width, page.height);
        let expected = format!("{} x {} and the type of the first slice", expected.width, expected.height);
        return Err(FormatError::field(&file, "size and type", got, expected));
    }
    if !is_png(path) {
        return TiffPages::open_for(path, page)?.decode(0, page);
    }
    let decoder = png(path)?;
    let bytes = decoder.total_bytes();
    if bytes != page.bytes() || bytes > MAX_PNG_BYTES {
        let (what, got) = ("bytes of a slice", bytes.to_string());
        return Err(FormatError::TooLarge { file, what, got, limit: MAX_PNG_BYTES });
    }
    let mut pixels = vec![0; bytes as usize];
    decoder.read_image(&mut pixels).map_err(|error| damaged(&file, &error))?;
    if page.voxel_type == VoxelType::Uint16 {
        // The decoder hands out the machine's byte order.
        for pair in pixels.as_chunks_mut::<2>().0 {
            *pair = u16::from_ne_bytes(*pair).to_le_bytes();
        }
    }
    Ok(pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_numbers() {
        let mut names = ["s10.png", "s9.png", "s009b.png", "s1.png", "t0.png", "s", "s01.png"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["s", "s01.png", "s1.png", "s9.png", "s009b.png", "s10.png", "t0.png"]);
    }
}
