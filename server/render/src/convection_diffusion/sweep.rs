//! Characteristics of a light, laid out over the light grid (shaders/convection_diffusion/sweep.wgsl).

use glam::{DVec2, DVec3};
use scene::light::LightGeometry;

use crate::uniforms::Sweep;

/// Distance between characteristics, in cells, where they run askew: below 1, so that the nearest
/// one to a cell's centre is always inside the box.
const LINE_SPACING: f64 = 0.9;

/// A light farther away than this many times the grid's longest edge, in cells, counts as parallel:
/// over the box its directions differ by less than f32 coordinates tell apart.
const PARALLEL_BEYOND: f64 = 1000.0;

/// The light grid: cells, and how large each is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cells {
    /// Cells along x, y, z.
    pub dims: [u32; 3],
    /// Edges of a cell, world units.
    pub size: DVec3,
}

impl Cells {
    /// All of them.
    pub fn count(&self) -> u64 {
        self.dims.iter().map(|&n| u64::from(n)).product()
    }

    /// A place of the world, in cells from the box's lower corner; the box is centred at the origin.
    fn coordinates(&self, world: DVec3) -> DVec3 {
        world / self.size + 0.5 * self.edges()
    }

    fn edges(&self) -> DVec3 {
        DVec3::from_array(self.dims.map(f64::from))
    }
}

/// Where light comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// From so far away that it is parallel: the way it travels.
    Afar(DVec3),
    /// From a place, in cells from the box's lower corner.
    At(DVec3),
}

/// Where a light comes from; `None` for an environment. Area lights act from their centre.
pub fn source_of(geometry: &LightGeometry, cells: &Cells) -> Option<Source> {
    let place = match geometry {
        LightGeometry::Directional { direction } => return Some(Source::Afar(*direction)),
        LightGeometry::Point { position } | LightGeometry::Spot { position, .. } => *position,
        // A lamp under a ceiling shares a cell with it: its light sets out one cell in front of it.
        LightGeometry::Rectangle { center, normal, .. } | LightGeometry::Disk { center, normal, .. } => {
            *center + *normal * cells.size.max_element()
        }
        LightGeometry::Sphere { center, .. } => *center,
        LightGeometry::UniformEnvironment | LightGeometry::Environment { .. } => return None,
    };
    let from = cells.coordinates(place);
    let far = PARALLEL_BEYOND * cells.edges().max_element();
    let is_far = (from - 0.5 * cells.edges()).abs().max_element() > far;
    Some(if is_far { Source::Afar(-place.normalize()) } else { Source::At(from) })
}

/// The sweeps that bring a light to every cell: one for a light from afar, up to six for one with a
/// place. None for an environment.
pub fn sweeps(geometry: &LightGeometry, cells: &Cells, slot: u32) -> Vec<Sweep> {
    match source_of(geometry, cells) {
        None => Vec::new(),
        Some(Source::Afar(direction)) => vec![parallel(direction, cells, slot)],
        Some(Source::At(place)) => {
            let sides = (0..3).flat_map(|axis| [true, false].map(|forward| (axis, forward)));
            sides.filter_map(|(axis, forward)| from_place(place, cells, axis, forward, slot)).collect()
        }
    }
}

/// The components of a vector along the main axis and the two that follow it.
fn turned(v: DVec3, axis: usize) -> (f64, DVec2) {
    (v[axis], DVec2::new(v[(axis + 1) % 3], v[(axis + 2) % 3]))
}

fn blank(cells: &Cells, axis: usize, forward: bool, slot: u32) -> Sweep {
    let order = [axis, (axis + 1) % 3, (axis + 2) % 3];
    Sweep {
        cells: order.map(|i| cells.dims[i]),
        cell_size: order.map(|i| cells.size[i] as f32),
        axis: axis as u32,
        forward: u32::from(forward),
        slot,
        ..Sweep::default()
    }
}

fn parallel(direction: DVec3, cells: &Cells, slot: u32) -> Sweep {
    let in_cells = direction / cells.size;
    let axis = (0..3).fold(0, |best, i| if in_cells[i].abs() > in_cells[best].abs() { i } else { best });
    let (along, across) = turned(in_cells, axis);
    let slope = across / along.abs();
    let (length, edges) = turned(cells.edges(), axis);
    let mut sweep = Sweep { slope: slope.as_vec2().to_array(), ..blank(cells, axis, along > 0.0, slot) };
    for i in 0..2 {
        let shift = slope[i] * length;
        // Lines that run along the cells go through their centres.
        let (first, spacing) =
            if slope[i] == 0.0 { (-0.5, 1.0) } else { (-shift.max(0.0) - LINE_SPACING, LINE_SPACING) };
        let last = edges[i] - shift.min(0.0) + spacing;
        sweep.base[i] = first as f32;
        sweep.spacing[i] = spacing as f32;
        sweep.lines[i] = ((last - first) / spacing).ceil() as u32 + 1;
    }
    sweep.plane_count = sweep.cells[0];
    sweep
}

/// The sweep over the cells that lie from a place mostly along one axis, if there are any.
fn from_place(place: DVec3, cells: &Cells, axis: usize, forward: bool, slot: u32) -> Option<Sweep> {
    let (a, across) = turned(place, axis);
    let (length, edges) = turned(cells.edges(), axis);
    let t = if forward { a } else { length - a };
    // The first plane of cell centres ahead of the light, and the last.
    let start = (t - 0.5).ceil().max(0.0);
    let planes = length - start;
    if planes < 1.0 {
        return None;
    }
    let (near, far) = ((start + 0.5 - t).max(1e-3), length - 0.5 - t);
    let mut sweep = Sweep {
        origin: [t as f32, across.x as f32, across.y as f32],
        from_place: 1,
        first_plane: start as u32,
        start_plane: start as u32,
        plane_count: planes as u32,
        ..blank(cells, axis, forward, slot)
    };
    let far = far.max(near);
    let spacing = LINE_SPACING / far;
    for i in 0..2 {
        let (low, high) = (0.5 - across[i], edges[i] - 0.5 - across[i]);
        let low = (low / near).min(low / far).clamp(-1.0, 1.0);
        let high = (high / near).max(high / far).clamp(-1.0, 1.0);
        // All cells of these planes lie to one side, beyond the diagonal.
        if high <= -1.0 && low <= -1.0 && edges[i] - 0.5 - across[i] < -far
            || low >= 1.0 && high >= 1.0 && 0.5 - across[i] > far
        {
            return None;
        }
        let first = low - 2.0 * spacing;
        sweep.base[i] = first as f32;
        sweep.spacing[i] = spacing as f32;
        sweep.lines[i] = ((high - first) / spacing).ceil() as u32 + 3;
    }
    // The light's own cell counts from the light on.
    if t > 0.0 && t.floor() < start {
        let own = t.floor() as u32;
        sweep.plane_count += sweep.first_plane - own;
        sweep.first_plane = own;
        sweep.start_plane = own;
    }
    Some(sweep)
}
