//! What holds for every command: threads, and how much is said.

use super::args::Manners;
use super::print;
use anyhow::{Context, Result};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// How much is said; set once, before the command.
static SAID: OnceLock<Said> = OnceLock::new();

/// Whether stdout holds an output, so that nothing else may go there.
static STDOUT_TAKEN: AtomicBool = AtomicBool::new(false);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Said {
    Least,
    Usual,
    Most,
}

impl Manners {
    pub(super) fn adopt(&self) -> Result<()> {
        let said = match (self.quiet, self.verbose) {
            (true, _) => Said::Least,
            (_, true) => Said::Most,
            _ => Said::Usual,
        };
        let _ = SAID.set(said);
        if let Some(threads) = self.threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
            pool.build_global().with_context(|| format!("--threads {threads}"))?;
        }
        Ok(())
    }
}

/// Whether only what was asked for is said.
pub(crate) fn is_quiet() -> bool {
    SAID.get() == Some(&Said::Least)
}

/// Whether times are said, too.
pub(crate) fn is_verbose() -> bool {
    SAID.get() == Some(&Said::Most)
}

/// Takes stdout for an output; false where another one has it.
pub(super) fn take_stdout() -> bool {
    !STDOUT_TAKEN.swap(true, Ordering::Relaxed)
}

pub(super) fn stdout_is_taken() -> bool {
    STDOUT_TAKEN.load(Ordering::Relaxed)
}

/// Says on stdout what was done, or on stderr where stdout holds an output.
pub(crate) fn tell(text: &str) -> Result<()> {
    if is_quiet() { Ok(()) } else { print(text) }
}
