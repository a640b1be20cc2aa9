//! Thread pools for computation.

/// Niceness of threads that solve frames: lower priority than the threads that serve requests, but not starved by other processes.
pub(crate) const NICE_SOLVE: i32 = 5;
/// Niceness of threads that prepare and of those for background work: a third of the weight of those that solve, and a ninth of that of other programs, beside
/// which they must still end.
pub(crate) const NICE_BACKGROUND: i32 = 10;

/// A rayon pool of `count` threads (0: one per processor) named `name-0`, `name-1`, …, whose priority is lowered by `nice`.
///
/// # Errors
/// Threads cannot be started.
pub(crate) fn pool(name: &'static str, count: usize, nice: i32) -> std::io::Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .thread_name(move |k| format!("{name}-{k}"))
        .start_handler(move |_| lower_priority(nice))
        .build()
        .map_err(std::io::Error::other)
}

/// On Linux niceness is per thread; elsewhere it is per process and is not changed.
fn lower_priority(nice: i32) {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(nice) {
        tracing::debug!(%error, "a computing thread keeps the usual priority");
    }
    #[cfg(not(target_os = "linux"))]
    let _ = nice;
}
