//! Counters that are there from the start, at 0: what counts from nothing to 1 has not increased for Prometheus, and alerts would miss the first time. Those by
//! tenant come with the tenant.

use crate::http::listen::Reason;
use crate::problem;
use metrics::counter;
use std::collections::BTreeSet;

/// Why requests are turned away.
pub(crate) const REJECTIONS: [&str; 20] = [
    "unauthorized",
    "origin",
    "scope",
    "requests",
    "streams",
    "queue",
    "connections",
    "timeout",
    "prepare_queue",
    "design_queue",
    "transfer_queue",
    "recovery_queue",
    "frame_memory",
    "upload_memory",
    "download_memory",
    "spool_space",
    "body_too_large",
    "tenant_sessions",
    "tenant_streams",
    "tenant_bytes",
];

/// Begins to count.
pub(super) fn begin() {
    counter!("cager_accept_errors_total").increment(0);
    counter!("cager_body_timeouts_total").increment(0);
    counter!("cager_cache_evictions_total").increment(0);
    counter!("cager_connections_total").increment(0);
    counter!("cager_log_bytes_total").increment(0);
    counter!("cager_quarantined_total").increment(0);
    counter!("cager_sessions_expired_total").increment(0);
    for reason in REJECTIONS {
        counter!("cager_rejections_total", "reason" => reason).increment(0);
    }
    for reason in Reason::LABELS {
        counter!("cager_connections_closed_total", "reason" => *reason).increment(0);
    }
    for reason in ["spare", "full", "address"] {
        counter!("cager_connections_rejected_total", "reason" => reason).increment(0);
    }
    for result in ["memory", "disk", "joined", "miss"] {
        counter!("cager_cache_total", "result" => result).increment(0);
    }
    for result in ["completed", "failed", "known"] {
        counter!("cager_designs_total", "result" => result).increment(0);
    }
    for result in ["completed", "failed"] {
        counter!("cager_recoveries_total", "result" => result).increment(0);
        counter!("cager_transfers_total", "result" => result).increment(0);
    }
    for result in ["delivered", "given_up", "gone", "failed_attempt"] {
        counter!("cager_webhooks_total", "result" => result).increment(0);
    }
    let statuses: BTreeSet<u16> = problem::ALL.iter().map(|kind| kind.status.as_u16()).chain([200]).collect();
    for status in statuses {
        counter!("cager_requests_total", "status" => status.to_string()).increment(0);
    }
}

#[cfg(test)]
mod tests {
    use super::{REJECTIONS, Reason};
    use std::collections::BTreeSet;

    #[test]
    fn the_reasons_are_those_of_the_document() {
        let document = include_str!("../../../../docs/OPERATIONS.md");
        for (metric, reasons) in
            [("cager_rejections_total", &REJECTIONS[..]), ("cager_connections_closed_total", Reason::LABELS)]
        {
            let row = document.lines().find(|line| line.starts_with(&format!("| `{metric}` |"))).expect("its row");
            // Every second piece is between backticks.
            let told: BTreeSet<&str> = row.split('`').skip(1).step_by(2).collect();
            let wanted = reasons.iter().copied().chain([metric, "reason"]).collect();
            assert_eq!(told, wanted);
        }
    }
}
