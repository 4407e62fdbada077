//! Method `image_based`: records of the light that arrives, on a coarse grid (shaders/image_based/).

mod arriving;
mod exchange;
mod passes;
mod run;
mod slots;
mod stale;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use proto::scene_file::{Filter, RecordForm, RecordLookup};
use scene::camera::Projection;
use scene::light::Light;
use scene::spherical::healpix;
use scene::{Records, Scene, Snapshot, records};

use crate::direct_light::{Arrived, DirectLight};
use crate::error::RenderError;
use crate::frame::frame_uniform;
use crate::gpu::Gpu;
use crate::illumination::{Inputs, Progress};
use crate::light_field::LightField;
use crate::skies::Skies;
use crate::tables;
use crate::uniforms;
use crate::view::FilmCache;
use arriving::{Arriving, has_own_ray};
use exchange::Exchange;
pub(crate) use passes::Passes;
use passes::{Buffers, COUNTER_BYTES, COUNTERS, Chunk};
use run::{Run, cell_map};
use slots::{CHUNK_SLOTS, Slots};
use stale::{Stale, staleness};

/// What rays of a session may take on a device with memory of its own, bytes.
const MAX_RAY_BYTES: u64 = 1 << 30;
/// The same on a software device.
const MAX_RAY_BYTES_IN_SOFTWARE: u64 = 256 << 20;
/// Room for lights with a ray of their own is made for so many at a time: switching one on or off
/// then moves nothing.
const LIGHTS_AT_ONCE: usize = 4;
/// Length a slice aims at, milliseconds.
const SLICE_MILLIS: f64 = 20.0;
/// Rays, or products of a ray with a light, of the first slice, whose speed is unknown.
const FIRST_SLICE: f64 = 16_384.0;

/// Records of a session.
pub(crate) struct ImageBased {
    passes: Arc<Passes>,
    kept: Option<Kept>,
    /// What lights with a direction bring by themselves, in the form `product`.
    direct: Option<DirectLight>,
    skies: Skies,
    /// Milliseconds per ray that may have to be cast, and per product of a ray with a light.
    millis_per_ray: f64,
    millis_per_product: f64,
}

/// What decides which rays there are and how they are laid out.
#[derive(Debug, Clone, PartialEq)]
struct Shape {
    volume: [u8; 32],
    size_world: DVec3,
    filter: Filter,
    dims: [u32; 3],
    nside: u32,
    /// Columns of rays there is room for.
    columns: u32,
    glow: bool,
}

struct Kept {
    shape: Shape,
    slots: Slots,
    chunks: Vec<Chunk>,
    buffers: Buffers,
    field: LightField,
    /// Which scene's matter, and lookup, decided where records are.
    placed: Option<Arc<Snapshot>>,
    /// The light that coefficients are to be the product with, and its number.
    light: Option<Lit>,
    lit: u64,
    /// Where scattered light is exchanged.
    exchange: Option<Exchange>,
}

struct Lit {
    snapshot: Arc<Snapshot>,
    arriving: Arriving,
    products: wgpu::TextureView,
}

impl ImageBased {
    pub fn new(passes: Arc<Passes>) -> Self {
        Self {
            passes,
            kept: None,
            direct: None,
            skies: Skies::default(),
            millis_per_ray: 0.0,
            millis_per_product: 0.0,
        }
    }

    pub fn field(&self) -> Option<&LightField> {
        self.kept.as_ref().map(|kept| &kept.field)
    }

    pub fn into_field(self) -> Option<LightField> {
        self.kept.map(|kept| kept.field)
    }

    pub fn bytes(&self) -> u64 {
        let direct = self.direct.as_ref().map_or(0, DirectLight::bytes);
        direct
            + self.kept.as_ref().map_or(0, |kept| {
                let words = if kept.shape.glow { 4 } else { 1 };
                let exchange = kept.exchange.as_ref().map_or(0, Exchange::bytes);
                let rays = kept.chunks.len() as u64 * Chunk::bytes(kept.shape.columns, words);
                kept.field.bytes() + rays + exchange
            })
    }

    /// Brings records to the snapshot until the deadline, at least one slice.
    pub fn advance(
        &mut self,
        inputs: &Inputs<'_>,
        deadline: Option<Instant>,
        counters: &mut BTreeMap<String, u64>,
    ) -> Result<Progress, RenderError> {
        let scene = &inputs.snapshot.scene;
        let shape = Shape::of(scene, inputs.gpu);
        if self.kept.as_ref().is_none_or(|kept| kept.shape != shape) {
            // The old rays go first: both need not fit at once.
            self.kept = None;
            self.kept = Some(Kept::new(inputs.gpu, shape, Records::of(scene).bands_read(scene))?);
        }
        let Some(kept) = &mut self.kept else {
            return Err(RenderError::Gpu("records are missing".into()));
        };
        let kept_apart = Records::of(scene).form == RecordForm::Product
            && scene.lights.iter().any(|light| !light.is_environment());
        let mut arrived = Arrived::default();
        if kept_apart {
            let direct = self.direct.get_or_insert_with(|| DirectLight::new(inputs.direct_light.clone()));
            arrived = direct.advance(inputs, deadline, counters)?;
        } else {
            self.direct = None;
        }
        kept.place(inputs.snapshot);
        let all_at_once = kept.relight(inputs, &mut self.skies)?;
        match self.direct.as_ref().and_then(|direct| direct.look_up(scene)) {
            Some(look_up) => kept.field.set_direct(look_up),
            None => kept.field.take_direct_in(),
        }
        let base = kept.slots.base_of(inputs.snapshot);
        let mut staleness_of: Vec<(u32, Stale)> = Vec::new();
        for (id, held) in kept.slots.bases() {
            let stale = staleness(Some(&held.scene), scene, kept.shape.nside);
            if id != base && !stale.any() {
                kept.slots.rename(id, base);
            }
            staleness_of.push((id, stale));
        }
        kept.make_room_for_exchange(inputs, &self.passes)?;
        kept.write_scene(inputs)?;
        let distance_map = inputs.distance_map.ok_or_else(|| missing("distance map"))?;
        inputs.gpu.queue.write_buffer(&kept.buffers.counters, 0, &[0; COUNTER_BYTES as usize]);
        let mut changed = false;
        let run = Run { passes: &self.passes, inputs, distance_map };
        let left = kept.slots.take_left();
        if !left.is_empty() && !kept.chunks.is_empty() {
            run.clear(kept, &left)?;
            changed = true;
        }
        let base = Base { id: base, staleness_of, light_at_once: all_at_once };
        let mut pace = Pace { ray: &mut self.millis_per_ray, product: &mut self.millis_per_product };
        let mut up_to_date = renew(&run, kept, &base, &mut pace, deadline, &mut changed)?;
        if up_to_date && arrived.done == arrived.all && kept.exchange(&run, deadline)? {
            // What was received is part of all coefficients.
            kept.lit += 1;
            up_to_date = renew(&run, kept, &base, &mut pace, deadline, &mut changed)?;
        }
        if changed {
            let bytes = inputs.gpu.read_buffer(&kept.buffers.counters, COUNTER_BYTES)?;
            crate::renderer::name_counters(&COUNTERS, &bytes, counters);
        }
        let (done, all) = (kept.slots.done(base.id, kept.lit), kept.slots.len());
        counters.insert("records".into(), all as u64);
        let clamped = kept.light.as_ref().map_or(0.0, |light| light.arriving.clamped_share);
        counters.insert("record_light_clamped_ppm".into(), (clamped * 1e6).round() as u64);
        let share = |done: u64, all: u64| (all > 0).then(|| done as f32 / all as f32);
        let exchanged = kept.exchange.as_ref().map(Exchange::completeness);
        let shares = [share(done as u64, all as u64), share(arrived.done, arrived.all), exchanged];
        // Of each kind of light there is as much as is done of it.
        let kinds: Vec<f32> = shares.into_iter().flatten().collect();
        let completeness =
            if kinds.is_empty() { 1.0 } else { kinds.iter().sum::<f32>() / kinds.len() as f32 };
        Ok(Progress {
            complete: up_to_date && arrived.done == arrived.all && exchanged.is_none_or(|done| done == 1.0),
            completeness,
            changed: changed || arrived.changed,
        })
    }
}

/// What records are brought up to.
struct Base {
    /// What rays are cast for from now on.
    id: u32,
    /// What is stale of the rays that were cast for each scene.
    staleness_of: Vec<(u32, Stale)>,
    /// Whether coefficients of the light before cannot stand beside those of the new one.
    light_at_once: bool,
}

/// Milliseconds per ray that may have to be cast, and per product of a ray with a light.
struct Pace<'a> {
    ray: &'a mut f64,
    product: &'a mut f64,
}

/// Brings rays and coefficients up to date until the deadline, at least one slice; whether all are.
fn renew(
    run: &Run<'_>,
    kept: &mut Kept,
    base: &Base,
    pace: &mut Pace<'_>,
    deadline: Option<Instant>,
    changed: &mut bool,
) -> Result<bool, RenderError> {
    let (inputs, scene, lit) = (run.inputs, &run.inputs.snapshot.scene, kept.lit);
    let late = |deadline: Option<Instant>| deadline.is_some_and(|deadline| Instant::now() >= deadline);
    for group in kept.slots.todo(base.id, lit) {
        let of_base = group.base.as_ref().and_then(|base| kept.slots.base_id(base));
        let nothing_cast = Stale::everything(kept.shape.nside, scene);
        let known = base.staleness_of.iter().find(|(id, _)| Some(*id) == of_base);
        let stale = known.map_or(&nothing_cast, |(_, stale)| stale);
        let changed_map = match stale.distances(scene) {
            Some(distances) if stale.any() => Some(cell_map(inputs.gpu, scene, &distances)?),
            _ => None,
        };
        let tested = changed_map.as_ref().unwrap_or(run.distance_map);
        let mut rest = &group.entries[..];
        while !rest.is_empty() {
            let rate = if stale.any() { &mut *pace.ray } else { &mut *pace.product };
            let per_record = match stale.any() {
                true => kept.shape.columns,
                false => kept.shape.columns * kept.field.bands * kept.field.bands,
            };
            let count = slice(rest.len(), f64::from(per_record), *rate, deadline);
            let (now, later) = rest.split_at(count);
            let began = Instant::now();
            run.work(kept, group.chunk, now, stale, tested)?;
            *rate = began.elapsed().as_secs_f64() * 1e3 / (count as f64 * f64::from(per_record));
            kept.slots.finish(group.chunk, now, base.id, lit);
            *changed = true;
            rest = later;
            if late(deadline) && (stale.any() || !base.light_at_once) {
                return Ok(kept.slots.done(base.id, lit) == kept.slots.len());
            }
        }
    }
    Ok(kept.slots.done(base.id, lit) == kept.slots.len())
}

fn missing(what: &str) -> RenderError {
    RenderError::Gpu(format!("the {what} of the view is missing"))
}

/// Records of the next slice.
fn slice(left: usize, per_record: f64, millis: f64, deadline: Option<Instant>) -> usize {
    let aim = deadline.map_or(SLICE_MILLIS, |deadline| {
        let left = deadline.saturating_duration_since(Instant::now()).as_secs_f64() * 1e3;
        left.clamp(0.25 * SLICE_MILLIS, SLICE_MILLIS)
    });
    let items = if millis > 0.0 { aim / millis } else { FIRST_SLICE };
    ((items / per_record) as usize).clamp(passes::GROUP as usize, CHUNK_SLOTS as usize).min(left)
}

impl Shape {
    fn of(scene: &Scene, gpu: &Gpu) -> Self {
        let settings = Records::of(scene);
        let dims = settings.dims(&scene.grid);
        let own = scene.lights.iter().filter(|light| has_own_ray(light, settings.form)).count();
        let lights = own.div_ceil(LIGHTS_AT_ONCE) * LIGHTS_AT_ONCE;
        let columns = |nside: u32| (healpix::pixel_count(nside as usize) + lights) as u32;
        let glow = scene.glows();
        let most = if gpu.info().software { MAX_RAY_BYTES_IN_SOFTWARE } else { MAX_RAY_BYTES };
        let records = dims.iter().map(|&n| u64::from(n)).product::<u64>();
        let words = if glow { 4 } else { 1 };
        let chunks = records.div_ceil(u64::from(CHUNK_SLOTS));
        let bytes = |nside: u32| match settings.exchanges {
            0 => chunks * Chunk::bytes(columns(nside), words),
            _ => chunks * (Chunk::bytes(columns(nside), words) + Exchange::chunk_bytes(columns(nside))),
        };
        let mut nside = settings.nside;
        // From settings and volume alone, so that every way to a scene ends with the same records.
        while nside > 1 && bytes(nside) > most {
            nside /= 2;
        }
        Self {
            volume: scene.volume.content,
            size_world: scene.grid.size_world,
            filter: scene.filter,
            dims,
            nside,
            columns: columns(nside),
            glow,
        }
    }
}

impl Kept {
    fn new(gpu: &Arc<Gpu>, shape: Shape, bands: u32) -> Result<Self, RenderError> {
        Ok(Self {
            slots: Slots::new(shape.dims),
            chunks: Vec::new(),
            buffers: Buffers::new(gpu, shape.columns)?,
            field: LightField::new(gpu, shape.dims, bands)?,
            placed: None,
            light: None,
            lit: 0,
            exchange: None,
            shape,
        })
    }

    /// Decides where records are.
    fn place(&mut self, snapshot: &Arc<Snapshot>) {
        let scene = &snapshot.scene;
        let lookup = Records::of(scene).lookup;
        let are_read = |scene: &Scene| Records::of(scene).are_read(scene);
        let same = |old: &Scene| {
            old.bins_with_matter() == scene.bins_with_matter()
                && Records::of(old).lookup == lookup
                && are_read(old) == are_read(scene)
        };
        if self.placed.as_ref().is_none_or(|placed| !same(&placed.scene)) {
            let needed = match are_read(scene) {
                true => records::needed(scene, self.shape.dims, lookup),
                false => vec![false; self.shape.dims.iter().product::<u32>() as usize],
            };
            self.slots.keep(&needed);
            self.placed = Some(snapshot.clone());
        }
        self.field.nearest = lookup == RecordLookup::Containing;
    }

    /// Takes over the snapshot's light. Whether all coefficients have to follow at once, because those
    /// of the light before cannot stand beside them.
    fn relight(&mut self, inputs: &Inputs<'_>, skies: &mut Skies) -> Result<bool, RenderError> {
        let scene = &inputs.snapshot.scene;
        if self.light.as_ref().is_some_and(|light| same_light(&light.snapshot.scene, scene)) {
            return Ok(false);
        }
        let bands = Records::of(scene).bands_read(scene);
        let arriving = Arriving::of(scene, self.shape.nside as usize, bands as usize, skies);
        let mut at_once = self.light.as_ref().is_some_and(|light| light.arriving.scale != arriving.scale);
        if bands != self.field.bands {
            let nearest = self.field.nearest;
            self.field = LightField::new(inputs.gpu, self.shape.dims, bands)?;
            self.field.nearest = nearest;
            at_once = self.light.is_some();
        }
        self.field.set_scale(arriving.scale);
        let size = wgpu::Extent3d {
            width: arriving.products.len() as u32 / (bands * bands),
            height: bands * bands,
            depth_or_array_layers: 1,
        };
        let texels = bytemuck::cast_slice(&arriving.products);
        let products = inputs.gpu.filled_texture(
            "light of records",
            size,
            wgpu::TextureDimension::D2,
            wgpu::TextureFormat::Rgba32Float,
            texels,
        )?;
        let lights: Vec<uniforms::Light> = arriving.lights.iter().filter_map(tables::light).collect();
        inputs.gpu.queue.write_buffer(&self.buffers.lights, 0, bytemuck::cast_slice(&lights));
        self.light = Some(Lit { snapshot: inputs.snapshot.clone(), arriving, products });
        self.lit += 1;
        Ok(at_once)
    }

    /// Has records exchange scattered light, or no longer.
    fn make_room_for_exchange(&mut self, inputs: &Inputs<'_>, passes: &Passes) -> Result<(), RenderError> {
        if Records::of(&inputs.snapshot.scene).exchanges == 0 {
            self.exchange = None;
            return Ok(());
        }
        if self.exchange.as_ref().is_none_or(|exchange| !exchange.fits(&self.field)) {
            self.exchange = None;
            self.exchange = Some(Exchange::new(inputs, &passes.exchange, &self.field)?);
        }
        if let Some(exchange) = &mut self.exchange {
            exchange.make_room(inputs.gpu, self.chunks.len(), self.shape.columns)?;
            exchange.take(inputs.snapshot);
        }
        Ok(())
    }

    /// Goes on with the exchange until the deadline; whether it came to its end by this.
    fn exchange(&mut self, run: &Run<'_>, deadline: Option<Instant>) -> Result<bool, RenderError> {
        let Some(mut exchange) = self.exchange.take() else { return Ok(false) };
        let ended = !exchange.is_done() && exchange.advance(run, self, deadline)?;
        self.exchange = Some(exchange);
        Ok(ended)
    }

    /// Directions of columns.
    fn towards(&self, scene: &Scene) -> Vec<[f32; 4]> {
        Stale::everything(self.shape.nside, scene).columns().to_vec()
    }

    /// What all dispatches of a scene read.
    fn write_scene(&self, inputs: &Inputs<'_>) -> Result<(), RenderError> {
        let scene = &inputs.snapshot.scene;
        let film = FilmCache {
            snapshot: inputs.snapshot.clone(),
            width: 1,
            height: 1,
            samples: 0,
            rows: 0,
            in_segments: false,
            light_version: 0,
        };
        let mut frame = frame_uniform(scene, inputs.texture, &film);
        if scene.clip.shadows {
            // What is clipped stands in the way of light all the same.
            let half = 0.5 * scene.grid.size_world;
            (frame.clip_low, frame.clip_high) = (tables::vector(-half), tables::vector(half));
            frame.plane_count = 0;
        }
        inputs.gpu.queue.write_buffer(&self.buffers.frame, 0, bytemuck::bytes_of(&frame));
        Ok(())
    }

    fn own_lights(&self) -> u32 {
        self.light.as_ref().map_or(0, |light| light.arriving.lights.len() as u32)
    }

    fn directions(&self) -> u32 {
        healpix::pixel_count(self.shape.nside as usize) as u32
    }

    fn uniform(&self, scene: &Scene, count: u32) -> uniforms::Records {
        let settings = Records::of(scene);
        let camera = &scene.camera;
        let eye = match camera.projection {
            Projection::Perspective { .. } => camera.eye.extend(1.0),
            Projection::Orthographic { .. } => (-camera.forward).extend(0.0),
        };
        uniforms::Records {
            dims: self.shape.dims,
            columns: self.shape.columns,
            first: 0,
            count,
            directions: self.directions(),
            capacity: CHUNK_SLOTS,
            bands: self.field.bands,
            scale: self.light.as_ref().map_or(1.0, |light| light.arriving.scale),
            material: densest_material(scene) as u32,
            window: u32::from(settings.window && settings.form == RecordForm::Product),
            own_lights: self.own_lights(),
            pad0: 0,
            pad1: 0,
            pad2: 0,
            eye: eye.as_vec4().to_array(),
        }
    }
}

/// Whether coefficients of one scene are, with the same rays, those of the other.
fn same_light(old: &Scene, new: &Scene) -> bool {
    let (a, b) = (Records::of(old), Records::of(new));
    let brightest = |scene: &Scene| {
        let points = scene.transfer_function.points.iter();
        points.map(|point| point.emission.max_element()).fold(0.0, f64::max)
    };
    let folded = |scene: &Scene| scene.materials[densest_material(scene)].phase.clone();
    let same_eye = || old.camera == new.camera && folded(old) == folded(new);
    (a.bands, a.form, a.window, a.exchanges > 0) == (b.bands, b.form, b.window, b.exchanges > 0)
        && a.bands_read(old) == b.bands_read(new)
        && same_lights(&old.lights, &new.lights, b)
        && brightest(old) == brightest(new)
        && (b.form != RecordForm::Dynamic || same_eye())
}

/// Whether lights are the same, but for those that are no part of records.
fn same_lights(old: &[Light], new: &[Light], settings: Records) -> bool {
    let all_are = settings.form != RecordForm::Product || settings.exchanges > 0;
    let of_records = |light: &&Light| light.is_environment() || all_are;
    old.iter().filter(of_records).eq(new.iter().filter(of_records))
}

/// The material whose phase function stands for all where only one can.
fn densest_material(scene: &Scene) -> usize {
    let points = scene.transfer_function.points.iter();
    points.max_by(|a, b| a.sigma_t.total_cmp(&b.sigma_t)).map_or(0, |point| point.material)
}
