//! The one thread that writes: what waits is written in one transaction, so that many callers share one sync.

use super::explain;
use crate::CatalogError;
use crate::link::Link;
use crate::trouble::Trouble;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::thread::JoinHandle;

/// Most pieces of work in one transaction.
const TOGETHER: usize = 64;

/// Tells the caller how the transaction ended.
type Deliver = Box<dyn FnOnce(Result<(), CatalogError>) + Send>;
/// Changes something, unless the connection cannot: then it only passes the error on. Gives its own error, after which its changes are undone.
type Work = Box<dyn FnOnce(Result<&mut Link, CatalogError>) -> (Option<CatalogError>, Deliver) + Send>;

/// Handle to the thread, which ends with it.
#[derive(Debug)]
pub(super) struct Writer {
    queue: Option<Sender<Work>>,
    thread: Option<JoinHandle<()>>,
}

impl Writer {
    pub(super) fn start(link: Link) -> Result<Self, CatalogError> {
        let (queue, waiting) = channel();
        let thread = std::thread::Builder::new().name("catalogue".to_owned()).spawn(move || write_all(link, &waiting));
        let thread = thread.map_err(|error| CatalogError::Failed(format!("threads cannot be started: {error}")))?;
        Ok(Self { queue: Some(queue), thread: Some(thread) })
    }

    /// Does `work` in a transaction; what it changed is durable on `Ok`, and undone after an error.
    pub(super) fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Link) -> Result<T, Trouble> + Send + 'static,
    ) -> Result<T, CatalogError> {
        let (answer, answered) = sync_channel(1);
        let work: Work = Box::new(move |link| {
            let outcome = link.and_then(|link| work(link).map_err(explain));
            let error = outcome.as_ref().err().cloned();
            // Nobody listens only where the caller panicked.
            let deliver =
                move |ended: Result<(), _>| drop(answer.send(outcome.and_then(|value| ended.map(|()| value))));
            (error, Box::new(deliver))
        });
        let ended = || CatalogError::Failed("the thread that writes has ended".to_owned());
        self.queue.as_ref().ok_or_else(ended)?.send(work).map_err(|_| ended())?;
        answered.recv().map_err(|_| CatalogError::Failed("writing panicked".to_owned()))?
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.queue = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn write_all(mut link: Link, waiting: &Receiver<Work>) {
    while let Ok(first) = waiting.recv() {
        let mut works: VecDeque<Work> = std::iter::once(first).chain(waiting.try_iter().take(TOGETHER - 1)).collect();
        while !works.is_empty() {
            write_together(&mut link, &mut works);
        }
    }
}

/// Does pieces of work in one transaction, until the database undoes all of it, as it does on a full disk: then those done so far are told, and
/// the others are left.
fn write_together(link: &mut Link, works: &mut VecDeque<Work>) {
    let mut kept = Vec::new();
    let mut outcome = execute(link, "BEGIN IMMEDIATE");
    while let Some(work) = works.pop_front() {
        let ready = outcome.clone().and_then(|()| execute(link, "SAVEPOINT one"));
        let Ok((error, deliver)) = catch_unwind(AssertUnwindSafe(|| work(ready.map(|()| &mut *link)))) else {
            // Who waits for it hears nothing more, which says so.
            outcome = outcome.and_then(|()| undo_one(link, CatalogError::Failed("writing panicked".to_owned())));
            continue;
        };
        match error {
            None => {
                kept.push(deliver);
                outcome = execute(link, "RELEASE one");
            }
            Some(error) => {
                deliver(Ok(()));
                outcome = outcome.and_then(|()| undo_one(link, error));
            }
        }
        if outcome.is_err() {
            break;
        }
    }
    let outcome = outcome.and_then(|()| execute(link, "COMMIT"));
    if outcome.is_err() {
        // It fails where the database has undone the transaction itself.
        let _ = execute(link, "ROLLBACK");
    }
    kept.into_iter().for_each(|deliver| deliver(outcome.clone()));
}

fn execute(link: &mut Link, sql: &'static str) -> Result<(), CatalogError> {
    link.execute(sql, &[]).map(drop).map_err(explain)
}

/// Undoes one piece of work after its error; where the database has undone the whole transaction, that error is the
/// outcome of all.
fn undo_one(link: &mut Link, error: CatalogError) -> Result<(), CatalogError> {
    execute(link, "ROLLBACK TO one").map_err(|_| error)?;
    execute(link, "RELEASE one")
}
