//! What holds for every command: threads, and how much is said.

use super::args::Manners;
use super::print;
use anyhow::{Context, Result};
use std::sync::OnceLock;

/// How much is said; set once, before the command.
static SAID: OnceLock<Said> = OnceLock::new();

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

/// Says on stdout what was done.
pub(crate) fn tell(text: &str) -> Result<()> {
    if is_quiet() { Ok(()) } else { print(text) }
}
