//! Options of every command: number of threads and verbosity.

use super::args::GlobalArgs;
use super::print;
use anyhow::{Context, Result};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Verbosity; set once, before the command.
static VERBOSITY: OnceLock<Verbosity> = OnceLock::new();

/// Whether stdout holds an output, so that nothing else may go there.
static STDOUT_TAKEN: AtomicBool = AtomicBool::new(false);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Verbosity {
    Quiet,
    Normal,
    Verbose,
}

impl GlobalArgs {
    pub(super) fn apply(&self) -> Result<()> {
        let said = match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        };
        let _ = VERBOSITY.set(said);
        if let Some(threads) = self.threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
            pool.build_global().with_context(|| format!("--threads {threads}"))?;
        }
        Ok(())
    }
}

/// Whether `--quiet` is given.
pub(crate) fn is_quiet() -> bool {
    VERBOSITY.get() == Some(&Verbosity::Quiet)
}

/// Whether `--verbose` is given.
pub(crate) fn is_verbose() -> bool {
    VERBOSITY.get() == Some(&Verbosity::Verbose)
}

/// Takes stdout for an output; false where another one has it.
pub(super) fn take_stdout() -> bool {
    !STDOUT_TAKEN.swap(true, Ordering::Relaxed)
}

pub(super) fn stdout_is_taken() -> bool {
    STDOUT_TAKEN.load(Ordering::Relaxed)
}

/// Prints a summary to stdout, or to stderr where stdout holds an output; nothing with `--quiet`.
pub(crate) fn tell(text: &str) -> Result<()> {
    if is_quiet() { Ok(()) } else { print(text) }
}
