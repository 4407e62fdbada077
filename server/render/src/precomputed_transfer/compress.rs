//! A bake's matrices in few numbers (section 6.4 of PVRT): read back, compressed by a thread of its own, and
//! on the device in place of the matrices.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};

use nalgebra::DMatrix;

use super::basis::LightVector;
use super::buffers::{Held, STORAGE, filled};
use super::cpca::{Clusters, DIRECTIONS};
use super::keeping::{Handed, Handing, Matrices, WAIT};
use super::passes::{GROUP, Pipelines};
use super::store::{Outgoing, spawn};
use crate::error::RenderError;
use crate::gpu::{Gpu, buffer_entry, texture_entry};
use crate::uniforms;

/// Pieces that wait to be taken in.
const MOST_WAITING: usize = 2;

/// What the matrices of a bake are.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    pub lights: usize,
    /// Spherical harmonics.
    pub coefficients: usize,
    /// 3 where albedo is coloured, else 1.
    pub channels: usize,
    pub rows: usize,
    /// What sums of photons are multiplied with when they become light.
    pub photon_factor: f64,
}

impl Shape {
    pub fn of(settings: &uniforms::Transfer) -> Self {
        Self {
            lights: settings.bases as usize,
            coefficients: (settings.bands * settings.bands) as usize,
            channels: settings.channels as usize,
            rows: settings.rows as usize,
            photon_factor: f64::from(settings.photon_factor) * f64::from(settings.unit),
        }
    }

    /// Adds up both matrices as their bytes come: a column for each row, channel by channel, coefficient by
    /// coefficient, light by light. `None`: there came no more.
    pub fn gather(&self, pieces: &Receiver<Vec<u8>>) -> Option<DMatrix<f32>> {
        let direct = self.coefficients * self.lights;
        let values = self.channels * direct;
        let mut matrices = DMatrix::zeros(values, self.rows);
        let mut low_words = Vec::with_capacity(values * self.rows);
        let mut at = 0;
        while at < (direct + 2 * values) * self.rows {
            for word in bytemuck::pod_collect_to_vec::<u8, u32>(&pieces.recv().ok()?) {
                let (line, row) = (at / self.rows, at % self.rows);
                if line < direct {
                    let value = f32::from_bits(word);
                    (0..self.channels).for_each(|channel| matrices[(channel * direct + line, row)] = value);
                } else if line < direct + values {
                    low_words.push(word);
                } else {
                    let line = line - direct - values;
                    let low = low_words.get(line * self.rows + row).copied().unwrap_or(0);
                    let sum = (u64::from(word) << 32 | u64::from(low)) as i64;
                    matrices[(line, row)] += (self.photon_factor * sum as f64) as f32;
                }
                at += 1;
            }
        }
        Some(matrices)
    }

    /// As many clusters as are wanted and take less room than the matrices.
    pub fn clusters(&self, wanted: u32) -> usize {
        (wanted as usize).min(self.rows / DIRECTIONS).max(1)
    }
}

/// Matrices being compressed. Dropped, it comes to nothing.
pub struct Compressing {
    /// `None`: all is handed over.
    handing: Option<Handing>,
    result: Receiver<Clusters>,
    /// Nobody waits for the result.
    pub abandoned: Arc<AtomicBool>,
}

impl Drop for Compressing {
    fn drop(&mut self) {
        self.abandoned.store(true, Ordering::Relaxed);
    }
}

impl Compressing {
    /// # Errors
    /// There is no thread for it.
    pub fn new(shape: Shape, wanted: u32) -> Result<Self, RenderError> {
        let (outgoing, pieces) = Outgoing::with_room(MOST_WAITING);
        let (sender, result) = mpsc::channel();
        let abandoned = Arc::new(AtomicBool::new(false));
        let given_up = abandoned.clone();
        let compress = move || {
            let Some(matrices) = shape.gather(&pieces) else { return };
            if let Some(clusters) = Clusters::of(&matrices, shape.clusters(wanted), &given_up) {
                // Who asked for it may be gone.
                let _ = sender.send(clusters);
            }
        };
        if !spawn("compress a bake", compress) {
            return Err(gone());
        }
        Ok(Self { handing: Some(Handing::new(outgoing)), result, abandoned })
    }

    /// Whether there is nothing to do but to wait for the thread.
    pub fn waits(&self) -> bool {
        self.handing.is_none()
    }

    /// Hands over a piece of the matrices, or waits a little; the clusters when there are some.
    ///
    /// # Errors
    /// GPU errors; the thread is gone.
    pub fn step(&mut self, gpu: &Gpu, matrices: &Matrices<'_>) -> Result<Option<Clusters>, RenderError> {
        if let Some(handing) = &mut self.handing {
            match handing.step(gpu, matrices)? {
                Handed::Part => {}
                Handed::All => self.handing = None,
                Handed::Refused => return Err(gone()),
            }
            return Ok(None);
        }
        match self.result.recv_timeout(WAIT) {
            Ok(clusters) => Ok(Some(clusters)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(gone()),
        }
    }
}

fn gone() -> RenderError {
    RenderError::Gpu("no thread compresses the baked light".into())
}

/// Compressed matrices on the device.
pub struct Compressed {
    settings: wgpu::Buffer,
    texel_rows: wgpu::Buffer,
    masses: wgpu::Buffer,
    lights: wgpu::Buffer,
    directions: wgpu::Buffer,
    clusters: wgpu::Buffer,
    weights: wgpu::Buffer,
    /// Light of each direction, coefficient by coefficient.
    lit: wgpu::Buffer,
    direction_count: u32,
    /// What is left out of the matrices, relative L2.
    pub error: f64,
}

impl Compressed {
    /// Takes over the tables of a bake.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(gpu: &Gpu, held: &Held, clusters: &Clusters, bands: u32) -> Result<Self, RenderError> {
        let direction_count = clusters.directions.ncols() as u32;
        let lit = 16 * u64::from(direction_count * bands * bands);
        let laid_out = clusters.directions.transpose();
        Ok(Self {
            settings: held.settings.clone(),
            texel_rows: held.texel_rows.clone(),
            masses: held.masses.clone(),
            lights: held.lights.clone(),
            directions: filled(gpu, "directions of clusters", bytemuck::cast_slice(laid_out.as_slice()))?,
            clusters: filled(gpu, "clusters of texels", bytemuck::cast_slice(&clusters.of))?,
            weights: filled(gpu, "weights of texels", bytemuck::cast_slice(&clusters.weights))?,
            lit: gpu.buffer("light of directions", lit, STORAGE)?,
            direction_count,
            error: clusters.error,
        })
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let Self { settings, texel_rows, masses, lights, directions, clusters, weights, lit, .. } = self;
        let buffers = [settings, texel_rows, masses, lights, directions, clusters, weights, lit];
        buffers.into_iter().map(wgpu::Buffer::size).sum()
    }

    /// Light times directions, and their sums into the field.
    ///
    /// # Errors
    /// GPU errors.
    pub fn relight(
        &self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        settings: &uniforms::Transfer,
        light: &LightVector,
        field: &wgpu::TextureView,
    ) -> Result<(), RenderError> {
        gpu.queue.write_buffer(&self.settings, 0, bytemuck::bytes_of(settings));
        gpu.queue.write_buffer(&self.lights, 0, bytemuck::cast_slice(&light.texels));
        let directions = pipelines.light_directions.bind(
            gpu,
            &[
                buffer_entry(21, &self.settings),
                buffer_entry(24, &self.directions),
                buffer_entry(29, &self.lit),
                buffer_entry(30, &self.lights),
            ],
        );
        let rows = pipelines.light_rows.bind(
            gpu,
            &[
                buffer_entry(21, &self.settings),
                buffer_entry(25, &self.masses),
                buffer_entry(26, &self.weights),
                buffer_entry(27, &self.clusters),
                buffer_entry(28, &self.texel_rows),
                buffer_entry(29, &self.lit),
                texture_entry(31, field),
            ],
        );
        let coefficients = settings.bands * settings.bands;
        let texels: u32 = settings.dims.iter().product();
        let groups = [self.direction_count, texels].map(|count| count.div_ceil(GROUP));
        gpu.dispatch(&pipelines.of(&pipelines.light_directions), &directions, [groups[0], coefficients]);
        gpu.dispatch(&pipelines.of(&pipelines.light_rows), &rows, [groups[1], coefficients]);
        gpu.wait()
    }
}
