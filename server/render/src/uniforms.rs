//! What the shaders read, laid out as WGSL lays it out. `tests/shaders.rs` proves every offset
//! against naga's.

use bytemuck::{Pod, Zeroable};

/// Most clip planes; `proto::scene_file::limits::MAX_CLIP_PLANES`.
pub const MAX_PLANES: usize = 8;

/// `Frame` of shaders/shared/frame.wgsl, where the fields are explained.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct FrameUniform {
    pub eye: [f32; 3],
    pub half_height: f32,
    pub forward: [f32; 3],
    pub projection: u32,
    pub right: [f32; 3],
    pub step_world: f32,
    pub up: [f32; 3],
    pub termination: f32,
    pub size_world: [f32; 3],
    pub s_scale: f32,
    pub voxels: [f32; 3],
    pub s_offset: f32,
    pub clip_low: [f32; 3],
    pub plane_count: u32,
    pub clip_high: [f32; 3],
    pub light_count: u32,
    pub background: [f32; 3],
    pub skip_empty: u32,
    pub ambient: [f32; 3],
    pub point_count: u32,
    pub image: [u32; 2],
    pub first_row: u32,
    pub row_count: u32,
    pub subpixel: [f32; 2],
    pub lattice_shift: f32,
    pub sample_index: u32,
    pub segments_kept: u32,
    pub first_part: u32,
    pub matter_cells: [u32; 2],
    pub matter_range: [f32; 2],
    pub value_scale: f32,
    pub value_offset: f32,
    pub surface: [f32; 4],
    pub map_x: [f32; 3],
    pub pad3: u32,
    pub map_y: [f32; 3],
    pub pad4: u32,
    pub map_z: [f32; 3],
    pub pad5: u32,
    pub backdrop: [f32; 3],
    pub pad6: u32,
    pub planes: [[f32; 4]; MAX_PLANES],
}

/// `Material` of shaders/shared/medium.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Material {
    pub phase: u32,
    pub asymmetry: f32,
    pub surface: f32,
    pub brdf: u32,
    pub ambient_diffuse: f32,
    pub ambient_specular: f32,
    pub diffuse: f32,
    pub specular: f32,
    pub lobe: [f32; 2],
    pub lobe_mass: f32,
    pub lobe_reflectance: f32,
    pub bands: [[f32; 4]; 3],
}

/// `Field` of shaders/shared/light_field.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Field {
    pub dims: [f32; 3],
    pub scale: f32,
    pub direct_cells: [f32; 3],
    pub near: f32,
    pub direct_nodes: [f32; 3],
    pub clip_blocks: u32,
    pub reach: f32,
    pub pad0: f32,
    pub pad1: f32,
    pub pad2: f32,
}

/// `DirectRun` of shaders/direct_light/march.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct DirectRun {
    pub nodes: [u32; 3],
    pub slot: u32,
    pub first: u32,
    pub count: u32,
    pub tests: u32,
    pub rays: u32,
    pub position: [f32; 3],
    pub kind: u32,
    pub direction: [f32; 3],
    pub extent: f32,
    pub half_u: [f32; 3],
    pub pad0: u32,
    pub half_v: [f32; 3],
    pub pad1: u32,
}

/// `Light` of shaders/shared/light.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Light {
    pub position: [f32; 3],
    pub kind: u32,
    pub direction: [f32; 3],
    pub extent: f32,
    pub power: [f32; 3],
    pub cos_inner: f32,
    pub cos_outer: f32,
    pub slot: u32,
    pub pad0: u32,
    pub pad1: u32,
}

/// `Source` of shaders/shared/sources.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Source {
    pub position: [f32; 3],
    pub kind: u32,
    pub direction: [f32; 3],
    pub extent: f32,
    pub power: [f32; 3],
    pub cos_inner: f32,
    pub half_u: [f32; 3],
    pub cos_outer: f32,
    pub half_v: [f32; 3],
    pub pad0: u32,
}

/// `PathTracer` of shaders/path_traced/path_traced.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct PathTracer {
    pub seed: u32,
    pub wanted: u32,
    pub rays: u32,
    pub steps: u32,
    pub source_count: u32,
    pub orders: u32,
    pub longest: u32,
    pub fresh: u32,
    pub clip_shadows: u32,
    pub last_ray_matters: u32,
    pub pad0: u32,
    pub pad1: u32,
}

/// `Path` of shaders/shared/path.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Path {
    pub origin: [f32; 3],
    pub t: f32,
    pub direction: [f32; 3],
    pub lookup: f32,
    pub throughput: [f32; 3],
    pub optical_depth: f32,
    pub radiance: [f32; 3],
    pub transmittance: f32,
    pub w_o: [f32; 3],
    pub s: f32,
    pub n: [f32; 3],
    pub density: f32,
    pub weight: [f32; 3],
    pub end: f32,
    pub stage: u32,
    pub light: u32,
    pub scatterings: u32,
    pub draws: u32,
}

/// `Photons` of shaders/photon_map/trace.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Photons {
    pub first: u32,
    pub count: u32,
    pub key: u32,
    pub light: u32,
    pub slots: u32,
    pub rays: u32,
    pub steps: u32,
    pub direct: u32,
    pub bins: [u32; 2],
    pub blocks: [u32; 2],
    pub dims: [u32; 3],
    pub everything: u32,
    pub radius: f32,
    pub reference: f32,
    pub seed: u32,
    pub clip_shadows: u32,
    pub listed: u32,
    pub list: u32,
    pub next_list: u32,
    pub pad0: u32,
}

/// `Mass` of shaders/photon_map/mass.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Mass {
    pub dims: [u32; 3],
    pub count: u32,
}

/// `SeenPart` of shaders/photon_map/parts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct SeenPart {
    pub x: [f32; 3],
    pub material: u32,
    pub albedo: [f32; 3],
    pub surface: f32,
    pub n: [f32; 3],
    pub count: u32,
    pub weight: [f32; 3],
    pub pad0: u32,
    pub gathered: [f32; 3],
    pub pad1: u32,
}

/// `Gather` of shaders/photon_map/kernel.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Gather {
    pub dims: [f32; 3],
    pub places_per_cell: f32,
    pub cells: [u32; 3],
    pub first: u32,
}

/// `Fill` of shaders/photon_map/texels.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Fill {
    pub dims: [u32; 3],
    pub everything: u32,
    pub flux: [f32; 3],
    pub turn: u32,
    pub weight_of_mass: f32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// Most light layers: 8 lights, what lies behind the volume, and glowing matter.
pub const MAX_LAYERS: usize = 10;

/// `Mix` of shaders/path_traced/mix_lights.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Mix {
    pub first_pixel: u32,
    pub pixel_count: u32,
    pub term_count: u32,
    pub pad0: u32,
    pub powers: [[f32; 4]; MAX_LAYERS],
}

/// `Restart` of shaders/path_traced/restart.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Restart {
    pub image: [u32; 2],
    pub bins: [u32; 2],
}

/// `DifferencePart` of shaders/refinement/parts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct DifferencePart {
    pub image: [u32; 2],
    pub stride: u32,
    pub noise: f32,
    pub centre: f32,
    pub pad0: f32,
    pub pad1: [f32; 2],
}

/// `LightGrid` of shaders/convection_diffusion/grid.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct LightGrid {
    pub cells: [u32; 3],
    pub first: u32,
    pub cell_size: [f32; 3],
    pub count: u32,
    pub points: [u32; 3],
    pub row: u32,
    pub clip_shadows: u32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// `Sweep` of shaders/convection_diffusion/sweep.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Sweep {
    pub cells: [u32; 3],
    pub axis: u32,
    pub cell_size: [f32; 3],
    pub forward: u32,
    pub origin: [f32; 3],
    pub from_place: u32,
    pub base: [f32; 2],
    pub spacing: [f32; 2],
    pub slope: [f32; 2],
    pub lines: [u32; 2],
    pub first_plane: u32,
    pub plane_count: u32,
    pub start_plane: u32,
    pub slot: u32,
}

/// `Front` of shaders/convection_diffusion/upwind.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Front {
    pub cells: [u32; 3],
    pub front: u32,
    pub cell_size: [f32; 3],
    pub from_place: u32,
    pub light: [f32; 3],
    pub slot: u32,
    pub start: [u32; 3],
    pub step: u32,
    pub origin: [u32; 2],
    pub pad0: u32,
    pub pad1: u32,
}

/// `Level` of shaders/convection_diffusion/level.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Level {
    pub cells: [u32; 3],
    pub offset: u32,
    pub weights: [f32; 3],
    pub count: u32,
    pub coarse_cells: [u32; 3],
    pub coarse_offset: u32,
    pub factors: [u32; 3],
    pub coarse_count: u32,
}

/// Most lights a light grid takes; as in shaders/convection_diffusion/direct.wgsl.
pub const MAX_FIELD_LIGHTS: usize = 64;

/// `Sources` of shaders/convection_diffusion/direct.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Sources {
    pub ambient: [f32; 3],
    pub count: u32,
    pub inverse_scale: f32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
    pub outside: [[f32; 4]; 6],
    pub slots: [[u32; 4]; MAX_FIELD_LIGHTS / 4],
}

/// `Compose` of shaders/convection_diffusion/compose.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Compose {
    pub bands: u32,
    pub diffusion: u32,
    pub pad0: u32,
    pub pad1: u32,
}

/// `Heat` of shaders/convection_diffusion/heat.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Heat {
    pub spread: f32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// `ToneMap` of shaders/film/tone_map.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct ToneMap {
    pub exposure: f32,
    pub operator_id: u32,
    pub pixel_count: u32,
    pub pad0: u32,
}

/// `Records` of shaders/image_based/records.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Records {
    pub dims: [u32; 3],
    pub columns: u32,
    pub first: u32,
    pub count: u32,
    pub directions: u32,
    pub capacity: u32,
    pub bands: u32,
    pub scale: f32,
    pub material: u32,
    pub window: u32,
    pub own_lights: u32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
    pub eye: [f32; 4],
}

/// `Transfer` of shaders/precomputed_transfer/transfer.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Transfer {
    pub dims: [u32; 3],
    pub bases: u32,
    pub rows: u32,
    pub bands: u32,
    pub channels: u32,
    pub clip_shadows: u32,
    pub first: u32,
    pub count: u32,
    pub events: u32,
    pub photon_rays: u32,
    pub steps: u32,
    pub flights: u32,
    pub stride: u32,
    pub direction: u32,
    pub first_entry: u32,
    pub last_entry: u32,
    pub unit: f32,
    pub mean_shown: f32,
    pub photon_factor: f32,
    pub scale: f32,
    pub beam_area: f32,
    pub sign: i32,
    pub query: [u32; 4],
    pub listed: u32,
    pub old_rows: u32,
    pub tests: u32,
    pub pad0: u32,
}

/// `Beams` of shaders/precomputed_transfer/direct.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Beams {
    pub towards: [f32; 3],
    pub edge: u32,
    pub across: [f32; 3],
    pub pad0: f32,
    pub down: [f32; 3],
    pub pad1: f32,
    pub origin: [f32; 3],
    pub pad2: f32,
}

/// Field names and offsets of a struct, to be compared with naga's.
pub type Layout = (&'static str, usize, Vec<(&'static str, usize)>);

macro_rules! layout {
    ($name:literal, $kind:ty { $($field:ident),+ $(,)? }) => {
        ($name, std::mem::size_of::<$kind>(), vec![$((stringify!($field), std::mem::offset_of!($kind, $field))),+])
    };
}

/// Every struct that crosses to the GPU.
pub fn layouts() -> Vec<Layout> {
    vec![
        layout!(
            "Frame",
            FrameUniform {
                eye,
                half_height,
                forward,
                projection,
                right,
                step_world,
                up,
                termination,
                size_world,
                s_scale,
                voxels,
                s_offset,
                clip_low,
                plane_count,
                clip_high,
                light_count,
                background,
                skip_empty,
                ambient,
                point_count,
                image,
                first_row,
                row_count,
                subpixel,
                lattice_shift,
                sample_index,
                segments_kept,
                first_part,
                matter_cells,
                matter_range,
                value_scale,
                value_offset,
                surface,
                map_x,
                pad3,
                map_y,
                pad4,
                map_z,
                pad5,
                backdrop,
                pad6,
                planes,
            }
        ),
        layout!(
            "Material",
            Material {
                phase,
                asymmetry,
                surface,
                brdf,
                ambient_diffuse,
                ambient_specular,
                diffuse,
                specular,
                lobe,
                lobe_mass,
                lobe_reflectance,
                bands,
            }
        ),
        layout!(
            "Field",
            Field { dims, scale, direct_cells, near, direct_nodes, clip_blocks, reach, pad0, pad1, pad2 }
        ),
        layout!(
            "DirectRun",
            DirectRun {
                nodes,
                slot,
                first,
                count,
                tests,
                rays,
                position,
                kind,
                direction,
                extent,
                half_u,
                pad0,
                half_v,
                pad1,
            }
        ),
        layout!(
            "Light",
            Light { position, kind, direction, extent, power, cos_inner, cos_outer, slot, pad0, pad1 }
        ),
        layout!(
            "Source",
            Source { position, kind, direction, extent, power, cos_inner, half_u, cos_outer, half_v, pad0 }
        ),
        layout!(
            "PathTracer",
            PathTracer {
                seed,
                wanted,
                rays,
                steps,
                source_count,
                orders,
                longest,
                fresh,
                clip_shadows,
                last_ray_matters,
                pad0,
                pad1,
            }
        ),
        layout!(
            "Path",
            Path {
                origin,
                t,
                direction,
                lookup,
                throughput,
                optical_depth,
                radiance,
                transmittance,
                w_o,
                s,
                n,
                density,
                weight,
                end,
                stage,
                light,
                scatterings,
                draws,
            }
        ),
        layout!(
            "Photons",
            Photons {
                first,
                count,
                key,
                light,
                slots,
                rays,
                steps,
                direct,
                bins,
                blocks,
                dims,
                everything,
                radius,
                reference,
                seed,
                clip_shadows,
                listed,
                list,
                next_list,
                pad0,
            }
        ),
        layout!("Mass", Mass { dims, count }),
        layout!(
            "SeenPart",
            SeenPart { x, material, albedo, surface, n, count, weight, pad0, gathered, pad1 }
        ),
        layout!("Gather", Gather { dims, places_per_cell, cells, first }),
        layout!("Fill", Fill { dims, everything, flux, turn, weight_of_mass, pad0, pad1, pad2 }),
        layout!("Mix", Mix { first_pixel, pixel_count, term_count, pad0, powers }),
        layout!(
            "LightGrid",
            LightGrid { cells, first, cell_size, count, points, row, clip_shadows, pad0, pad1, pad2 }
        ),
        layout!(
            "Sweep",
            Sweep {
                cells,
                axis,
                cell_size,
                forward,
                origin,
                from_place,
                base,
                spacing,
                slope,
                lines,
                first_plane,
                plane_count,
                start_plane,
                slot,
            }
        ),
        layout!(
            "Level",
            Level { cells, offset, weights, count, coarse_cells, coarse_offset, factors, coarse_count }
        ),
        layout!(
            "Front",
            Front { cells, front, cell_size, from_place, light, slot, start, step, origin, pad0, pad1 }
        ),
        layout!("Sources", Sources { ambient, count, inverse_scale, pad0, pad1, pad2, outside, slots }),
        layout!("Compose", Compose { bands, diffusion, pad0, pad1 }),
        layout!("Heat", Heat { spread, pad0, pad1, pad2 }),
        layout!("Restart", Restart { image, bins }),
        layout!("DifferencePart", DifferencePart { image, stride, noise, centre, pad0, pad1 }),
        layout!(
            "Records",
            Records {
                dims,
                columns,
                first,
                count,
                directions,
                capacity,
                bands,
                scale,
                material,
                window,
                own_lights,
                pad0,
                pad1,
                pad2,
                eye,
            }
        ),
        layout!(
            "Transfer",
            Transfer {
                dims,
                bases,
                rows,
                bands,
                channels,
                clip_shadows,
                first,
                count,
                events,
                photon_rays,
                steps,
                flights,
                stride,
                direction,
                first_entry,
                last_entry,
                unit,
                mean_shown,
                photon_factor,
                scale,
                beam_area,
                sign,
                query,
                listed,
                old_rows,
                tests,
                pad0,
            }
        ),
        layout!("Beams", Beams { towards, edge, across, pad0, down, pad1, origin, pad2 }),
        layout!("ToneMap", ToneMap { exposure, operator_id, pixel_count, pad0 }),
    ]
}
