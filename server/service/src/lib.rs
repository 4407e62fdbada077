//! The service: REST, WebSocket, sessions, storage, encoding.
//!
//! [`app`] is the router as a value, so that tests call it in process; [`serve`] listens, and ends
//! within a bound when the process is asked to stop.
//!
//! Rooms: [`config`] (settings, limits), [`problem`] (errors as RFC 9457), [`origin`] (who may use
//! the service from a browser), [`datasets`] (catalog, storage, uploads, volumes in memory),
//! [`environments`] (light from all
//! directions), [`exports`] (turntables and films), [`sessions`] (scenes and their edits), [`viewer`] (WebSocket), [`render_thread`] (who draws
//! when), [`encode`] (pixels to bytes), [`metrics`], [`openapi`], [`web`] (the page).
//!
//! Invariants: no lock is held across an await (a lint denies it); more than half a millisecond of
//! work runs on blocking threads ([`blocking`]) or the render thread; every queue, body and cache
//! has a named bound, most of them in [`config::Limits`].

// A session holds GPU buffers, whose types are deep.
#![recursion_limit = "256"]

mod app;
pub mod config;
pub mod datasets;
pub mod encode;
pub mod environments;
pub mod exports;
mod http;
pub mod metrics;
pub mod openapi;
pub mod origin;
pub mod problem;
pub mod render_thread;
mod serve;
pub mod sessions;
pub mod viewer;
pub mod web;

pub use app::{App, app};
pub use config::Config;
pub use serve::{ServeError, serve, serve_on};

use problem::{Answer, Fault};

/// Runs `work` on a thread that may block.
///
/// # Errors
/// The work panicked; that is logged.
pub async fn blocking<T: Send + 'static>(
    doing: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Answer<T> {
    tokio::task::spawn_blocking(work).await.map_err(|error| Fault::internal(doing, &error))
}

/// Milliseconds since 1970.
pub(crate) fn unix_millis() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |time| u64::try_from(time.as_millis()).unwrap_or(u64::MAX))
}
