//! Pools of threads that compute.

/// Where the threads that compute stand behind those that answer, as `nice` counts: low enough that a request is not kept waiting by
/// a solve, high enough that other programs of the machine do not starve them.
pub(crate) const GIVES_WAY: i32 = 5;
/// Where the threads stand behind those that nobody should have to wait for.
pub(crate) const GIVES_WAY_TO_ALL: i32 = 15;

/// A rayon pool of `count` threads, 0 for one per processor, called `name-0`, `name-1`, …, that give way to the threads that serve
/// connections by this much.
///
/// # Errors
/// The system's, where threads cannot be started.
pub(crate) fn pool(name: &'static str, count: usize, nice: i32) -> std::io::Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .thread_name(move |k| format!("{name}-{k}"))
        .start_handler(move |_| gives_way(nice))
        .build()
        .map_err(std::io::Error::other)
}

/// On Linux the priority is the calling thread's own; elsewhere it is the process's, and stays.
fn gives_way(nice: i32) {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(nice) {
        tracing::debug!(%error, "a computing thread keeps the usual priority");
    }
    #[cfg(not(target_os = "linux"))]
    let _ = nice;
}
