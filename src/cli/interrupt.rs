//! Handling of SIGINT and similar signals while outputs are incomplete.

use anyhow::Result;
use std::sync::{Mutex, PoisonError};

/// What a signal that ends the process has it say.
static LAST_WORDS: Mutex<String> = Mutex::new(String::new());

/// Sets what is said if a signal ends the process: what is left elsewhere, and how to go on with it.
pub(super) fn set_last_words(text: String) {
    *LAST_WORDS.lock().unwrap_or_else(PoisonError::into_inner) = text;
}

/// From here on a signal that asks the process to end removes its temporary files and folders first; a second one ends
/// it at once. Either way the process dies by the signal, so that a shell's loop around it stops too.
///
/// To be called by a command before it begins its first output, and not for all of them: a server ends in its own way,
/// answering what it has begun to.
///
/// # Errors
/// No thread or handler for signals to be had.
pub(super) fn remove_temporaries_on_signal() -> Result<()> {
    #[cfg(unix)]
    unix::install()?;
    // On Windows, Ctrl-C leaves what it always did: a temporary file or folder that begins with `.cager-`.
    Ok(())
}

#[cfg(unix)]
mod unix {
    use anyhow::{Context, Result};
    use cager_formats::remove_temporaries;
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::flag;
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;
    use std::io::Write;
    use std::sync::atomic::AtomicBool;
    use std::sync::mpsc::channel;
    use std::sync::{Arc, PoisonError};

    pub(super) fn install() -> Result<()> {
        let what = "signals cannot be watched; free some memory or processes and try again";
        let (send, receive) = channel::<Signals>();
        // Before the handlers: with these and no thread, the first Ctrl-C would do nothing.
        let thread = move || {
            if let Some(signal) = receive.recv().ok().and_then(|mut signals| signals.forever().next()) {
                remove_temporaries();
                let said = super::LAST_WORDS.lock().unwrap_or_else(PoisonError::into_inner);
                if !said.is_empty() {
                    // Nowhere is left to report a closed stderr to.
                    let _ = writeln!(std::io::stderr(), "cager: {said}");
                }
                // The signals known to this cannot fail.
                let _ = emulate_default_handler(signal);
            }
        };
        std::thread::Builder::new().name("signals".to_owned()).spawn(thread).context(what)?;
        let watched = watched();
        send.send(Signals::new(&watched).context(what)?).context(what)?;
        let once = Arc::new(AtomicBool::new(false));
        for &signal in &watched {
            // In this order, so that the first signal sets what the second finds set.
            flag::register_conditional_default(signal, Arc::clone(&once)).context(what)?;
            flag::register(signal, Arc::clone(&once)).context(what)?;
        }
        Ok(())
    }

    /// What was ignored stays ignored, as under `nohup` and in a script's background.
    fn watched() -> Vec<i32> {
        match std::fs::read_to_string("/proc/self/status").ok().as_deref().and_then(ignored) {
            Some(ignored) => [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|s| ignored >> (s - 1) & 1 == 0).collect(),
            // Where that cannot be told, a folder left by a closed terminal is the lesser harm than a job of hours
            // ended in spite of `nohup`.
            None => vec![SIGINT, SIGTERM],
        }
    }

    /// The set of ignored signals in Linux's account of a process.
    fn ignored(status: &str) -> Option<u64> {
        let set = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
        u64::from_str_radix(set.trim(), 16).ok()
    }

    #[cfg(test)]
    mod tests {
        #[test]
        fn ignored_signals_are_read_from_the_account_of_the_process() {
            assert_eq!(super::ignored("Name:\tcager\nSigBlk:\t00\nSigIgn:\t0000000000001003\n"), Some(0x1003));
            assert_eq!(super::ignored("Name:\tcager\n"), None);
        }
    }
}
