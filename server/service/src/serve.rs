//! Listening, and stopping in time.

use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use render::{AdapterPolicy, Gpu, RenderError};
use tokio::net::TcpListener;

use crate::datasets::uploads;
use crate::{App, Config, app};

/// How often idle sessions are looked for.
const EXPIRY_INTERVAL: Duration = Duration::from_secs(30);

/// Why the service cannot run.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The device.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The data directory.
    #[error("cannot use the data directory {path}")]
    Data {
        /// The directory.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The address.
    #[error("cannot listen on {address}; another address can be given with --listen or LISTEN=")]
    Listen {
        /// The address.
        address: std::net::SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// The network failed while serving.
    #[error("serving failed: {0}")]
    Serve(std::io::Error),
    /// A thread ended unexpectedly.
    #[error("starting failed: {0}")]
    Start(String),
}

/// Opens the device and the data directory, and serves until SIGINT or SIGTERM.
///
/// # Errors
/// See [`ServeError`].
pub async fn serve(config: Config) -> Result<(), ServeError> {
    let address = config.listen;
    let listener =
        TcpListener::bind(address).await.map_err(|source| ServeError::Listen { address, source })?;
    let policy = if config.hardware_only { AdapterPolicy::HardwareOnly } else { AdapterPolicy::Any };
    let open = move || App::open(config, Gpu::open(policy)?);
    let state =
        tokio::task::spawn_blocking(open).await.map_err(|error| ServeError::Start(error.to_string()))??;
    let device = state.renderer().device();
    tracing::info!(name = device.name, driver = device.driver, "rendering");
    if device.software {
        tracing::warn!("this is a software device: pictures are small while they move, and slow to refine");
    }
    serve_on(listener, state, stop_signal()).await
}

/// Serves on a listener until `stop` is done, then tells viewers, finishes requests, and returns
/// within `shutdown_seconds` whatever is still open.
///
/// # Errors
/// The network fails.
pub async fn serve_on(
    listener: TcpListener,
    state: Arc<App>,
    stop: impl Future<Output = ()> + Send + 'static,
) -> Result<(), ServeError> {
    if let Ok(address) = listener.local_addr() {
        tracing::info!(%address, "listening");
    }
    let samples = state.samples().clone();
    // Described ahead of the first visitor.
    let describing = tokio::task::spawn_blocking(move || {
        samples.all();
    });
    let expiring = tokio::spawn(expire_sessions(state.clone()));
    let tending = tokio::spawn(uploads::tend(state.clone()));
    let closing = state.closing().clone();
    let stopping = {
        let closing = closing.clone();
        async move {
            stop.await;
            closing.cancel();
        }
    };
    let bound = state.config().shutdown_bound();
    let server = axum::serve(listener, app(state.clone())).with_graceful_shutdown(stopping);
    let late = async {
        closing.cancelled().await;
        tokio::time::sleep(bound).await;
    };
    let result = tokio::select! {
        result = server => result.map_err(ServeError::Serve),
        () = late => {
            tracing::warn!("some connections did not end in time");
            Ok(())
        }
    };
    expiring.abort();
    tending.abort();
    describing.abort();
    let stopped = tokio::task::spawn_blocking(move || {
        state.sessions().store().close();
        state.renderer().stop();
    });
    if tokio::time::timeout(bound, stopped).await.is_err() {
        tracing::warn!("the render thread did not end in time");
    }
    result
}

async fn expire_sessions(state: Arc<App>) {
    let mut ticks = tokio::time::interval(EXPIRY_INTERVAL);
    loop {
        ticks.tick().await;
        let state = state.clone();
        let expired = crate::blocking("putting sessions away", move || {
            state.sessions().expire(&state);
            state.exports().expire();
        });
        drop(expired.await);
    }
}

/// Done when the process is asked to stop.
async fn stop_signal() {
    let interrupted = async {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    #[cfg(unix)]
    let terminated = async {
        match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
            Ok(mut signal) => drop(signal.recv().await),
            Err(_) => std::future::pending().await,
        }
    };
    #[cfg(not(unix))]
    let terminated = std::future::pending::<()>();
    tokio::select! {
        () = interrupted => {}
        () = terminated => {}
    }
    tracing::info!("stopping");
}
