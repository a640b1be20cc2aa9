//! Computations that do not look up until they are done, on threads of their own, so that whoever waits for them can be interrupted.

use crate::fault::{Fault, own_fault};
use crate::watch::Watch;
use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

/// How long an interrupt waits at the most.
const PAUSE: Duration = Duration::from_millis(50);

/// Whoever waits for a computation, as it sees them.
pub(crate) struct Caller<M>(Sender<Note<M>>);

enum Note<M> {
    /// What is done now, and which fraction of it is.
    Told(String, f64),
    Asked(M),
}

impl<M> Caller<M> {
    /// Tells what is done now, and which fraction of it is; [`ControlFlow::Break`] where nobody waits any more.
    pub(crate) fn tell(&self, stage: &str, fraction: f64) -> ControlFlow<()> {
        self.send(Note::Told(stage.to_owned(), fraction))
    }

    /// Asks for something; [`ControlFlow::Break`] where nobody waits any more.
    pub(crate) fn ask(&self, what: M) -> ControlFlow<()> {
        self.send(Note::Asked(what))
    }

    fn send(&self, note: Note<M>) -> ControlFlow<()> {
        self.0.send(note).map_or(ControlFlow::Break(()), ControlFlow::Continue)
    }
}

impl<M> Clone for Caller<M> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

/// What `work` gives, unless the user interrupts it.
pub(crate) fn interruptible<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Fault> + Send + 'static,
) -> Result<T, Fault> {
    let watch = Watch::new(None);
    apart(&watch, "coordinates", |_: Caller<()>| work(), |()| ()).flatten()
}

/// What `work` gives, whose questions are answered by `serve`; where the watch stops, it is left alone, and ends when it tells or asks next.
pub(crate) fn apart<T: Send + 'static, M: Send + 'static>(
    watch: &Watch,
    stage: &str,
    work: impl FnOnce(Caller<M>) -> T + Send + 'static,
    mut serve: impl FnMut(M),
) -> Result<T, Fault> {
    // Nothing is begun where the user has had enough already.
    if watch.tell(stage, 0.0).is_break() {
        return watch.unless_stopped(Err(own_fault()));
    }
    let (caller, notes) = mpsc::channel();
    let worker = thread::Builder::new().name("cager-apart".to_owned()).spawn(move || work(Caller(caller)));
    let worker = worker
        .map_err(|error| Fault::Told(format!("no thread can be started ({error}); end some programs and try again")))?;
    let (mut now, mut next) = ((stage.to_owned(), 0.0), Instant::now() + PAUSE);
    loop {
        if Instant::now() >= next {
            if watch.tell(&now.0, now.1).is_break() {
                return watch.unless_stopped(Err(own_fault()));
            }
            next = Instant::now() + PAUSE;
        }
        match notes.recv_timeout(next.saturating_duration_since(Instant::now())) {
            Ok(Note::Told(stage, fraction)) => (now, next) = ((stage, fraction), Instant::now()),
            Ok(Note::Asked(what)) => serve(what),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return worker.join().map_err(|_| own_fault()),
        }
    }
}
