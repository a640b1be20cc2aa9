//! Pools of threads that compute.

/// Where the threads that compute stand behind those that answer, as `nice` counts: low enough that a request is not kept waiting by
/// a solve, high enough that other programs of the machine do not starve them.
#[cfg(target_os = "linux")]
const GIVES_WAY: i32 = 5;

/// A rayon pool of `count` threads, 0 for one per processor, called `name-0`, `name-1`, …, that give way to the threads that serve
/// connections.
///
/// # Errors
/// The system's, where threads cannot be started.
pub(crate) fn pool(name: &'static str, count: usize) -> std::io::Result<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .thread_name(move |k| format!("{name}-{k}"))
        .start_handler(|_| gives_way())
        .build()
        .map_err(std::io::Error::other)
}

/// On Linux the priority is the calling thread's own; elsewhere it is the process's, and stays.
fn gives_way() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(GIVES_WAY) {
        tracing::debug!(%error, "a computing thread keeps the usual priority");
    }
}
