//! The scalar field and the transfer function: interpolate the data first, then look up matter.

use glam::DVec3;
use proto::scene_file::Filter;
use scene::transfer_function::Point;
use scene::volume::Voxels;
use scene::{Scene, Volume};

/// Changes of `s` per voxel up to this are rounding noise: such a place has no normal.
const FLAT: f64 = 1e-6;

/// Matter at a place.
#[derive(Debug, Clone, Copy)]
pub struct Matter {
    /// Linear RGB, 0..1.
    pub albedo: DVec3,
    /// Emitted radiance, linear RGB.
    pub emission: DVec3,
    /// Index into the scene's materials.
    pub material: usize,
}

/// `s` as a function of place, and matter as a function of `s`.
pub struct Field<'a> {
    volume: &'a Volume,
    filter: Filter,
    size_world: DVec3,
    voxels: DVec3,
    value_range: [f64; 2],
    points: &'a [Point],
}

impl<'a> Field<'a> {
    /// The scene's.
    pub fn new(scene: &'a Scene) -> Self {
        let volume = &scene.volume.volume;
        Self {
            volume,
            filter: scene.filter,
            size_world: scene.grid.size_world,
            voxels: DVec3::from_array(volume.dims.map(|n| n as f64)),
            value_range: scene.value_range,
            points: &scene.transfer_function.points,
        }
    }

    /// Voxel coordinates of a world position: the centre of voxel i lies at i + 0.5.
    pub fn voxel_from_world(&self, x: DVec3) -> DVec3 {
        (x / self.size_world + 0.5) * self.voxels
    }

    /// Edges of a voxel, world units.
    pub fn voxel_size(&self) -> DVec3 {
        self.size_world / self.voxels
    }

    /// Voxels along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.volume.dims
    }

    /// `s` of a voxel, not clamped.
    pub fn s_of_voxel(&self, index: usize) -> f64 {
        self.s_of_stored(f64::from(self.volume.voxels.stored(index)))
    }

    fn s_of_stored(&self, stored: f64) -> f64 {
        let [low, high] = self.value_range;
        if high <= low {
            return 0.0;
        }
        (self.volume.slope * stored + self.volume.intercept - low) / (high - low)
    }

    /// `s` at a world position, 0..1.
    pub fn s(&self, x: DVec3) -> f64 {
        self.s_unclamped(self.voxel_from_world(x)).clamp(0.0, 1.0)
    }

    /// `s` at voxel coordinates; edge values extend beyond the outer voxel centres.
    fn s_unclamped(&self, p: DVec3) -> f64 {
        self.s_of_stored(match &self.volume.voxels {
            Voxels::U8(v) => self.stored_at(p, |i| f64::from(v[i])),
            Voxels::U16(v) => self.stored_at(p, |i| f64::from(v[i])),
            Voxels::I16(v) => self.stored_at(p, |i| f64::from(v[i])),
            Voxels::F32(v) => self.stored_at(p, |i| f64::from(v[i])),
        })
    }

    fn stored_at(&self, p: DVec3, voxel: impl Fn(usize) -> f64) -> f64 {
        let [nx, ny, nz] = self.volume.dims;
        // `as usize` brings what is below 0 to 0.
        if self.filter == Filter::Nearest {
            let [x, y, z] =
                [(p.x as usize).min(nx - 1), (p.y as usize).min(ny - 1), (p.z as usize).min(nz - 1)];
            return voxel((z * ny + y) * nx + x);
        }
        let at = |p: f64, n: usize| {
            let p = p - 0.5;
            let low = p.floor();
            [(low as usize).min(n - 1), ((low + 1.0) as usize).min(n - 1)].map(|i| (i, p - low))
        };
        let ([(x0, fx), (x1, _)], [(y0, fy), (y1, _)], [(z0, fz), (z1, _)]) =
            (at(p.x, nx), at(p.y, ny), at(p.z, nz));
        let along_x = |y: usize, z: usize| {
            let row = (z * ny + y) * nx;
            let (a, b) = (voxel(row + x0), voxel(row + x1));
            a + fx * (b - a)
        };
        let along_y = |z: usize| {
            let (a, b) = (along_x(y0, z), along_x(y1, z));
            a + fy * (b - a)
        };
        let (a, b) = (along_y(z0), along_y(z1));
        a + fz * (b - a)
    }

    /// Direction in which `s` grows at a world position, unit: central differences one voxel to
    /// either side, before clamping. `None` where the field is flat.
    pub fn normal(&self, x: DVec3) -> Option<DVec3> {
        let p = self.voxel_from_world(x);
        let voxel = self.voxel_size();
        let along = |axis: DVec3| self.s_unclamped(p + axis) - self.s_unclamped(p - axis);
        let gradient = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)) / (2.0 * voxel);
        let steepness = gradient.length();
        (steepness * voxel.min_element() >= FLAT).then(|| gradient / steepness)
    }

    /// Number of points at or below `s`: the piece of the transfer function that holds there.
    pub fn piece(&self, s: f64) -> usize {
        self.points.partition_point(|point| point.s <= s)
    }

    /// Values of `s` between which a piece lies.
    pub fn piece_interval(&self, piece: usize) -> [f64; 2] {
        let low = if piece == 0 { f64::NEG_INFINITY } else { self.points[piece - 1].s };
        [low, self.points.get(piece).map_or(f64::INFINITY, |point| point.s)]
    }

    /// The points around `s` on a piece, and the share of the second.
    fn around(&self, piece: usize, s: f64) -> (&Point, &Point, f64) {
        let before = &self.points[piece.saturating_sub(1)];
        let after = self.points.get(piece).unwrap_or(before);
        let width = after.s - before.s;
        let share = if width > 0.0 { ((s - before.s) / width).clamp(0.0, 1.0) } else { 0.0 };
        (before, after, share)
    }

    /// Extinction at `s` on a piece, per world unit.
    pub fn sigma_t_on(&self, piece: usize, s: f64) -> f64 {
        let (before, after, share) = self.around(piece, s);
        before.sigma_t + share * (after.sigma_t - before.sigma_t)
    }

    /// Extinction at `s`, per world unit.
    pub fn sigma_t(&self, s: f64) -> f64 {
        self.sigma_t_on(self.piece(s), s)
    }

    /// Matter at `s` on a piece.
    pub fn matter_on(&self, piece: usize, s: f64) -> Matter {
        let (before, after, share) = self.around(piece, s);
        Matter {
            albedo: before.albedo + share * (after.albedo - before.albedo),
            emission: before.emission + share * (after.emission - before.emission),
            material: before.material,
        }
    }

    /// Largest extinction that occurs for `s` in the closed interval, limits from both sides of
    /// its ends included.
    pub fn largest_sigma_t(&self, low: f64, high: f64) -> f64 {
        let ends = self.sigma_t(low).max(self.sigma_t(high));
        let inside = self.points.iter().filter(|point| (low..=high).contains(&point.s));
        inside.fold(ends, |largest, point| largest.max(point.sigma_t))
    }
}
