//! A service from its start to its end: what it listens on, what it takes over, and when it stops.

use crate::cage_job::local_designer;
use crate::config::ServeConfig;
use crate::descriptors;
use crate::http::listen::{Limits, serve, tls_config};
use crate::http::{admin, router, seen, seen_by_operators, spare, without_pages};
use crate::resources::Resources;
use crate::service::{Service, StartError};
use crate::store::{LocalDisk, StoreError};
use crate::telemetry;
use anyhow::{Context, Result, bail};
use std::io::Write;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

/// Connections of operators and their machines.
const OPERATORS: usize = 64;
/// How often it is tried to take over a database that another process has.
const TAKEOVER_PAUSE: Duration = Duration::from_millis(250);

/// Serves until a signal asks the process to stop. `version` is that of the program, for its metrics.
///
/// # Errors
/// A port, a folder or a file that cannot be used.
pub fn run(mut config: ServeConfig, version: &'static str) -> Result<()> {
    telemetry::init_logging(config.log, &config.log_filter)?;
    descriptors::make_room(&mut config);
    telemetry::metrics::recorder();
    metrics::gauge!("cager_build_info", "version" => version).set(1.0);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().thread_name("serve").build()?;
    let outcome = runtime.block_on(async {
        telemetry::traces::begin().map_err(|error| anyhow::anyhow!(error))?;
        let stop = CancellationToken::new();
        tokio::spawn(stop_on_signals(stop.clone()));
        run_until(config, stop, |address| {
            // For scripts that asked for any free port.
            let _ = writeln!(std::io::stdout(), "listening on {address}");
        })
        .await
    });
    telemetry::traces::end();
    // Blocking work that is left is not waited for: what was answered is on disk.
    runtime.shutdown_timeout(Duration::from_secs(2));
    outcome
}

/// Serves until `stop`; tells `listening` the address when connections are accepted.
///
/// # Errors
/// A port, a folder or a file that cannot be used.
pub(crate) async fn run_until(
    config: ServeConfig,
    stop: CancellationToken,
    listening: impl FnOnce(SocketAddr),
) -> Result<()> {
    telemetry::metrics::recorder();
    tokio::spawn(telemetry::metrics::keep(stop.clone()));
    let tls = config.tls().map(|tls| tls_config(&tls)).transpose()?;
    // What waits for a database that another process has listens to nobody, so that nobody is sent here.
    let Some(service) = start(config.clone(), &stop).await? else { return Ok(()) };
    let listener = listen(&config).await?;
    let drained = CancellationToken::new();
    listen_for_operators(&config, &service, drained.clone()).await?;
    listening(told(&listener, tls.is_some())?);
    let spare = spare(seen(Arc::clone(&service)));
    serve(listener, router(Arc::clone(&service)), spare, config.limits(), tls, stop).await?;
    // The operators' listener closes last.
    drained.cancel();
    if service.is_taken_over() {
        bail!("another process has taken over the database, and goes on with all sessions");
    }
    tracing::info!("stopped");
    Ok(())
}

async fn listen(config: &ServeConfig) -> Result<TcpListener> {
    TcpListener::bind(config.listen)
        .await
        .with_context(|| format!("{}: cannot be listened on; is it in use? give another --listen", config.listen))
}

/// Says where it listens.
fn told(listener: &TcpListener, is_tls: bool) -> Result<SocketAddr> {
    let address = listener.local_addr()?;
    tracing::info!(%address, scheme = if is_tls { "https" } else { "http" }, "listening");
    Ok(address)
}

/// Serves operators until `drained`, where the settings say so.
async fn listen_for_operators(config: &ServeConfig, service: &Arc<Service>, drained: CancellationToken) -> Result<()> {
    let Some(address) = config.admin_listen else { return Ok(()) };
    let listener = TcpListener::bind(address).await.with_context(|| {
        format!("{address}: cannot be listened on for operators; is it in use? give another --admin-listen")
    })?;
    let address = listener.local_addr()?;
    tracing::info!(%address, "listening for operators");
    let limits = Limits { max_connections: OPERATORS, max_per_address: OPERATORS, ..config.limits() };
    let open_to_all = address.ip().is_loopback();
    let seen = seen_by_operators(Arc::clone(service));
    let seen = if open_to_all { without_pages(seen) } else { seen };
    let routes = admin(Arc::clone(service), seen.clone(), open_to_all);
    tokio::spawn(serve(listener, routes, spare(seen), limits, None, drained));
    Ok(())
}

/// Opens the data folder. While another process has its database, waits for the end of that one; `None` where this one is stopped meanwhile.
async fn start(config: ServeConfig, stop: &CancellationToken) -> Result<Option<Arc<Service>>> {
    let resources = Resources::new(&config, local_designer())?;
    tokio::spawn(resources.access.clone().watch(stop.clone()));
    let mut is_told = false;
    loop {
        let (config, resources, own) = (config.clone(), Arc::clone(&resources), stop.clone());
        let opening = move || Service::open(resources, config, Arc::new(LocalDisk), own);
        let what = match tokio::task::spawn_blocking(opening).await? {
            Err(StartError::Store(StoreError::InUse { what })) => what,
            // Who waits does so through restarts of the database too.
            Err(StartError::Store(StoreError::Away { what, .. })) if is_told => what,
            started => return Ok(Some(started?)),
        };
        if !std::mem::replace(&mut is_told, true) {
            tracing::warn!("waits, to take over when that ends: {what}");
        }
        tokio::select! {
            () = tokio::time::sleep(TAKEOVER_PAUSE) => {}
            () = stop.cancelled() => return Ok(None),
        }
    }
}

/// Begins to stop at the first signal; the second one ends the process at once.
async fn stop_on_signals(stop: CancellationToken) {
    if signal().await.is_ok() {
        stop.cancel();
        tracing::info!("stopping; a second signal ends it at once");
        if signal().await.is_ok() {
            std::process::exit(130);
        }
    }
}

#[cfg(unix)]
async fn signal() -> std::io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let (mut interrupt, mut terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    tokio::select! {
        _ = interrupt.recv() => {}
        _ = terminate.recv() => {}
    }
    Ok(())
}

#[cfg(not(unix))]
async fn signal() -> std::io::Result<()> {
    tokio::signal::ctrl_c().await
}
