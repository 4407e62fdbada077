//! Moving voxels to another axis order.

use rayon::prelude::*;
use scene::Voxels;

/// Edge of the cube of voxels moved at a time: both sides of an exchange of axes stay in the
/// cache.
const TILE: usize = 32;

/// Which file axis becomes which world axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Axes {
    /// World axis `w` takes file axis `permutation[w]`.
    pub(crate) permutation: [usize; 3],
    /// World axis `w` runs against its file axis.
    pub(crate) flip: [bool; 3],
}

/// Puts the voxels of a grid of `dims` (file axes) into world order.
pub(crate) fn reorder_voxels(voxels: Voxels, dims: [usize; 3], axes: Axes) -> Voxels {
    if axes == (Axes { permutation: [0, 1, 2], flip: [false; 3] }) {
        return voxels;
    }
    match voxels {
        Voxels::U8(v) => Voxels::U8(reorder(&v, dims, axes)),
        Voxels::U16(v) => Voxels::U16(reorder(&v, dims, axes)),
        Voxels::I16(v) => Voxels::I16(reorder(&v, dims, axes)),
        Voxels::F32(v) => Voxels::F32(reorder(&v, dims, axes)),
    }
}

fn reorder<T: Copy + Default + Send + Sync>(source: &[T], dims: [usize; 3], axes: Axes) -> Vec<T> {
    let [nx, ny, nz] = axes.permutation.map(|axis| dims[axis]);
    let file_strides = [1, dims[0], dims[0] * dims[1]];
    // Share of the file's linear index that comes from coordinate `i` of a world axis.
    let from = |world: usize, i: usize| {
        let axis = axes.permutation[world];
        let along_axis = if axes.flip[world] { dims[axis] - 1 - i } else { i };
        along_axis * file_strides[axis]
    };
    let from_x: Vec<usize> = (0..nx).map(|x| from(0, x)).collect();
    let mut target = vec![T::default(); source.len()];
    target.par_chunks_mut(nx * ny * TILE).enumerate().for_each(|(slab, out)| {
        let z_start = slab * TILE;
        let z_end = (z_start + TILE).min(nz);
        for y_start in (0..ny).step_by(TILE) {
            let y_end = (y_start + TILE).min(ny);
            for x_start in (0..nx).step_by(TILE) {
                let x_end = (x_start + TILE).min(nx);
                for z in z_start..z_end {
                    for y in y_start..y_end {
                        let base = from(2, z) + from(1, y);
                        let row = ((z - z_start) * ny + y) * nx;
                        let out_row = &mut out[row + x_start..row + x_end];
                        for (value, from_x) in out_row.iter_mut().zip(&from_x[x_start..x_end]) {
                            *value = source[base + from_x];
                        }
                    }
                }
            }
        }
    });
    target
}
