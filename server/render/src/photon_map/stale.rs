//! What of a photon map an edit makes stale.

use glam::DVec3;
use scene::light::Light;
use scene::{Changes, Grid, Scene};

/// Edge of the grid of blocks that photons remember.
const BLOCKS: usize = 4;

/// What changed between scenes that interactions may have relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Query {
    /// Bins in which matter changed.
    pub bins: u64,
    /// Of 4^3 blocks of the box those in which other matter is clipped away.
    pub blocks: u64,
    /// Whether everything is stale, whatever it relied on.
    pub everything: bool,
}

impl Query {
    /// For photons of a light.
    pub fn between(old: &Scene, new: &Scene, light: &Light) -> Self {
        let then = old.lights.iter().find(|other| other.id == light.id);
        let moved = then.is_none_or(|other| other.geometry != light.geometry);
        let of_matter = Self::of_matter(old, new);
        Self { everything: of_matter.everything || moved, ..of_matter }
    }

    /// For photons that come from where they came from.
    pub fn of_matter(old: &Scene, new: &Scene) -> Self {
        let changes = Changes::between(old, new);
        Self {
            bins: changes.bins & new.volume.macrocells.occurring(new.filter),
            blocks: if changes.clip { blocks_clipped_anew(old, new) } else { 0 },
            everything: changes.volume || changes.clip_shadows,
        }
    }

    pub fn or(self, other: Self) -> Self {
        Self {
            bins: self.bins | other.bins,
            blocks: self.blocks | other.blocks,
            everything: self.everything || other.everything,
        }
    }

    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Blocks of which one of the scenes keeps another part than the other does, or may.
fn blocks_clipped_anew(old: &Scene, new: &Scene) -> u64 {
    let changed = |block: usize| {
        let corner = |offset: usize| {
            let index = [block % BLOCKS, block / BLOCKS % BLOCKS, block / (BLOCKS * BLOCKS)];
            let unit = [0, 1, 2].map(|axis| (index[axis] + (offset >> axis & 1)) as f64 / BLOCKS as f64);
            DVec3::from_array(unit)
        };
        let corners: Vec<DVec3> = (0..8).map(corner).collect();
        match (kept(old, &corners), kept(new, &corners)) {
            (Some(a), Some(b)) => a != b,
            _ => true,
        }
    };
    (0..BLOCKS.pow(3)).filter(|&block| changed(block)).fold(0, |mask, block| mask | 1 << block)
}

/// Whether all that lies between corners of the unit box is kept, or nothing of it; `None`: neither
/// is sure.
pub(crate) fn kept(scene: &Scene, corners: &[DVec3]) -> Option<bool> {
    let grid: &Grid = &scene.grid;
    let [low, high] = scene.clip.bounds;
    // Half-spaces: heights of the corners above the plane that keeps what is above it.
    let sides = (0..3).flat_map(|axis| {
        let above = corners.iter().map(move |c| c[axis] - low[axis]).collect::<Vec<f64>>();
        let below = corners.iter().map(move |c| high[axis] - c[axis]).collect();
        [above, below]
    });
    let planes = scene.clip.planes.iter().map(|(normal, offset)| {
        corners.iter().map(|&c| normal.dot(grid.world_from_unit(c)) - offset).collect::<Vec<f64>>()
    });
    let heights: Vec<Vec<f64>> = sides.chain(planes).collect();
    if heights.iter().any(|heights| heights.iter().all(|&height| height < -MARGIN)) {
        return Some(false);
    }
    let inside = heights.iter().flatten().all(|&height| height >= -EDGE);
    inside.then_some(true)
}

/// World units by which a block must lie behind a plane to be cut away for certain.
const MARGIN: f64 = 1e-5;
/// The box's own faces keep it.
const EDGE: f64 = 1e-12;
