//! From sform, qform and pixdim to spacing and place in LPS, by the standard's methods 3, 2, 1.

use super::header::Header;
use crate::orientation::{Affine, Vec3, norm, spacing_is_usable};

/// Relative difference up to which a length from the single-precision sform counts as the one in
/// pixdim, which is the rounder number.
const SAME_LENGTH: f64 = 1e-5;
/// Relative difference of voxel edges, and of a direction's cosine from 1, that is worth a notice.
const NOTABLE_DIFFERENCE: f64 = 1e-3;
/// Difference of the first voxel's place that is worth a notice, in voxels.
const NOTABLE_SHIFT: f64 = 0.5;

/// Spacing of the file's axes, and their place if the file gives one that can be used.
pub(super) fn place(header: &Header, dims: [usize; 3], notices: &mut Vec<String>) -> (Vec3, Option<Affine>) {
    let spacing = pixdim_spacing(header, dims, notices);
    let sform = (header.sform_code > 0).then(|| sform(header, spacing));
    let qform = (header.qform_code > 0).then(|| qform(header, spacing));
    if matches!(sform, Some(None)) {
        notices.push("the sform cannot be used (singular, absurd or not finite)".to_owned());
    }
    if matches!(qform, Some(None)) {
        notices.push("the qform cannot be used (not finite)".to_owned());
    }
    let (sform, qform) = (sform.flatten(), qform.flatten());
    if let (Some(sform), Some(qform)) = (&sform, &qform)
        && differ(sform, qform)
    {
        notices.push("sform and qform differ: the sform is used".to_owned());
    }
    let affine = sform.or(qform);
    if affine.is_none() && header.qform_code.max(header.sform_code) > 0 {
        notices.push("no usable orientation is left: the axes stay as stored".to_owned());
    }
    (spacing, affine)
}

/// Voxel edges from pixdim; what cannot be one becomes 1.
fn pixdim_spacing(header: &Header, dims: [usize; 3], notices: &mut Vec<String>) -> Vec3 {
    [0, 1, 2].map(|axis| {
        let stated = header.pixdim[axis + 1];
        if spacing_is_usable(stated.abs()) {
            if stated < 0.0 {
                notices.push(format!("pixdim[{}] is {stated}: its size is taken", axis + 1));
            }
            return stated.abs();
        }
        // Flat images leave the third edge at 0 as a rule.
        if dims[axis] > 1 || stated != 0.0 {
            notices.push(format!("pixdim[{}] is {stated}: 1 is taken", axis + 1));
        }
        1.0
    })
}

/// RAS to LPS.
fn turn([x, y, z]: Vec3) -> Vec3 {
    [-x, -y, z]
}

fn sform(header: &Header, pixdim: Vec3) -> Option<Affine> {
    let column = |k: usize| header.srow.map(|row| row[k]);
    let columns = [column(0), column(1), column(2)].map(turn);
    let mut affine = Affine::from_columns(columns, turn(column(3)))?;
    for (length, stated) in affine.spacing.iter_mut().zip(pixdim) {
        if (*length - stated).abs() <= SAME_LENGTH * stated {
            *length = stated;
        }
    }
    Some(affine)
}

/// The quaternion's rotation, `pixdim[0]` (qfac) as the sign of the third axis.
fn qform(header: &Header, spacing: Vec3) -> Option<Affine> {
    let [b, c, d] = header.quatern;
    // The header leaves the real part out. In half turns it is 0, and the square root would make
    // much of what rounding of b, c, d left of it.
    let a_squared = 1.0 - (b * b + c * c + d * d);
    let a = if a_squared < 3.0 * header.epsilon() { 0.0 } else { a_squared.sqrt() };
    let length = (a * a + b * b + c * c + d * d).sqrt();
    let [a, b, c, d] = [a, b, c, d].map(|q| q / length);
    let handedness = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
    let axes = [
        [a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)],
        [2.0 * (b * c - a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d + a * b)],
        [2.0 * (b * d + a * c), 2.0 * (c * d - a * b), a * a + d * d - b * b - c * c].map(|v| handedness * v),
    ];
    let columns = [0, 1, 2].map(|axis: usize| turn(axes[axis].map(|v| v * spacing[axis])));
    let mut affine = Affine::from_columns(columns, turn(header.qoffset))?;
    affine.spacing = spacing;
    Some(affine)
}

fn differ(a: &Affine, b: &Affine) -> bool {
    let shift = norm([0, 1, 2].map(|k| (a.origin[k] - b.origin[k]) / a.spacing[k]));
    let turned = (0..3).any(|axis| {
        crate::orientation::dot(a.directions[axis], b.directions[axis]) < 1.0 - NOTABLE_DIFFERENCE
    });
    let stretched =
        (0..3).any(|axis| (a.spacing[axis] - b.spacing[axis]).abs() > NOTABLE_DIFFERENCE * a.spacing[axis]);
    shift > NOTABLE_SHIFT || turned || stretched
}
