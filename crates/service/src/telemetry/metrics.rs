//! Metrics for operators, in Prometheus' format. `docs/OPERATIONS.md` lists them.

use crate::service::Service;
use crate::sync::lock;
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use metrics_process::Collector;
use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Histogram buckets of short operations, in seconds.
const SHORT: &[f64] = &[1e-4, 2.5e-4, 5e-4, 1e-3, 2.5e-3, 5e-3, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0];
/// Histogram buckets of preparations and designs, in seconds.
const LONG: &[f64] = &[0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0];

/// Interval at which histograms are aggregated.
const UPKEEP: Duration = Duration::from_secs(5);

/// The process's metrics recorder, installed by the first call.
pub fn recorder() -> &'static PrometheusHandle {
    static HANDLE: OnceLock<PrometheusHandle> = OnceLock::new();
    HANDLE.get_or_init(|| {
        let builder = PrometheusBuilder::new();
        let named = |name: &str| Matcher::Full(name.to_owned());
        let builder = builder
            .set_buckets(SHORT)
            .and_then(|b| b.set_buckets_for_metric(named("cager_prepare_seconds"), LONG))
            .and_then(|b| b.set_buckets_for_metric(named("cager_design_seconds"), LONG))
            .expect("the buckets are not empty");
        let recorder = builder.build_recorder();
        let handle = recorder.handle();
        // Another recorder of the process keeps its place; this one then stays empty.
        if metrics::set_global_recorder(recorder).is_err() {
            tracing::warn!("another metrics recorder is installed");
        }
        describe();
        super::zeros::begin();
        Collector::default().describe();
        handle
    })
}

/// Periodically aggregates histograms until `stop`, which bounds their memory even if nobody scrapes them.
pub async fn keep(stop: CancellationToken) {
    while stop.run_until_cancelled(tokio::time::sleep(UPKEEP)).await.is_some() {
        recorder().run_upkeep();
    }
}

/// Sets the gauges that are computed on demand.
pub(crate) fn observe(service: &Service) {
    Collector::default().collect();
    metrics::gauge!("cager_queue_frames").set(service.engine.waiting() as f64);
    metrics::gauge!("cager_streams").set(service.open_streams() as f64);
    metrics::gauge!("cager_preparing").set(service.solvers.in_flight() as f64);
    metrics::gauge!("cager_cache_bytes", "cache" => "solvers").set(lock(&service.kept_solvers).bytes() as f64);
    metrics::gauge!("cager_designing").set(service.cage_jobs.unfinished() as f64);
    metrics::gauge!("cager_recovering").set(service.recoveries.unfinished() as f64);
    let kept = service.recovering.used() + service.recoveries_kept.used();
    metrics::gauge!("cager_recoveries_in_memory").set(kept as f64);
    metrics::gauge!("cager_transferring").set(service.transfers.unfinished() as f64);
    metrics::gauge!("cager_shapespaces").set(service.shape_spaces.count() as f64);
    metrics::gauge!("cager_memory_bytes", "use" => "shapespaces").set(service.shape_memory.used() as f64);
    metrics::gauge!("cager_memory_bytes", "use" => "designs").set(service.designs.bytes() as f64);
    metrics::gauge!("cager_memory_bytes", "use" => "frames").set(service.frame_memory.used() as f64);
    metrics::gauge!("cager_memory_bytes", "use" => "downloads").set(service.download_memory.used() as f64);
    metrics::gauge!("cager_disk_bytes", "use" => "spool").set(service.spool_space.used() as f64);
    metrics::gauge!("cager_memory_bytes", "use" => "uploads").set(service.upload_memory.used() as f64);
    metrics::gauge!("cager_disk_free_bytes").set(service.store.free_bytes() as f64);
    metrics::gauge!("cager_uptime_seconds").set(service.started.elapsed().as_secs_f64());
    // A tenant without sessions is reported as 0, not with its last value.
    static SEEN: Mutex<BTreeMap<String, (usize, u64)>> = Mutex::new(BTreeMap::new());
    let mut seen = lock(&SEEN);
    seen.values_mut().for_each(|usage| *usage = (0, 0));
    seen.extend(service.usage().into_iter().map(|(tenant, sessions, bytes)| (tenant, (sessions, bytes))));
    for (tenant, (sessions, bytes)) in &*seen {
        metrics::gauge!("cager_sessions", "tenant" => tenant.clone()).set(*sessions as f64);
        metrics::gauge!("cager_stored_bytes", "tenant" => tenant.clone()).set(*bytes as f64);
    }
}

fn describe() {
    use metrics::{Unit, describe_counter, describe_gauge, describe_histogram};
    describe_counter!("cager_frames_total", "Frames solved and on disk, by tenant and rows sent");
    describe_counter!("cager_received_bytes_total", Unit::Bytes, "Bytes of frames received, by tenant");
    describe_counter!("cager_log_bytes_total", Unit::Bytes, "Bytes of cages stored");
    describe_counter!("cager_sessions_created_total", "Sessions made, by tenant");
    describe_counter!("cager_sessions_expired_total", "Sessions deleted because of their age");
    describe_counter!("cager_quarantined_total", "Sessions, jobs and files found damaged");
    describe_gauge!("cager_build_info", "Always 1; version and commit of the program");
    describe_counter!("cager_webhooks_total", "Messages to webhooks, by result: delivered, given_up, gone");
    describe_counter!("cager_rejections_total", "Requests turned away, by reason");
    describe_counter!("cager_requests_total", "Requests, by status class");
    describe_counter!("cager_connections_total", "Connections accepted");
    describe_counter!("cager_connections_closed_total", "Connections that ended, by how");
    describe_counter!(
        "cager_connections_rejected_total",
        "Connections beyond the limit: spare (answered once) or full"
    );
    describe_counter!("cager_accept_errors_total", "Errors of accepting connections");
    describe_gauge!("cager_disk_bytes", Unit::Bytes, "Disk space of cages waiting to be decoded");
    describe_counter!("cager_body_timeouts_total", "Request bodies that stopped arriving");
    describe_gauge!("cager_connections", "Open connections");
    describe_counter!(
        "cager_cache_total",
        "Requests for solvers, by result: memory, disk, joined (already being prepared) or miss"
    );
    describe_counter!("cager_cache_evictions_total", "Solvers evicted from memory");
    describe_gauge!("cager_cache_bytes", Unit::Bytes, "Memory of caches");
    describe_gauge!("cager_queue_frames", "Frames and cages waiting to be solved or decoded");
    describe_gauge!("cager_streams", "Uploads, followers and decodings that run");
    describe_gauge!("cager_preparing", "Sessions being prepared or waiting for it");
    describe_gauge!("cager_designing", "Cages being designed or waiting for it");
    describe_counter!(
        "cager_designs_total",
        "Cage designs that ended, by result: completed, failed, or known from an earlier one"
    );
    describe_gauge!("cager_recovering", "Recoveries that are not over");
    describe_gauge!("cager_recoveries_in_memory", "Recoveries that work, or wait with all they know in memory");
    describe_counter!("cager_recoveries_total", "Recoveries that ended, by result: completed or failed");
    describe_counter!("cager_recovered_frames_total", "Frames of recoveries that were followed, by tenant");
    describe_gauge!("cager_transferring", "Transfers that run or wait");
    describe_counter!("cager_transfers_total", "Transfers that ended, by result: completed or failed");
    describe_counter!("cager_transferred_frames_total", "Frames that transfers moved, by tenant");
    describe_gauge!("cager_shapespaces", "Shape spaces in memory");
    describe_histogram!("cager_shape_seconds", Unit::Seconds, "Finding a shape between poses");
    describe_histogram!("cager_design_seconds", Unit::Seconds, "Designing a cage");
    describe_gauge!(
        "cager_memory_bytes",
        Unit::Bytes,
        "Memory of frames, uploads, downloads and designs in progress, and of shape spaces"
    );
    describe_gauge!("cager_disk_free_bytes", Unit::Bytes, "Free space of the data folder's file system");
    describe_gauge!("cager_uptime_seconds", Unit::Seconds, "Time since the service started");
    describe_gauge!("cager_sessions", "Sessions, by tenant");
    describe_gauge!("cager_stored_bytes", Unit::Bytes, "Disk space of sessions and jobs, by tenant");
    describe_counter!("cager_coded_frames_total", "Frames coded in groups, by tenant");
    describe_histogram!("cager_queue_seconds", Unit::Seconds, "Wait of a batch's oldest frame");
    describe_histogram!("cager_solve_seconds", Unit::Seconds, "Inverting and measuring a batch of up to 16 frames");
    describe_histogram!("cager_prepare_seconds", Unit::Seconds, "Preparing a solver");
    describe_histogram!("cager_fsync_seconds", Unit::Seconds, "Syncing to disk");
    describe_histogram!("cager_request_seconds", Unit::Seconds, "From a request to its response's header, by route");
}
