//! Place and scaling of each frame, from the data set itself or from its functional groups
//! (PS3.3, C.7.6.16): what all frames share, then what each has of its own.

use super::elements::{Encoding, Tag, number};
use super::header::{MAX_FRAMES, decimals, vector};
use crate::error::FormatError;
use crate::orientation::{Vec3, cross, dot, norm};

/// SharedFunctionalGroupsSequence.
pub(super) const SHARED: Tag = 0x5200_9229;
/// PerFrameFunctionalGroupsSequence.
pub(super) const PER_FRAME: Tag = 0x5200_9230;
/// Sequences that are looked into: the groups and, in them, frame content, plane position and
/// orientation, pixel measures, pixel value transformation.
pub(super) const WANTED: [Tag; 7] =
    [SHARED, PER_FRAME, 0x0020_9111, 0x0020_9113, 0x0020_9116, 0x0028_9110, 0x0028_9145];
/// How far the directions of rows and columns may be from unit length and from perpendicular.
const MAX_SKEW: f64 = 1e-2;

/// Place and scaling of a frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    /// Centre of the first pixel, LPS, millimetres.
    pub(super) position: Option<Vec3>,
    /// Directions along a row (of rising column) and along a column, LPS.
    pub(super) orientation: Option<[Vec3; 2]>,
    /// Distance of pixels along a row and along a column, millimetres.
    pub(super) spacing: Option<[f64; 2]>,
    /// Data value per stored value.
    pub(super) slope: f64,
    /// Data value of stored value 0.
    pub(super) intercept: f64,
    /// Which stack of slices, or which moment, the frame belongs to.
    pub(super) stack: (String, u64),
}

impl Frame {
    /// The slice's normal.
    pub(super) fn normal(&self) -> Option<Vec3> {
        let [along_row, along_column] = self.orientation?;
        Some(cross(along_row, along_column))
    }

    /// Refuses directions that are none; brings sound ones to unit length.
    pub(super) fn check_orientation(&mut self, file: &str) -> Result<(), FormatError> {
        let Some(axes) = &mut self.orientation else { return Ok(()) };
        let lengths = axes.map(norm);
        let unit = lengths.iter().all(|length| (length - 1.0).abs() <= MAX_SKEW);
        if !unit || dot(axes[0], axes[1]).abs() > MAX_SKEW {
            let expected = "two perpendicular directions of unit length";
            return Err(FormatError::field(file, "ImageOrientationPatient", format!("{axes:?}"), expected));
        }
        for (axis, length) in axes.iter_mut().zip(lengths) {
            *axis = axis.map(|c| c / length);
        }
        Ok(())
    }
}

/// What one level says; nothing where it is silent.
#[derive(Debug, Default, Clone)]
struct Stated {
    position: Option<Vec3>,
    orientation: Option<[Vec3; 2]>,
    spacing: Option<[f64; 2]>,
    slope: Option<f64>,
    intercept: Option<f64>,
    step: Option<f64>,
    thickness: Option<f64>,
    stack: Option<String>,
    moment: Option<u64>,
}

/// Collects what data set, shared and per-frame groups say.
#[derive(Debug, Default)]
pub(super) struct Groups {
    root: Stated,
    shared: Stated,
    frames: Vec<Stated>,
}

/// The frames of a file.
pub(super) struct Frames {
    pub(super) list: Vec<Frame>,
    pub(super) stated_step: Option<f64>,
}

impl Groups {
    /// An element of the data set itself.
    pub(super) fn root(&mut self, tag: Tag, value: &[u8]) {
        self.root.element(tag, value, Encoding { explicit: true, big: false });
    }

    /// A frame's groups begin; `false` if there are too many.
    pub(super) fn begin_frame(&mut self) -> bool {
        self.frames.push(Stated::default());
        self.frames.len() <= MAX_FRAMES
    }

    /// An element of a functional group.
    pub(super) fn element(&mut self, group: Tag, tag: Tag, value: &[u8], encoding: Encoding) {
        let stated = match group {
            SHARED => Some(&mut self.shared),
            _ => self.frames.last_mut(),
        };
        if let Some(stated) = stated {
            stated.element(tag, value, encoding);
        }
    }

    /// Every frame with what applies to it.
    pub(super) fn into_frames(self, count: usize, detector_spacing: Option<[f64; 2]>) -> Frames {
        let Groups { root, shared, frames } = self;
        let nothing = Stated::default();
        let frame = |index: usize| {
            let levels = [frames.get(index).unwrap_or(&nothing), &shared, &root];
            // Rows come first in spacings: they lie along the column.
            let spacing = levels.iter().find_map(|s| s.spacing).or(detector_spacing);
            Frame {
                position: levels.iter().find_map(|s| s.position),
                orientation: levels.iter().find_map(|s| s.orientation),
                spacing: spacing.map(|[between_rows, between_columns]| [between_columns, between_rows]),
                slope: levels.iter().find_map(|s| s.slope).unwrap_or(1.0),
                intercept: levels.iter().find_map(|s| s.intercept).unwrap_or(0.0),
                stack: (
                    levels.iter().find_map(|s| s.stack.clone()).unwrap_or_default(),
                    levels.iter().find_map(|s| s.moment).unwrap_or(0),
                ),
            }
        };
        let levels = [frames.first().unwrap_or(&nothing), &shared, &root];
        let step = levels.iter().find_map(|s| s.step.filter(|step| *step > 0.0));
        let thickness = levels.iter().find_map(|s| s.thickness.filter(|thickness| *thickness > 0.0));
        Frames { list: (0..count).map(frame).collect(), stated_step: step.or(thickness) }
    }
}

impl Stated {
    fn element(&mut self, tag: Tag, value: &[u8], encoding: Encoding) {
        match tag {
            0x0020_0032 => self.position = vector(value),
            0x0020_0037 => {
                let six: Option<[f64; 6]> = decimals(value);
                self.orientation = six.map(|[a, b, c, d, e, f]| [[a, b, c], [d, e, f]]);
            }
            0x0028_0030 => self.spacing = decimals(value),
            0x0018_0050 => self.thickness = decimals(value).map(|[value]| value),
            0x0018_0088 => self.step = decimals(value).map(|[value]| value),
            0x0028_1052 => self.intercept = decimals(value).map(|[value]| value),
            0x0028_1053 => self.slope = decimals(value).map(|[value]| value),
            0x0020_9056 => self.stack = Some(super::header::text(value)),
            0x0020_9128 if value.len() == 4 => self.moment = Some(number(value, encoding.big)),
            _ => {}
        }
    }
}
