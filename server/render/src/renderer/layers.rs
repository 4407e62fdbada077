//! Light layers of a path-traced film: what each light brings is kept apart, for white light of
//! strength 1, and the film is their sum in the lights' colours and strengths.

use std::collections::BTreeMap;

use glam::DVec3;
use proto::FieldError;
use scene::Scene;

use super::Renderer;
use super::tracing::PathFilm;
use crate::error::RenderError;
use crate::film::in_a_row;
use crate::gpu::{Gpu, buffer_entry};
use crate::tables;
use crate::uniforms::{MAX_LAYERS, Mix};
use crate::view::{View, ViewBuffers};

/// Layers that are no light's: what lies behind the volume, and glowing matter.
const OTHER_LAYERS: usize = 2;
/// Bytes of a pixel in a layer: red, green and blue of the mean over the paths of even number, and of
/// that over those of odd number, f32 each.
const LAYER_PIXEL_BYTES: u64 = 24;
/// Bytes of what a path under way has found for a layer.
const FINDING_BYTES: u64 = 12;
/// Most memory for the layers of a film: eight lights at 1920 x 1080.
const MAX_LAYER_BYTES: u64 = 512 << 20;
/// Invocations of a `mix_lights` workgroup.
const WORKGROUP: u32 = 64;
/// The field that asks for layers.
const FIELD: &str = "illumination.light_layers";

/// The layers of a film. Rows that are worked on at once have a buffer of their own, far smaller than
/// any device's largest binding.
pub(crate) struct LightLayers {
    count: usize,
    band_rows: u32,
    bands: Vec<LayerBand>,
    /// Of the paths under way.
    findings: wgpu::Buffer,
    uniform: wgpu::Buffer,
    /// What the film shows: see [`powers`].
    powers: Vec<[f32; 4]>,
    /// Pixels times layers that are not black, summed up since [`LightLayers::take_work`].
    work: u64,
}

struct LayerBand {
    layers: wgpu::Buffer,
    first_pixel: u32,
    pixels: u32,
    /// Whether the film shows these layers.
    on_film: bool,
}

impl LightLayers {
    /// Empty layers of a film; `band_rows` rows share a buffer.
    ///
    /// # Errors
    /// More than [`MAX_LAYER_BYTES`]; out of memory.
    pub fn new(
        gpu: &Gpu,
        count: usize,
        [width, height]: [u32; 2],
        band_rows: u32,
    ) -> Result<Self, RenderError> {
        let pixel_bytes = count as u64 * LAYER_PIXEL_BYTES;
        let pixels = u64::from(width) * u64::from(height);
        if pixels * pixel_bytes > MAX_LAYER_BYTES {
            let message = format!(
                "{width} x {height} pixels in {count} layers are more than {} MiB, or {} pixels; switch it \
                 off, remove lights, or draw a smaller picture",
                MAX_LAYER_BYTES >> 20,
                MAX_LAYER_BYTES / pixel_bytes
            );
            return Err(RenderError::Refused(FieldError::new(FIELD, message)));
        }
        let storage = wgpu::BufferUsages::STORAGE;
        let band = |index: u32| {
            let first_row = index * band_rows;
            let pixels = band_rows.min(height - first_row) * width;
            let layers = gpu.buffer("light layers", u64::from(pixels) * pixel_bytes, storage)?;
            Ok(LayerBand { layers, first_pixel: first_row * width, pixels, on_film: true })
        };
        let band_pixels = u64::from(band_rows.min(height)) * u64::from(width);
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            count,
            band_rows,
            bands: (0..height.div_ceil(band_rows)).map(band).collect::<Result<_, RenderError>>()?,
            findings: gpu.buffer("light found", band_pixels * count as u64 * FINDING_BYTES, storage)?,
            uniform: gpu.buffer("mix", std::mem::size_of::<Mix>() as u64, uniform)?,
            powers: Vec::new(),
            work: 0,
        })
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn bytes(&self) -> u64 {
        self.findings.size() + self.bands.iter().map(|band| band.layers.size()).sum::<u64>()
    }

    /// The buffers that paths of the band with this first row write to: its layers, and what paths
    /// under way have found.
    pub fn of_band(&self, first_row: u32) -> Option<[&wgpu::Buffer; 2]> {
        let band = self.bands.get((first_row / self.band_rows) as usize)?;
        Some([&band.layers, &self.findings])
    }

    /// The film is empty and is to show `scene`. Layers need not be cleared: how many paths they hold
    /// is counted beside them.
    pub fn begin(&mut self, scene: &Scene) {
        self.powers = powers(scene);
        self.bands.iter_mut().for_each(|band| band.on_film = true);
    }

    /// Paths were followed in the band with this first row.
    pub fn changed(&mut self, first_row: u32) {
        if let Some(band) = self.bands.get_mut((first_row / self.band_rows) as usize) {
            band.on_film = false;
        }
    }

    /// Pixels times layers that are not black, summed up since this was last asked.
    pub fn take_work(&mut self) -> u64 {
        std::mem::take(&mut self.work)
    }
}

/// Refuses more lights than there are layers for.
pub(super) fn check_count(scene: &Scene) -> Result<(), FieldError> {
    let most = MAX_LAYERS - OTHER_LAYERS;
    match scene.lights.len() {
        count if count > most && scene.has_light_layers() => {
            let message = format!("is for at most {most} lights, and there are {count}");
            Err(FieldError::new(FIELD, message))
        }
        _ => Ok(()),
    }
}

/// How many layers the scene's picture is mixed from, if it is.
pub(super) fn layer_count(scene: &Scene) -> Option<usize> {
    scene.has_light_layers().then(|| scene.lights.len() + OTHER_LAYERS)
}

/// Colour times strength, and number, of each layer that is not black, in the shader's order.
fn powers(scene: &Scene) -> Vec<[f32; 4]> {
    let lights = scene.lights.iter().map(|light| light.power);
    let glow = if scene.glows() { DVec3::ONE } else { DVec3::ZERO };
    let all = lights.chain([scene.background.power(), glow]).enumerate();
    let shining = all.filter(|(_, power)| *power != DVec3::ZERO);
    shining.map(|(layer, power)| power.as_vec3().extend(layer as f32).to_array()).collect()
}

impl Renderer {
    /// Makes the film of a scene whose layers are up to date show it.
    pub(super) fn mix_alone(
        &self,
        view: &mut View,
        scene: &Scene,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<(), RenderError> {
        let (Some(paths), Some(buffers)) = (&mut view.paths, &view.buffers) else {
            return Err(RenderError::Gpu("the film of an edit is missing".into()));
        };
        self.mix_anew(paths, buffers, scene)?;
        counters.insert("paths".into(), 0);
        count_mixed(view, counters);
        Ok(())
    }

    /// If the film shows other colours or strengths than the scene's, sums it up in those, and
    /// estimates its error again.
    pub(super) fn mix_anew(
        &self,
        paths: &mut PathFilm,
        buffers: &ViewBuffers,
        scene: &Scene,
    ) -> Result<(), RenderError> {
        let Some(layers) = &mut paths.layers else { return Ok(()) };
        let powers = powers(scene);
        if layers.powers == powers {
            return Ok(());
        }
        layers.powers = powers;
        layers.bands.iter_mut().for_each(|band| band.on_film = false);
        self.mix_changed(paths, buffers)?;
        if paths.estimate.is_some() {
            self.estimate(paths, &buffers.film)?;
        }
        Ok(())
    }

    /// Sums up the layers of bands that changed.
    pub(super) fn mix_changed(&self, paths: &mut PathFilm, buffers: &ViewBuffers) -> Result<(), RenderError> {
        let Some(layers) = &mut paths.layers else { return Ok(()) };
        let mut uniform = Mix { term_count: layers.powers.len() as u32, ..Mix::default() };
        for (slot, power) in uniform.powers.iter_mut().zip(&layers.powers) {
            *slot = *power;
        }
        for band in layers.bands.iter_mut().filter(|band| !band.on_film) {
            (uniform.first_pixel, uniform.pixel_count) = (band.first_pixel, band.pixels);
            self.gpu.queue.write_buffer(&layers.uniform, 0, bytemuck::bytes_of(&uniform));
            let entries = [
                buffer_entry(0, &layers.uniform),
                buffer_entry(1, &band.layers),
                buffer_entry(2, &buffers.film),
                buffer_entry(3, &paths.spreads),
            ];
            let groups = in_a_row(band.pixels.div_ceil(WORKGROUP));
            self.dispatch_with(&self.path_tracer.mix, &entries, groups);
            band.on_film = true;
            layers.work += u64::from(band.pixels) * layers.powers.len() as u64;
        }
        self.gpu.take_error()
    }
}

/// What was summed up in this call.
pub(super) fn count_mixed(view: &mut View, counters: &mut BTreeMap<String, u64>) {
    if let Some(layers) = view.paths.as_mut().and_then(|paths| paths.layers.as_mut()) {
        counters.insert("pixels_of_layers_mixed".into(), layers.take_work());
    }
}

/// What lies behind the volume, as if it were white and of strength 1: colour, and factor of the image.
pub(super) fn behind_in_layers(scene: &Scene) -> [[f32; 3]; 2] {
    use scene::Background::{Color, Image};
    let [one, zero] = [DVec3::ONE, DVec3::ZERO].map(tables::vector);
    match scene.background {
        Color(_) => [one, zero],
        Image { .. } => [zero, one],
    }
}
