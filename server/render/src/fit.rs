//! As much of a volume as the device can show: all of it if it fits, else a coarser level, or a
//! region of it; with words for what is missing.

use std::sync::Arc;

use proto::rest::ShownVolume;
use scene::PreparedVolume;
use scene::levels::coarsest;
use scene::part::{Part, Room, Wish, bytes_of, choose};

use crate::error::RenderError;
use crate::volume_texture::VolumeCache;

/// Largest volume texture where nothing else is said, bytes.
pub const DEFAULT_MAX_TEXTURE_BYTES: u64 = 4 << 30;

/// Voxels that fit, uploaded.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// What a scene is made of.
    pub volume: Arc<PreparedVolume>,
    /// What it is of the whole; `None`: the whole at full resolution.
    pub shown: Option<ShownVolume>,
}

/// Uploads as much of a whole volume as fits into `max_bytes` and the device; where the device runs
/// out of memory all the same, the next coarser level. `part_of` makes the parts.
///
/// # Errors
/// Those of `part_of`; GPU errors; out of memory even for a single voxel.
pub fn fit<E: From<RenderError>>(
    cache: &VolumeCache,
    whole: &Arc<PreparedVolume>,
    wish: &Wish,
    max_bytes: u64,
    part_of: impl FnMut(&Part) -> Result<Arc<PreparedVolume>, E>,
) -> Result<Fitted, E> {
    let volume = Texels {
        dims: whole.volume.dims,
        texel_bytes: cache.texel_bytes(&whole.volume.voxels),
        room: cache.room(max_bytes),
    };
    fit_with(&volume, wish, whole, part_of, |volume| cache.load_within(volume, max_bytes).map(drop))
}

/// A volume as textures see it.
struct Texels {
    dims: [usize; 3],
    texel_bytes: u64,
    room: Room,
}

fn fit_with<E: From<RenderError>>(
    texels: &Texels,
    wish: &Wish,
    whole: &Arc<PreparedVolume>,
    mut part_of: impl FnMut(&Part) -> Result<Arc<PreparedVolume>, E>,
    mut upload: impl FnMut(&PreparedVolume) -> Result<(), RenderError>,
) -> Result<Fitted, E> {
    let mut wanted = *wish;
    loop {
        let part = choose(texels.dims, texels.texel_bytes, &wanted, &texels.room);
        let all = part == Part::whole(texels.dims) && wish.region.is_none();
        let volume = if all { whole.clone() } else { part_of(&part)? };
        match upload(&volume) {
            Ok(()) => {
                let shown = (!all).then(|| described(texels, wish, &part, wanted.level > wish.level));
                return Ok(Fitted { volume, shown });
            }
            Err(RenderError::OutOfMemory { .. } | RenderError::TooLarge { .. })
                if part.level < coarsest(texels.dims) =>
            {
                drop(volume);
                wanted.level = part.level + 1;
                tracing::warn!(level = wanted.level, "the device has no room; a coarser level is tried");
            }
            Err(error) => return Err(error.into()),
        }
    }
}

fn described(texels: &Texels, wish: &Wish, part: &Part, device_is_full: bool) -> ShownVolume {
    let narrow = |dims: [usize; 3]| dims.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    ShownVolume {
        level: part.level,
        dims: narrow(part.dims()),
        whole_dims: narrow(texels.dims),
        region: wish.region,
        notice: notice(texels, wish, part, device_is_full),
    }
}

/// What is shown and why, for people.
fn notice(texels: &Texels, wish: &Wish, part: &Part, device_is_full: bool) -> String {
    let by = |dims: [usize; 3]| format!("{}x{}x{}", dims[0], dims[1], dims[2]);
    let resolution = match part.level {
        0 => "full resolution".to_owned(),
        level => format!("1/{} resolution", 1u64 << level),
    };
    let (subject, what) = match wish.region {
        None => ("full volume", format!("shown at {resolution}")),
        Some(_) => ("full region", format!("region shown at {resolution}")),
    };
    let full = Part::of_region(texels.dims, 0, wish.region).dims();
    let sizes = match wish.region {
        None => format!("{} of {}", by(part.dims()), by(texels.dims)),
        Some(_) => format!("{} voxels of a volume of {}", by(part.dims()), by(texels.dims)),
    };
    // Coarser than asked for?
    let asked = Part::of_region(texels.dims, wish.level.min(coarsest(texels.dims)), wish.region);
    let longest = full.into_iter().max().unwrap_or(0);
    let why = if part.level <= asked.level {
        (part.level > 0).then(|| "as the scene asks".to_owned())
    } else if device_is_full {
        Some(format!("the GPU has no room for more; the {subject} needs {}", bytes(texels, full)))
    } else if longest > texels.room.max_edge {
        Some(format!("an edge of {longest} voxels is longer than the {} the GPU takes", texels.room.max_edge))
    } else {
        let allowed = in_words(texels.room.max_bytes);
        Some(format!("the {subject} needs {} of the {allowed} allowed", bytes(texels, full)))
    };
    match why {
        Some(why) => format!("{what} ({sizes}): {why}"),
        None => format!("{what} ({sizes})"),
    }
}

fn bytes(texels: &Texels, dims: [usize; 3]) -> String {
    in_words(bytes_of(dims, texels.texel_bytes))
}

/// Bytes with three digits at most before the unit.
fn in_words(bytes: u64) -> String {
    const UNITS: [&str; 6] = ["bytes", "kB", "MB", "GB", "TB", "PB"];
    let mut amount = bytes as f64;
    let mut unit = 0;
    while amount >= 999.5 && unit + 1 < UNITS.len() {
        amount /= 1000.0;
        unit += 1;
    }
    let digits = usize::from(unit > 0 && amount < 9.95);
    format!("{amount:.digits$} {}", UNITS[unit])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::scene_file::Filter;
    use scene::levels::Reduction;
    use scene::{Volume, Voxels};

    const ALL: Wish = Wish { level: 0, region: None, filter: Filter::Linear };

    fn whole() -> Arc<PreparedVolume> {
        let volume = Volume::new([16, 8, 8], Voxels::U8((0..1024).map(|i| (i % 251) as u8).collect()));
        Arc::new(PreparedVolume::new(volume, &|_| {}))
    }

    /// Fits into a device that has `memory` bytes, whatever it says it has.
    fn fitted(wish: &Wish, room: Room, memory: u64) -> Result<Fitted, RenderError> {
        let whole = whole();
        let texels = Texels { dims: whole.volume.dims, texel_bytes: 1, room };
        let part_of = |part: &Part| Ok(Arc::new(whole.part(part, wish.region, Reduction::of(wish.filter))));
        fit_with(&texels, wish, &whole, part_of, |volume| {
            let bytes = volume.volume.voxels.bytes() as u64;
            let what = String::new();
            if bytes > memory { Err(RenderError::OutOfMemory { what, bytes }) } else { Ok(()) }
        })
    }

    fn notice_of(wish: &Wish, room: Room, memory: u64) -> String {
        fitted(wish, room, memory).unwrap().shown.unwrap().notice
    }

    #[test]
    fn what_fits_is_shown_whole_and_in_silence() {
        let room = Room { max_edge: 16, max_bytes: 1024 };
        let fitted = fitted(&ALL, room, 1024).unwrap();
        assert_eq!(fitted.shown, None);
        assert!(fitted.volume.placement.is_whole());
    }

    #[test]
    fn what_does_not_fit_is_shown_coarser_and_says_why() {
        let room = Room { max_edge: 16, max_bytes: 1000 };
        let fitted = fitted(&ALL, room, u64::MAX).unwrap();
        let shown = fitted.shown.unwrap();
        assert_eq!((shown.level, shown.dims, shown.whole_dims), (1, [8, 4, 4], [16, 8, 8]));
        assert_eq!(
            shown.notice,
            "shown at 1/2 resolution (8x4x4 of 16x8x8): the full volume needs 1.0 kB of the 1.0 kB allowed"
        );
        assert_eq!(fitted.volume.volume.dims, [8, 4, 4]);
        let edge = notice_of(&ALL, Room { max_edge: 5, max_bytes: 4096 }, u64::MAX);
        assert_eq!(
            edge,
            "shown at 1/4 resolution (4x2x2 of 16x8x8): an edge of 16 voxels is longer than the 5 the GPU takes"
        );
        let asked = notice_of(&Wish { level: 1, ..ALL }, Room { max_edge: 16, max_bytes: 4096 }, u64::MAX);
        assert_eq!(asked, "shown at 1/2 resolution (8x4x4 of 16x8x8): as the scene asks");
    }

    #[test]
    fn a_device_that_is_full_gets_a_coarser_level() {
        let room = Room { max_edge: 16, max_bytes: 4096 };
        let full = notice_of(&ALL, room, 127);
        assert_eq!(
            full,
            "shown at 1/4 resolution (4x2x2 of 16x8x8): the GPU has no room for more; the full volume needs 1.0 kB"
        );
        assert!(matches!(fitted(&ALL, room, 0), Err(RenderError::OutOfMemory { bytes: 1, .. })));
    }

    #[test]
    fn a_region_is_shown_in_full_where_the_whole_is_not() {
        let region = Some([[0.0; 3], [0.25, 0.5, 0.5]]);
        let room = Room { max_edge: 16, max_bytes: 300 };
        let shown = fitted(&Wish { region, ..ALL }, room, u64::MAX).unwrap().shown.unwrap();
        assert_eq!((shown.level, shown.dims, shown.region), (0, [6, 6, 6], region));
        assert_eq!(shown.notice, "region shown at full resolution (6x6x6 voxels of a volume of 16x8x8)");
    }

    #[test]
    fn amounts_are_readable() {
        let said = [0, 999, 1000, 1_126_000_000, 512_000_000, 999_600, 99_949].map(in_words);
        assert_eq!(said, ["0 bytes", "999 bytes", "1.0 kB", "1.1 GB", "512 MB", "1.0 MB", "100 kB"]);
    }
}
