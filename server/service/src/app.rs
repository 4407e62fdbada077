//! What all requests share, and the router over it.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::get;
use proto::rest::Dataset;
use render::fit::{Fitted, fit};
use render::{BakeStore, Gpu, RenderError};
use scene::PreparedVolume;
use scene::part::{Part, Wish};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

use crate::config::Config;
use crate::datasets::samples::Samples;
use crate::datasets::uploads::{self, Uploads};
use crate::datasets::volumes::{Key, Volumes};
use crate::datasets::{Catalog, describe};
use crate::environments::Environments;
use crate::exports::Exports;
use crate::metrics::{self, Metrics};
use crate::problem::{Answer, Fault, as_problems};
use crate::render_thread::{RenderThread, render_fault};
use crate::serve::ServeError;
use crate::sessions::Sessions;
use crate::{http, openapi, origin, web};

/// Frames being encoded at once, for each processor.
const ENCODES_PER_PROCESSOR: usize = 1;

/// Everything that requests share. Dropping the last handle ends the render thread.
pub struct App {
    config: Config,
    catalog: Arc<Catalog>,
    samples: Arc<Samples>,
    volumes: Arc<Volumes>,
    environments: Environments,
    resumable: Uploads,
    exports: Exports,
    sessions: Sessions,
    renderer: RenderThread,
    metrics: Metrics,
    closing: CancellationToken,
    /// Permits for what is bounded by `limits`.
    pub(crate) viewers: Arc<Semaphore>,
    pub(crate) receiving: Arc<Semaphore>,
    pub(crate) requests: Semaphore,
    pub(crate) encodes: Semaphore,
    /// One thumbnail is drawn at a time; the others wait for it and find it on disk.
    pub(crate) thumbnails: Semaphore,
    /// One preview is drawn at a time: the others wait, and never fill the queue of stills.
    pub(crate) previews: Semaphore,
    /// One clip region is scanned at a time: a scan takes every processor.
    pub(crate) region_scans: Semaphore,
}

impl App {
    /// Opens the data directory and starts the render thread. Blocks.
    ///
    /// # Errors
    /// The data directory cannot be used, or the device refuses.
    pub fn open(config: Config, gpu: Arc<Gpu>) -> Result<Arc<Self>, ServeError> {
        let limits = &config.limits;
        let unusable = |source| ServeError::Data { path: config.data.clone(), source };
        let catalog = Arc::new(Catalog::open(&config.data, limits).map_err(unusable)?);
        let resumable = Uploads::open(&catalog, &config).map_err(unusable)?;
        let samples = Arc::new(Samples::new(catalog.storage().clone(), limits));
        let volumes = Arc::new(Volumes::new(catalog.clone(), samples.clone(), limits));
        let environments = Environments::open(config.data.join("environments"), limits).map_err(unusable)?;
        let sessions = Sessions::open(&config).map_err(unusable)?;
        let exports = Exports::open(&config).map_err(unusable)?;
        let bakes = match limits.max_bake_bytes {
            0 => None,
            most => {
                let interval = Duration::from_secs(config.bake_checkpoint_seconds);
                let folder = config.data.join("bakes");
                let bakes = BakeStore::with_checkpoints(&folder, most, interval).map_err(unusable)?;
                Some(Arc::new(bakes))
            }
        };
        let renderer = RenderThread::start(gpu, limits.max_waiting_stills, limits.max_gpu_bytes, bakes)?;
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        Ok(Arc::new(Self {
            renderer,
            metrics: Metrics::new(),
            environments,
            sessions,
            viewers: Arc::new(Semaphore::new(limits.max_viewers)),
            receiving: Arc::new(Semaphore::new(limits.max_uploads)),
            requests: Semaphore::new(limits.max_requests),
            encodes: Semaphore::new(processors * ENCODES_PER_PROCESSOR),
            thumbnails: Semaphore::new(1),
            previews: Semaphore::new(1),
            region_scans: Semaphore::new(1),
            closing: CancellationToken::new(),
            catalog,
            samples,
            volumes,
            resumable,
            exports,
            config,
        }))
    }

    /// The settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Stored datasets.
    pub fn catalog(&self) -> &Arc<Catalog> {
        &self.catalog
    }

    /// Samples.
    pub fn samples(&self) -> &Arc<Samples> {
        &self.samples
    }

    /// Volumes in memory.
    pub fn volumes(&self) -> &Arc<Volumes> {
        &self.volumes
    }

    /// Resumable uploads.
    pub fn resumable(&self) -> &Uploads {
        &self.resumable
    }

    /// Light from all directions.
    pub fn environments(&self) -> &Environments {
        &self.environments
    }

    /// Turntables and films, drawn and under way.
    pub fn exports(&self) -> &Exports {
        &self.exports
    }

    /// Sessions, in memory and on disk.
    pub fn sessions(&self) -> &Sessions {
        &self.sessions
    }

    /// The way to the GPU.
    pub fn renderer(&self) -> &RenderThread {
        &self.renderer
    }

    /// What is measured.
    pub fn metrics(&self) -> &Metrics {
        &self.metrics
    }

    /// Cancelled when the service stops.
    pub fn closing(&self) -> &CancellationToken {
        &self.closing
    }

    /// Puts as much of a loaded volume on the GPU, ahead of its first frame, as a scene asks for and
    /// as fits. Blocks.
    ///
    /// # Errors
    /// Not even its coarsest level fits.
    pub fn fit(&self, whole: &Arc<PreparedVolume>, wish: &Wish) -> Answer<Fitted> {
        let part_of = |part: &Part| self.volumes.part(whole, part, wish).map_err(Unfit::Memory);
        let most = self.config.limits.max_texture_bytes;
        fit(&self.renderer.volumes(), whole, wish, most, part_of).map_err(|unfit| match unfit {
            Unfit::Memory(fault) => fault,
            Unfit::Device(error) => {
                let mut fault = render_fault(error);
                if fault.problem.field.is_none() && fault.problem.status == 422 {
                    fault = Fault::invalid("volume", fault.problem.detail);
                }
                fault
            }
        })
    }

    /// What a loaded volume is. Blocks while samples are first described.
    pub fn describe_volume(&self, key: &Key, volume: &PreparedVolume) -> Option<Dataset> {
        let sample = |sample: &&crate::datasets::samples::Sample| sample.key() == *key;
        if let Some(sample) = self.samples.all().iter().find(sample) {
            return Some(sample.dataset.clone());
        }
        match key {
            Key::Builtin(kind, _) => {
                let name = crate::datasets::samples::readable(kind.name());
                let mut dataset = describe(volume, kind.name(), &name, "builtin");
                dataset.sample = true;
                Some(dataset)
            }
            // `None` if it was deleted meanwhile.
            Key::Dataset(id, _) => self.catalog.get(id).map(|manifest| manifest.dataset),
        }
    }
}

/// Why a volume cannot be put on the GPU.
enum Unfit {
    /// No memory for a part of it.
    Memory(Fault),
    Device(RenderError),
}

impl From<RenderError> for Unfit {
    fn from(error: RenderError) -> Self {
        Unfit::Device(error)
    }
}

/// The whole service as a router.
pub fn app(state: Arc<App>) -> Router {
    let (api, document) = openapi::api().split_for_parts();
    let api = api
        .merge(openapi::document_route(document))
        .fallback(http::nothing_here)
        .layer(from_fn_with_state(state.clone(), http::admit))
        // Each handler bounds its own body.
        .layer(DefaultBodyLimit::disable())
        .layer(http::cors(state.config()))
        .layer(from_fn_with_state(state.clone(), uploads::speak));
    Router::new()
        .nest("/api/v1", api)
        .merge(openapi::browsable())
        .route("/metrics", get(metrics::metrics))
        .route("/healthz", get(metrics::healthy))
        .route("/readyz", get(metrics::ready))
        .fallback(web::page)
        .layer(from_fn_with_state(state.clone(), origin::guard))
        .layer(from_fn(as_problems))
        .layer(from_fn_with_state(state.clone(), http::traced))
        .with_state(state)
}
