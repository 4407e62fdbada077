//! One viewer's caches: film, tables, distance map, each with the snapshot it was computed from.

use std::sync::Arc;
use std::time::Duration;

use scene::plan::{Caches, FilmState, SegmentsState, Target};
use scene::{Integrator, Scene, Snapshot};

use crate::illumination::{Illumination, Light};
use crate::renderer::{PathFilm, Refinement};
use crate::segments::Segments;
use crate::volume_texture::VolumeTexture;

/// Everything the GPU keeps for one viewer. Empty until it is first drawn; dropping it frees all.
#[derive(Default)]
pub struct View {
    pub(crate) volume: Option<(Arc<Snapshot>, Arc<VolumeTexture>)>,
    pub(crate) transfer_function: Option<(Arc<Snapshot>, TransferFunctionTables)>,
    pub(crate) distance_map: Option<(Arc<Snapshot>, wgpu::TextureView)>,
    pub(crate) majorants: Option<(Arc<Snapshot>, wgpu::TextureView)>,
    pub(crate) lights: Option<(Arc<Snapshot>, LightTables)>,
    pub(crate) environment: Option<(Arc<Snapshot>, EnvironmentTables)>,
    /// Light computed ahead.
    pub(crate) light: Light,
    pub(crate) film: Option<FilmCache>,
    /// Snapshot and film state the tone-mapped picture shows.
    pub(crate) picture: Option<(Arc<Snapshot>, Target)>,
    pub(crate) buffers: Option<ViewBuffers>,
    pub(crate) segments: Segments,
    pub(crate) paths: Option<PathFilm>,
    /// Paths beneath a film in approximate light.
    pub(crate) refinement: Option<Box<Refinement>>,
    /// Whether one bound of the extinction serves for all macrocells.
    pub(crate) global_majorant: bool,
    /// Whether segments are kept from the first picture on.
    edits_to_come: bool,
    /// Milliseconds per million pixel samples, of the last slices; sizes the next slice.
    pub(crate) millis_per_megasample: f64,
    /// How long the rays of the last call took.
    pub(crate) rays_took: Duration,
}

pub(crate) struct TransferFunctionTables {
    pub points: wgpu::TextureView,
    pub cells: wgpu::TextureView,
    pub materials: wgpu::Buffer,
}

/// Lights as the ray caster takes them, and as the path tracer does.
pub(crate) struct LightTables {
    pub lights: wgpu::Buffer,
    pub sources: wgpu::Buffer,
}

/// An environment image, and the table that directions are drawn with.
pub(crate) struct EnvironmentTables {
    pub radiance: wgpu::TextureView,
    pub draws: wgpu::TextureView,
    /// What is seen behind the volume, if that is another image: one with its suns.
    pub behind: Option<wgpu::TextureView>,
}

/// A film under way.
pub(crate) struct FilmCache {
    pub snapshot: Arc<Snapshot>,
    pub width: u32,
    pub height: u32,
    /// Complete passes over the image.
    pub samples: u32,
    /// Rows of the current pass that are done.
    pub rows: u32,
    /// Whether its rays are cast in view-ray segments, which are kept.
    pub in_segments: bool,
    /// State of the light ([`Illumination::version`]) when it was begun.
    pub light_version: u64,
}

/// Buffers of fixed meaning; the film and the picture grow with the image.
pub(crate) struct ViewBuffers {
    pub frame: wgpu::Buffer,
    pub counters: wgpu::Buffer,
    pub film: wgpu::Buffer,
    pub picture: wgpu::Buffer,
    /// Pixels the film and the picture have room for.
    pub capacity: u64,
}

impl View {
    /// A view that holds nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// A view of a session's scene, in its light.
    pub fn in_light(light: &Light) -> Self {
        Self { light: light.clone(), ..Self::default() }
    }

    /// A view of a scene that will be edited: view-ray segments are kept from the first picture
    /// on, not only from the first edit.
    pub fn for_edits() -> Self {
        Self { edits_to_come: true, ..Self::default() }
    }

    /// A view whose path tracer does without macrocells: one bound of the extinction for the whole
    /// volume. The estimate is the same, the work is not; for comparison.
    pub fn with_global_majorant() -> Self {
        Self { global_majorant: true, ..Self::default() }
    }

    /// What the plan of a picture has to know; `max_binding_bytes` is the device's.
    pub(crate) fn caches<'a>(
        &'a self,
        light: &'a Illumination,
        scene: &Scene,
        target: Target,
        max_binding_bytes: u64,
    ) -> Caches<'a> {
        let size = (target.width, target.height);
        let segments = self.segments.state(size, scene.sampling.segments, max_binding_bytes);
        Caches {
            segments: SegmentsState {
                wanted: self.edits_to_come,
                film_is_cast_in_them: self.film.as_ref().is_some_and(|film| film.in_segments),
                ..segments
            },
            tiles: self.paths.as_ref().map_or(&[], PathFilm::tile_bins),
            volume: self.volume.as_ref().map(|(snapshot, _)| &snapshot.scene),
            transfer_function: self.transfer_function.as_ref().map(|(snapshot, _)| &snapshot.scene),
            distance_map: self.distance_map.as_ref().map(|(snapshot, _)| &snapshot.scene),
            majorants: self.majorants.as_ref().map(|(snapshot, _)| &snapshot.scene),
            lights: self.lights.as_ref().map(|(snapshot, _)| &snapshot.scene),
            environment: self.environment.as_ref().map(|(snapshot, _)| &snapshot.scene),
            light: light.state(self.film.as_ref().map(|film| film.light_version)),
            film: self.film.as_ref().map(|film| FilmState {
                scene: &film.snapshot.scene,
                held: Target { width: film.width, height: film.height, samples_per_pixel: film.samples },
                error: self.error(),
            }),
            picture: self.picture.as_ref().map(|(snapshot, held)| FilmState {
                scene: &snapshot.scene,
                held: *held,
                error: None,
            }),
        }
    }

    /// Relative standard error of the film, if it is path-traced and known.
    pub(crate) fn error(&self) -> Option<f64> {
        let film = self.film.as_ref()?;
        let traced = film.snapshot.scene.integrator() == Integrator::PathTracer;
        let estimate = self.paths.as_ref().filter(|_| traced)?.estimate?;
        Some(estimate.relative_error)
    }

    /// Bytes of what the path tracer keeps.
    pub fn path_bytes(&self) -> u64 {
        self.paths.as_ref().map_or(0, PathFilm::bytes)
    }

    /// Bytes of film and picture.
    pub fn bytes(&self) -> u64 {
        self.buffers.as_ref().map_or(0, |buffers| buffers.capacity * (FILM_PIXEL_BYTES + PICTURE_PIXEL_BYTES))
    }

    /// Bytes of all it keeps for itself; the volume is shared and counted once for all, and so is light.
    pub fn total_bytes(&self) -> u64 {
        let refinement = self.refinement.as_ref().map_or(0, |refinement| refinement.bytes());
        self.bytes() + self.segment_bytes() + self.path_bytes() + refinement
    }

    /// What is shown in place of the film, if paths have refined it.
    pub(crate) fn refined(&self) -> Option<&Refinement> {
        self.refinement.as_deref().filter(|refinement| refinement.paths > 0)
    }

    /// Its light.
    pub fn light(&self) -> &Light {
        &self.light
    }

    /// Bytes of view-ray segments.
    pub fn segment_bytes(&self) -> u64 {
        self.segments.bytes()
    }
}

/// Sums of red, green, blue and the number of samples, f32 each.
pub(crate) const FILM_PIXEL_BYTES: u64 = 16;
/// RGBA, 8 bits each.
pub(crate) const PICTURE_PIXEL_BYTES: u64 = 4;
