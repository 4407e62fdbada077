//! DICOM (PS3.3, PS3.5): series of slices in a folder or zip archive, single files, multi-frame
//! files.
//!
//! | file | what it does |
//! |---|---|
//! | `source` | which files there are |
//! | `elements` | walks through a data set |
//! | `header`, `frames` | the few values that are taken, of the file and of each frame |
//! | `series` | which slices make a volume, their order and distance |
//! | `codec`, `pixels` | bytes to stored values |
//! | `volume` | stored values to voxels |
//!
//! Every file is opened twice: for its headers, then, in the volume's order, for its pixels.

mod codec;
mod elements;
mod frames;
mod header;
mod pixels;
mod series;
mod source;
mod volume;

use std::path::Path;

use crate::error::FormatError;
use crate::orientation::{Affine, Stored, cross};
use crate::voxels::check_axes;
use crate::{Format, Imported, ReadOptions};
use header::Image;
use series::{Group, Key, Slice};
use source::Source;
use volume::Kind;

/// Share of the progress that reading headers takes.
const HEADERS_SHARE: f32 = 0.2;
/// Most series or volumes that are offered.
const MAX_GROUPS: usize = 10_000;

/// Whether a file starts as DICOM files do.
pub(crate) fn is_start(start: &[u8]) -> bool {
    header::is_dicom(start)
}

/// Whether a file is DICOM by its content; one that cannot be read is not.
pub fn is_dicom(path: &Path) -> bool {
    source::starts_like_dicom(path)
}

/// Reads a series from a folder, a zip archive or a single file.
pub(crate) fn read(path: &Path, options: &ReadOptions<'_>) -> Result<Imported, FormatError> {
    let source = Source::open(path, options)?;
    let mut notices = Vec::new();
    let found = scan(&source, options)?;
    let name = &source.name;
    let groups = found.choices(&source)?;
    if found.without_image > 0 {
        notices.push(format!("{} DICOM files without an image are left out", found.without_image));
    }
    if source.passed_over > 0 {
        notices.push(format!("{} files that are not DICOM are left out", source.passed_over));
    }
    let choice_names: Vec<String> = groups.iter().map(Group::name).collect();
    let index = choose(name, &choice_names, options, &mut notices)?;
    let group = &groups[index];
    let kind = found.kind(&source, group, &mut notices)?;
    let stack = group.stack(name, &mut notices)?;
    let dims =
        [group.key.columns, group.key.rows, stack.layers.len()].map(|n| i128::try_from(n).unwrap_or(0));
    let dims = check_axes(name, "Columns, Rows, slices", dims, &options.limits)?;
    kind.check_memory(name, dims, &options.limits)?;
    let [across, down] = group.key.spacing.unwrap_or_else(|| {
        notices.push("the file does not say how large the pixels are: 1 mm is taken".to_owned());
        [1.0; 2]
    });
    let spacing = [across, down, stack.step];
    let affine = group.key.orientation.map(|[along_row, along_column]| Affine {
        directions: [along_row, along_column, cross(along_row, along_column)],
        spacing,
        origin: stack.origin.unwrap_or([0.0; 3]),
    });
    let mut stored =
        Stored { dims, spacing, spacing_unit: Some("mm".to_owned()), slope: 1.0, intercept: 0.0, affine };
    stored.check_spacing(name, "PixelSpacing and positions")?;
    let filled = volume::fill(&source, group, &stack, &kind, options)?;
    let filled = filled.without_padding(kind.padding, &mut notices);
    (stored.slope, stored.intercept) = (filled.slope, filled.intercept);
    Ok(Imported {
        volume: stored.into_volume(filled.voxels, &mut notices),
        format: Format::Dicom,
        file_type: kind.file_type,
        choices: choice_names.len() as u64,
        choice_names,
        notices,
    })
}

/// Which of several series is shown, with a notice that lists them.
fn choose(
    file: &str,
    names: &[String],
    options: &ReadOptions<'_>,
    notices: &mut Vec<String>,
) -> Result<usize, FormatError> {
    /// Series that a notice lists; the rest are counted.
    const LISTED: usize = 12;
    let count = names.len();
    if count > 1 && options.index.is_none() {
        let listed: Vec<String> =
            names.iter().enumerate().take(LISTED).map(|(i, name)| format!("{i}: {name}")).collect();
        let more = if count > LISTED { format!(", and {} more", count - LISTED) } else { String::new() };
        notices.push(format!(
            "there are {count} volumes: {}{more}. Index 0 is shown, set `index` for another",
            listed.join("; ")
        ));
    }
    let index = options.index.unwrap_or(0) as usize;
    match index < count {
        true => Ok(index),
        false => {
            let expected = format!("a number below {count}, the count of volumes");
            Err(FormatError::field(file, "index", index, expected))
        }
    }
}

/// What the headers of all files say.
struct Found {
    groups: Vec<Group>,
    /// Kinds of pixels by file.
    kinds: Vec<Option<Kind>>,
    without_image: usize,
}

fn scan(source: &Source, options: &ReadOptions<'_>) -> Result<Found, FormatError> {
    let mut found = Found { groups: Vec::new(), kinds: Vec::new(), without_image: 0 };
    for index in 0..source.len() {
        let file = source.file(index);
        let image = header::parse(&file, source.load(index, options)?, &options.limits)?;
        match image {
            None => {
                found.without_image += 1;
                found.kinds.push(None);
            }
            Some(image) => {
                image.check_length(&file)?;
                found.add(&file, index, &image)?;
                found.kinds.push(Some(Kind::of(&image)));
            }
        }
        (options.progress)(HEADERS_SHARE * (index + 1) as f32 / source.len() as f32);
    }
    Ok(found)
}

impl Found {
    fn add(&mut self, file: &str, index: usize, image: &Image) -> Result<(), FormatError> {
        for (frame, place) in image.frames.iter().enumerate() {
            let key = Key {
                series_uid: image.series_uid.clone(),
                rows: image.rows,
                columns: image.columns,
                orientation: place.orientation,
                spacing: place.spacing,
                stack: place.stack.clone(),
            };
            let slice = Slice {
                file: index,
                frame,
                instance: image.instance,
                position: place.position,
                slope: place.slope,
                intercept: place.intercept,
            };
            let count = self.groups.len();
            // Slices come in runs: the group of the last one is the likeliest.
            match self.groups.iter_mut().rev().find(|group| group.key.fits(&key)) {
                Some(group) => group.slices.push(slice),
                None if count >= MAX_GROUPS => {
                    let expected = format!("at most {MAX_GROUPS} series");
                    return Err(FormatError::field(file, "SeriesInstanceUID", "one more", expected));
                }
                None => self.groups.push(Group {
                    key,
                    modality: image.modality.clone(),
                    description: image.description.clone(),
                    series_number: image.series_number,
                    stated_step: image.stated_step,
                    slices: vec![slice],
                }),
            }
        }
        Ok(())
    }

    /// The volumes on offer, the one of most slices first.
    fn choices(&self, source: &Source) -> Result<Vec<Group>, FormatError> {
        if self.groups.is_empty() {
            return Err(FormatError::corrupt(
                &source.name,
                "there is no DICOM image in it, no TIFF or PNG slice and no OME-Zarr",
            ));
        }
        // A series whose slices all differ is no volume; one that has a localizer besides is.
        for group in &self.groups {
            let others = || self.groups.iter().filter(|other| other.key.series_uid == group.key.series_uid);
            let parts = others().count();
            if parts > 1 && others().all(|other| other.slices.len() == 1) && self.kinds.len() > 1 {
                let files = others().take(2).filter_map(|other| other.slices.first());
                let files: Vec<String> = files.map(|slice| source.file(slice.file)).collect();
                return Err(FormatError::field(
                    &files[0],
                    "Rows, Columns, ImageOrientationPatient and PixelSpacing",
                    format!("other values than in {}", files.last().map_or("", String::as_str)),
                    "the slices of a series to agree",
                ));
            }
        }
        let mut choices: Vec<Group> = self.groups.iter().cloned().flat_map(Group::split_moments).collect();
        // Stable for one upload: slices, then the order the scanner gave, then identity.
        choices.sort_by(|a, b| {
            let rank = |group: &Group| (std::cmp::Reverse(group.slices.len()), group.series_number);
            rank(a)
                .cmp(&rank(b))
                .then_with(|| a.key.series_uid.cmp(&b.key.series_uid))
                .then_with(|| a.key.stack.cmp(&b.key.stack))
        });
        Ok(choices)
    }

    /// The kind of pixels of a volume; widened where its files differ.
    fn kind(&self, source: &Source, group: &Group, notices: &mut Vec<String>) -> Result<Kind, FormatError> {
        let mut kinds = group.slices.iter().filter_map(|slice| self.kinds.get(slice.file)?.as_ref());
        let Some(first) = kinds.next() else {
            return Err(FormatError::corrupt(
                &source.name,
                "there is no DICOM image in it, no TIFF or PNG slice and no OME-Zarr",
            ));
        };
        let kind = kinds.fold(first.clone(), |kind, other| kind.joined(other));
        Ok(kind.with_scaling(&group.slices, notices))
    }
}
