//! Volumes from images: TIFF files of several pages, and folders of numbered TIFF or PNG slices.
//!
//! Pages are decoded one at a time by the crates `tiff` and `image`, and only those of the chosen
//! channel and time.

mod describe;
mod files;
mod tiff_page;

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use proto::scene_file::{Endian, VoxelType};

use crate::error::{FormatError, file_name};
use crate::half_float;
use crate::orientation::Stored;
use crate::stream::Stream;
use crate::voxels::{Layout, Size, check_axes, type_bytes};
use crate::{Format, Imported, ReadOptions};
use describe::Arrangement;
use tiff_page::TiffPages;

pub(crate) use files::files_of;

/// LZW and deflate never make more than so many bytes of one.
const MAX_RATIO: u64 = 4096;

/// Whether a file starts like a TIFF or BigTIFF file.
pub(crate) fn is_tiff(start: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| start.starts_with(*magic))
}

/// Size and type of a page; all pages of a volume must agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Page {
    width: u32,
    height: u32,
    /// Samples per pixel.
    components: u16,
    voxel_type: VoxelType,
    is_half: bool,
}

impl Page {
    fn bytes(&self) -> u64 {
        // Each factor is bounded by its type: no overflow within u128, and beyond u64 no file.
        let pixels = u128::from(self.width) * u128::from(self.height);
        let bytes = pixels * u128::from(self.components) * u128::from(type_bytes(self.voxel_type));
        u64::try_from(bytes).unwrap_or(u64::MAX)
    }
}

/// Reads a TIFF file; its pages are slices, by ImageJ's or OME's word also channels and times.
pub(crate) fn read_stack(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let file = file_name(path);
    let mut notices = Vec::new();
    let file_bytes = Stream::open(path)?.at_most();
    let mut pages = TiffPages::open(path)?;
    let description = pages.description();
    let walked = pages.walk(options, &mut notices)?;
    let arrangement =
        Arrangement::of(&file, &description, pages.resolution(), walked.places.len(), &mut notices)?;
    if walked.places.len() == 1 {
        notices.push("the image is flat: it becomes one slice".to_owned());
    }
    let depth = arrangement.slices;
    let plan = Plan { file: &file, page: walked.page, depth, volumes: arrangement.volumes(), file_bytes };
    let (layout, size) = plan.check(options, &mut notices)?;
    let chosen: Vec<usize> =
        (0..depth).filter_map(|z| walked.places.get(arrangement.page(z, size.volume)).copied()).collect();
    let mut pages = TiffPages::open_for(path, walked.page)?;
    let decode = move |place: usize| pages.decode(place, walked.page);
    plan.read(&layout, &size, chosen, Box::new(decode), &arrangement, Format::Tiff, options, notices)
}

/// Reads a folder of slices, in the order given.
pub(crate) fn read_files(
    folder: &Path,
    files: Vec<PathBuf>,
    options: &ReadOptions<'_>,
) -> Result<Imported, FormatError> {
    let name = file_name(folder);
    let mut notices = vec![format!("{} files are read as the slices of one volume", files.len())];
    let first = files::page_of(&files[0])?;
    let mut file_bytes = 0_u64;
    for file in &files {
        file_bytes = file_bytes.saturating_add(Stream::open(file)?.at_most());
    }
    let arrangement = Arrangement::slices_only(files.len(), &mut notices);
    let plan = Plan { file: &name, page: first, depth: files.len(), volumes: 1, file_bytes };
    let (layout, size) = plan.check(options, &mut notices)?;
    let format = if files::is_png(&files[0]) { Format::Png } else { Format::Tiff };
    let chosen = (0..files.len()).collect();
    let decode = move |index: usize| files::decode(&files[index], first);
    plan.read(&layout, &size, chosen, Box::new(decode), &arrangement, format, options, notices)
}

/// Hands out the bytes of a page.
type Decode<'a> = Box<dyn FnMut(usize) -> Result<Vec<u8>, FormatError> + 'a>;

/// What is to be read.
struct Plan<'a> {
    file: &'a str,
    page: Page,
    depth: usize,
    volumes: u64,
    /// Bytes of all files.
    file_bytes: u64,
}

impl Plan<'_> {
    /// Holds the sizes against the limits and against what the files can hold.
    fn check(
        &self,
        options: &ReadOptions<'_>,
        notices: &mut Vec<String>,
    ) -> Result<(Layout, Size), FormatError> {
        let page = self.page;
        let sizes = [i128::from(page.width), i128::from(page.height), self.depth as i128];
        let layout = Layout {
            voxel_type: page.voxel_type,
            endian: Endian::Little,
            dims: check_axes(self.file, "width, height and pages", sizes, &options.limits)?,
            components: u64::from(page.components),
            volumes: self.volumes,
        };
        let size = layout.check(self.file, options, notices)?;
        let at_most = self.file_bytes.saturating_mul(MAX_RATIO);
        if size.total_bytes > at_most {
            return Err(FormatError::Truncated {
                file: self.file.to_owned(),
                needed: size.total_bytes,
                available: format!("at most {at_most} can come out of it"),
            });
        }
        if page.components > 1 {
            notices.push("pixels of several samples: one of them is read, not their brightness".to_owned());
        }
        if page.is_half {
            notices.push(half_float::NOTICE.to_owned());
        }
        Ok((layout, size))
    }

    #[allow(clippy::too_many_arguments)]
    fn read(
        &self,
        layout: &Layout,
        size: &Size,
        chosen: Vec<usize>,
        decode: Decode<'_>,
        arrangement: &Arrangement,
        format: Format,
        options: &ReadOptions<'_>,
        mut notices: Vec<String>,
    ) -> Result<Imported, FormatError> {
        let stored = Stored {
            dims: layout.dims,
            spacing: arrangement.spacing,
            spacing_unit: arrangement.unit.clone(),
            slope: 1.0,
            intercept: 0.0,
            affine: None,
        };
        stored.check_spacing(self.file, "spacing")?;
        let at_most = self.page.bytes().saturating_mul(chosen.len() as u64);
        let pages = Pages { decode, chosen: chosen.into_iter(), page: Vec::new(), given: 0 };
        let mut stream = Stream::decoded(self.file.to_owned(), Box::new(pages), at_most);
        let voxels = layout.read_chosen(size, &mut stream, options, &mut notices)?;
        Ok(Imported {
            volume: stored.into_volume(voxels, &mut notices),
            format,
            file_type: self.page.voxel_type,
            choices: layout.choices(),
            choice_names: Vec::new(),
            notices,
        })
    }
}

/// Pages one after the other, as a reader.
struct Pages<'a> {
    decode: Decode<'a>,
    chosen: std::vec::IntoIter<usize>,
    page: Vec<u8>,
    /// Bytes of `page` that have been handed out.
    given: usize,
}

impl Read for Pages<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.given == self.page.len() {
            let Some(next) = self.chosen.next() else { return Ok(0) };
            self.page = (self.decode)(next).map_err(io::Error::other)?;
            self.given = 0;
        }
        let step = buffer.len().min(self.page.len() - self.given);
        buffer[..step].copy_from_slice(&self.page[self.given..self.given + step]);
        self.given += step;
        Ok(step)
    }
}
