//! What is measured for operators: `/metrics` in the Prometheus text form, `/healthz`, `/readyz`.
//!
//! Labels never hold what a client may choose freely (names, identifiers): their number is bounded.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};
use proto::plan::FrameReport;

use crate::App;
use crate::problem::Fault;
use crate::render_thread::{Encoding, FinishedFrame};

/// OpenMetrics text.
const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Everything that is measured.
pub struct Metrics {
    registry: Registry,
    requests: Family<RequestLabels, Counter>,
    request_seconds: Family<RouteLabels, Histogram, fn() -> Histogram>,
    frames: Family<KindLabels, Counter>,
    frame_bytes: Counter,
    frame_seconds: Family<StageLabels, Histogram, fn() -> Histogram>,
    /// From sending a frame to its acknowledgement.
    frame_age: Histogram,
    pass_seconds: Family<StageLabels, Counter<f64, AtomicU64>>,
    work: Family<CounterLabels, Counter>,
    sessions: Gauge,
    viewers: Gauge,
    datasets: Gauge,
    voxel_bytes: Gauge,
    gpu_bytes: Family<OwnerLabels, Gauge>,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct RequestLabels {
    method: String,
    route: String,
    status: u16,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct RouteLabels {
    route: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct KindLabels {
    kind: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct StageLabels {
    stage: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct CounterLabels {
    counter: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OwnerLabels {
    owner: &'static str,
}

/// From a millisecond to half a minute.
fn seconds() -> Histogram {
    Histogram::new(exponential_buckets(0.001, 2.0, 16))
}

impl Metrics {
    /// Nothing is counted yet.
    pub fn new() -> Self {
        let mut registry = Registry::with_prefix("tyndall");
        let requests = Family::default();
        registry.register("requests", "Requests answered", requests.clone());
        let request_seconds = Family::new_with_constructor(seconds as fn() -> Histogram);
        registry.register_with_unit("request", "Time to answer", Unit::Seconds, request_seconds.clone());
        let frames = Family::default();
        registry.register("frames", "Frames sent to viewers", frames.clone());
        let frame_bytes = Counter::default();
        registry.register_with_unit("frame", "Frames sent, with headers", Unit::Bytes, frame_bytes.clone());
        let frame_seconds = Family::new_with_constructor(seconds as fn() -> Histogram);
        registry.register_with_unit(
            "frame_stage",
            "Time of a frame's stages: from input to drawing, drawing, encoding, sending",
            Unit::Seconds,
            frame_seconds.clone(),
        );
        let frame_age = seconds();
        registry.register_with_unit(
            "frame_acknowledgement",
            "From sending a frame to its acknowledgement",
            Unit::Seconds,
            frame_age.clone(),
        );
        let pass_seconds = Family::default();
        registry.register_with_unit(
            "pass",
            "Time of the passes of viewers' frames",
            Unit::Seconds,
            pass_seconds.clone(),
        );
        let work = Family::default();
        registry.register("work", "Exact work of viewers' frames by counter", work.clone());
        let (sessions, viewers, datasets, voxel_bytes) = Default::default();
        registry.register("sessions", "Sessions in memory", Gauge::clone(&sessions));
        registry.register("viewers", "Connected viewers", Gauge::clone(&viewers));
        registry.register("datasets", "Stored datasets", Gauge::clone(&datasets));
        registry.register_with_unit("voxel", "Voxels in memory", Unit::Bytes, Gauge::clone(&voxel_bytes));
        let gpu_bytes = Family::default();
        registry.register_with_unit(
            "gpu",
            "Memory of the GPU in use by owner",
            Unit::Bytes,
            gpu_bytes.clone(),
        );
        Self {
            registry,
            requests,
            request_seconds,
            frames,
            frame_bytes,
            frame_seconds,
            frame_age,
            pass_seconds,
            work,
            sessions,
            viewers,
            datasets,
            voxel_bytes,
            gpu_bytes,
        }
    }

    /// A request was answered; `route` is the template of its address.
    pub fn request(&self, method: &str, route: &str, status: StatusCode, time: Duration) {
        let labels =
            RequestLabels { method: method.to_owned(), route: route.to_owned(), status: status.as_u16() };
        self.requests.get_or_create(&labels).inc();
        let labels = RouteLabels { route: route.to_owned() };
        self.request_seconds.get_or_create(&labels).observe(time.as_secs_f64());
    }

    /// A frame of so many bytes was sent; `sending` is the time that took.
    pub fn frame(&self, frame: &FinishedFrame, bytes: usize, encoding: Duration, sending: Duration) {
        let kind = match frame.encoding {
            Encoding::Moving(_) => "moving",
            Encoding::Refining => "refining",
            Encoding::Lossless => "final",
        };
        self.frames.get_or_create(&KindLabels { kind }).inc();
        self.frame_bytes.inc_by(bytes as u64);
        let header = &frame.header;
        let stages = [
            ("queue", f64::from(header.queue_micros) / 1e6),
            ("draw", f64::from(header.render_micros) / 1e6),
            ("encode", encoding.as_secs_f64()),
            ("send", sending.as_secs_f64()),
        ];
        for (stage, seconds) in stages {
            self.frame_seconds.get_or_create(&StageLabels { stage: stage.into() }).observe(seconds);
        }
        self.report(&frame.report);
    }

    fn report(&self, report: &FrameReport) {
        for stage in &report.stages {
            let labels = StageLabels { stage: stage.stage.clone() };
            self.pass_seconds.get_or_create(&labels).inc_by(stage.millis.max(0.0) / 1e3);
        }
        for (counter, count) in &report.counters {
            self.work.get_or_create(&CounterLabels { counter: counter.clone() }).inc_by(*count);
        }
    }

    /// A frame was acknowledged so long after it was sent.
    pub fn acknowledged(&self, age: Duration) {
        self.frame_age.observe(age.as_secs_f64());
    }

    fn text(&self, app: &App) -> Result<String, std::fmt::Error> {
        let (sessions, viewers) = app.sessions().counts();
        self.sessions.set(i64::from(sessions));
        self.viewers.set(i64::from(viewers));
        self.datasets.set(app.catalog().list().len() as i64);
        self.voxel_bytes.set(i64::try_from(app.volumes().bytes()).unwrap_or(i64::MAX));
        let volumes = app.renderer().volumes();
        for (owner, bytes) in [("volumes", volumes.bytes()), ("views", volumes.others_bytes())] {
            let bytes = i64::try_from(bytes).unwrap_or(i64::MAX);
            self.gpu_bytes.get_or_create(&OwnerLabels { owner }).set(bytes);
        }
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}

/// What is measured, for Prometheus.
pub async fn metrics(State(app): State<Arc<App>>) -> Response {
    let text = crate::blocking("writing metrics", move || app.metrics().text(&app)).await;
    match text {
        Ok(Ok(text)) => ([(header::CONTENT_TYPE, MEDIA_TYPE)], text).into_response(),
        Ok(Err(error)) => Fault::internal("writing metrics", &error).into_response(),
        Err(fault) => fault.into_response(),
    }
}

/// The process answers.
pub async fn healthy() -> &'static str {
    "alive\n"
}

/// The process can do its work: 503 while it stops, if its data directory is gone, or if nobody
/// draws any more.
pub async fn ready(State(app): State<Arc<App>>) -> Response {
    let check = crate::blocking("looking whether all is ready", move || {
        if app.closing().is_cancelled() {
            return Err("The service is stopping.");
        }
        if !app.config().data.is_dir() {
            return Err("The data directory is not there.");
        }
        if !app.renderer().is_alive() {
            return Err("The thread that draws has ended.");
        }
        Ok("ready\n")
    });
    match check.await {
        Ok(Ok(text)) => text.into_response(),
        Ok(Err(reason)) => Fault::busy(reason).into_response(),
        Err(fault) => fault.into_response(),
    }
}
