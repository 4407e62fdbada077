//! Which axes are space, how long their steps are and where they point.

use super::header::Header;
use crate::ReadOptions;
use crate::error::FormatError;
use crate::orientation::{Affine, Stored, Vec3, cross, norm};
use crate::voxels::check_axes;

/// An axis without other hints is taken for components if it is the first of four and no longer
/// than this (RGBA).
const MAX_GUESSED_COMPONENTS: i128 = 4;

/// Axes of a file in the order components, space, volumes.
pub(super) struct Axes {
    pub(super) stored: Stored,
    /// Values of the non-spatial axes before the spatial ones.
    pub(super) components: u64,
    /// Values of the non-spatial axes after the spatial ones.
    pub(super) volumes: u64,
}

/// What the `space` field says about the directions.
enum Space {
    /// Factors that turn its coordinates into LPS.
    Anatomical(Vec3),
    /// Directions in some other space of this dimension.
    Other(usize),
}

/// Interprets sizes, kinds, directions and spacings.
pub(super) fn axes(
    header: &Header,
    options: &ReadOptions<'_>,
    notices: &mut Vec<String>,
) -> Result<Axes, FormatError> {
    let sizes = header.sizes()?;
    let space = space(header)?;
    let directions = directions(header, sizes.len(), space.as_ref())?;
    let spatial = spatial_axes(header, &sizes, directions.as_deref(), notices)?;
    let (first, last) = (spatial[0], spatial[spatial.len() - 1]);
    let count = |axes: &[i128]| {
        axes.iter()
            .try_fold(1_u64, |product, size| product.checked_mul(u64::try_from(*size).ok()?))
            .ok_or_else(|| FormatError::field(&header.file, "sizes", format!("{sizes:?}"), "less"))
    };
    if spatial.len() < 3 {
        notices.push("the image is flat: it becomes one slice".to_owned());
    }
    let of_space = |axis: usize| spatial.get(axis).map(|index| sizes[*index]);
    let sizes_of_space = [0, 1, 2].map(|axis| of_space(axis).unwrap_or(1));
    let dims = check_axes(&header.file, "sizes", sizes_of_space, &options.limits)?;
    let (spacing, affine) = steps(header, &sizes, &spatial, directions, space, notices)?;
    let stored = Stored {
        dims,
        spacing,
        spacing_unit: spacing_unit(header, &spatial),
        slope: 1.0,
        intercept: 0.0,
        affine,
    };
    stored.check_spacing(&header.file, "spacings")?;
    Ok(Axes { stored, components: count(&sizes[..first])?, volumes: count(&sizes[last + 1..])? })
}

fn space(header: &Header) -> Result<Option<Space>, FormatError> {
    let dimension = header.get("spacedimension");
    let Some(name) = header.get("space") else {
        let Some(text) = dimension else {
            return Ok(None);
        };
        let dimension = text
            .parse()
            .ok()
            .filter(|d| (1..=3).contains(d))
            .ok_or_else(|| FormatError::field(&header.file, "space dimension", text, "1, 2 or 3"))?;
        return Ok(Some(Space::Other(dimension)));
    };
    let lower = name.to_lowercase();
    Ok(Some(match lower.as_str() {
        "left-posterior-superior" | "lps" => Space::Anatomical([1.0, 1.0, 1.0]),
        "right-anterior-superior" | "ras" => Space::Anatomical([-1.0, -1.0, 1.0]),
        "left-anterior-superior" | "las" => Space::Anatomical([1.0, -1.0, 1.0]),
        "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => Space::Other(3),
        other if other.ends_with("-time") || matches!(other, "rast" | "last" | "lpst") => {
            return Err(FormatError::unsupported(
                &header.file,
                format!("the space {name}"),
                "use the same space without time, and `none` as the direction of the time axis",
            ));
        }
        _ => {
            let expected = "left-posterior-superior, right-anterior-superior, \
                            left-anterior-superior, scanner-xyz, 3D-right-handed or \
                            3D-left-handed";
            return Err(FormatError::field(&header.file, "space", name, expected));
        }
    }))
}

/// The `space directions`: a vector per spatial axis, `None` for the others.
fn directions(
    header: &Header,
    dimension: usize,
    space: Option<&Space>,
) -> Result<Option<Vec<Option<Vec3>>>, FormatError> {
    let Some(text) = header.get("spacedirections") else {
        return Ok(None);
    };
    let expected = format!("{dimension} vectors like (1,0,0), or `none` for axes that are not space");
    let error = || FormatError::field(&header.file, "space directions", text, &expected);
    let space_dimension = match space {
        Some(Space::Anatomical(_)) => 3,
        Some(Space::Other(dimension)) => *dimension,
        None => {
            let expected = "the space the directions are in, for example left-posterior-superior";
            return Err(FormatError::missing(&header.file, "space", expected));
        }
    };
    let mut directions = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() && directions.len() <= dimension {
        if let Some(after) = rest.strip_prefix("none") {
            directions.push(None);
            rest = after.trim_start();
        } else {
            let (vector, after) = parse_vector(rest, space_dimension).ok_or_else(error)?;
            directions.push(Some(vector));
            rest = after.trim_start();
        }
    }
    if directions.len() != dimension {
        return Err(error());
    }
    Ok(Some(directions))
}

/// Parses `(a,b,c)`; missing coordinates of a space with fewer dimensions are 0.
fn parse_vector(text: &str, dimension: usize) -> Option<(Vec3, &str)> {
    let (inside, rest) = text.strip_prefix('(')?.split_once(')')?;
    let mut vector = [0.0; 3];
    let mut count = 0;
    for part in inside.split(',') {
        *vector.get_mut(count)? = part.trim().parse().ok()?;
        count += 1;
    }
    (count == dimension).then_some((vector, rest))
}

/// Indices of the axes that are space, ascending and next to each other.
fn spatial_axes(
    header: &Header,
    sizes: &[i128],
    directions: Option<&[Option<Vec3>]>,
    notices: &mut Vec<String>,
) -> Result<Vec<usize>, FormatError> {
    let dimension = sizes.len();
    let is_space: Vec<bool> = if let Some(directions) = directions {
        directions.iter().map(Option::is_some).collect()
    } else if let Some(kinds) = header.per_axis("kinds", dimension)? {
        kinds.iter().map(|kind| is_spatial_kind(kind, dimension)).collect()
    } else if dimension <= 3 {
        vec![true; dimension]
    } else {
        // Nothing says what the axes are: colours come first, times last.
        let components = dimension == 4 && sizes[0] <= MAX_GUESSED_COMPONENTS;
        let first = usize::from(components);
        notices.push(format!(
            "the file does not say which of its {dimension} axes are space: axes {} to {} are \
             taken; `kinds` would say it",
            first + 1,
            first + 3
        ));
        (0..dimension).map(|axis| (first..first + 3).contains(&axis)).collect()
    };
    let spatial: Vec<usize> = (0..dimension).filter(|axis| is_space[*axis]).collect();
    if !(2..=3).contains(&spatial.len()) {
        let expected = "two or three axes of space, the rest components or volumes";
        let got = format!("{} of {dimension} axes", spatial.len());
        return Err(FormatError::field(&header.file, "kinds or space directions", got, expected));
    }
    if spatial[spatial.len() - 1] - spatial[0] != spatial.len() - 1 {
        return Err(FormatError::unsupported(
            &header.file,
            "an axis of components or volumes between the axes of space",
            "move it first or last, for example with `unu permute`",
        ));
    }
    Ok(spatial)
}

/// Whether an axis of a kind is space. Unknown kinds count as space in files of three axes.
fn is_spatial_kind(kind: &str, dimension: usize) -> bool {
    match kind.to_lowercase().as_str() {
        "domain" | "space" => true,
        "???" | "none" => dimension <= 3,
        _ => false,
    }
}

/// Spacing of the spatial axes, and their place in patient space if the file has one.
fn steps(
    header: &Header,
    sizes: &[i128],
    spatial: &[usize],
    directions: Option<Vec<Option<Vec3>>>,
    space: Option<Space>,
    notices: &mut Vec<String>,
) -> Result<(Vec3, Option<Affine>), FormatError> {
    let Some(directions) = directions else {
        return Ok((spacings(header, sizes, spatial, notices)?, None));
    };
    let mut columns = [[0.0; 3]; 3];
    for (column, axis) in columns.iter_mut().zip(spatial) {
        *column = directions[*axis].unwrap_or_default();
    }
    if spatial.len() == 2 {
        // A flat image: the third axis stands upright on it.
        let normal = cross(columns[0], columns[1]);
        columns[2] = normal.map(|c| c / norm(normal));
    }
    let to_lps = match space {
        Some(Space::Anatomical(signs)) => Some(signs),
        _ => None,
    };
    let signs = to_lps.unwrap_or([1.0; 3]);
    let turn = |v: Vec3| [v[0] * signs[0], v[1] * signs[1], v[2] * signs[2]];
    let origin = match header.get("spaceorigin") {
        None => [0.0; 3],
        // Only anatomical spaces have a use for it.
        Some(_) if to_lps.is_none() => [0.0; 3],
        Some(text) => parse_vector(text, 3)
            .map(|(vector, _)| vector)
            .filter(|vector| vector.iter().all(|c| c.is_finite()))
            .ok_or_else(|| FormatError::field(&header.file, "space origin", text, "a vector like (0,0,0)"))?,
    };
    let affine = Affine::from_columns(columns.map(turn), turn(origin)).ok_or_else(|| {
        let text = header.get("spacedirections").unwrap_or_default();
        let expected = "vectors of sensible length that span space";
        FormatError::field(&header.file, "space directions", text, expected)
    })?;
    if to_lps.is_none() {
        notices.push("the space is not anatomical: the axes stay as stored".to_owned());
    }
    Ok((affine.spacing, to_lps.map(|_| affine)))
}

/// Spacing from `spacings`, else from `axis mins` and `axis maxs`, else 1.
fn spacings(
    header: &Header,
    sizes: &[i128],
    spatial: &[usize],
    notices: &mut Vec<String>,
) -> Result<Vec3, FormatError> {
    let dimension = sizes.len();
    let mut all = header.numbers_per_axis("spacings", dimension)?;
    if all.is_none() {
        let mins = header.numbers_per_axis("axismins", dimension)?;
        let maxs = header.numbers_per_axis("axismaxs", dimension)?;
        let centers = match header.per_axis("centers", dimension)? {
            Some(centers) => Some(centers),
            None => header.per_axis("centerings", dimension)?,
        };
        if let (Some(mins), Some(maxs)) = (mins, maxs) {
            let step = |axis: usize| {
                // Node-centred samples lie on both ends, cell-centred ones half a step inside.
                let is_node = centers.as_ref().is_some_and(|c| c[axis] == "node");
                let steps = (sizes[axis] as f64 - f64::from(u8::from(is_node))).max(1.0);
                (maxs[axis] - mins[axis]) / steps
            };
            all = Some((0..dimension).map(step).collect());
        }
    }
    let Some(all) = all else {
        notices.push("the file gives no spacing: 1 is taken along every axis".to_owned());
        return Ok([1.0; 3]);
    };
    let mut spacing = [1.0; 3];
    for (value, axis) in spacing.iter_mut().zip(spatial) {
        *value = all[*axis];
    }
    if spacing.iter().any(|s| *s < 0.0) {
        notices.push("negative spacings: their size is taken, the axes stay as stored".to_owned());
    }
    Ok(spacing.map(f64::abs))
}

/// The unit of length, where all spatial axes agree on one.
fn spacing_unit(header: &Header, spatial: &[usize]) -> Option<String> {
    let quoted_words =
        |text: &str| -> Vec<String> { text.split('"').skip(1).step_by(2).map(str::to_owned).collect() };
    let units: Vec<String> = if let Some(text) = header.get("spaceunits") {
        quoted_words(text)
    } else {
        let all = quoted_words(header.get("units")?);
        spatial.iter().filter_map(|axis| all.get(*axis).cloned()).collect()
    };
    let first = units.first().filter(|unit| !matches!(unit.trim(), "" | "???" | "none"))?;
    units.iter().all(|unit| unit == first).then(|| first.chars().take(MAX_UNIT_CHARS).collect())
}

/// Longest unit that is kept, in characters.
const MAX_UNIT_CHARS: usize = 16;
