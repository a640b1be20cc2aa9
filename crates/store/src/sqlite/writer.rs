//! The one thread that writes: what waits is written in one transaction, so that many callers share one sync.

use crate::CatalogError;
use rusqlite::Connection;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::thread::JoinHandle;

/// Most pieces of work in one transaction.
const TOGETHER: usize = 64;

/// Tells the caller how the transaction ended.
type Deliver = Box<dyn FnOnce(Result<(), CatalogError>) + Send>;
/// Changes something, unless the connection cannot: then it only passes the error on. Gives its own error, after which its changes are undone.
type Work = Box<dyn FnOnce(Result<&Connection, CatalogError>) -> (Option<CatalogError>, Deliver) + Send>;

/// Handle to the thread, which ends with it.
#[derive(Debug)]
pub(super) struct Writer {
    queue: Option<Sender<Work>>,
    thread: Option<JoinHandle<()>>,
}

impl Writer {
    pub(super) fn start(connection: Connection) -> Result<Self, CatalogError> {
        let (queue, waiting) = channel();
        let thread =
            std::thread::Builder::new().name("catalogue".to_owned()).spawn(move || write_all(connection, &waiting));
        let thread = thread.map_err(|error| CatalogError::Failed(format!("threads cannot be started: {error}")))?;
        Ok(Self { queue: Some(queue), thread: Some(thread) })
    }

    /// Does `work` in a transaction; what it changed is durable on `Ok`, and undone after an error.
    pub(super) fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Connection) -> Result<T, CatalogError> + Send + 'static,
    ) -> Result<T, CatalogError> {
        let (answer, answered) = sync_channel(1);
        let work: Work = Box::new(move |connection| {
            let outcome = connection.and_then(work);
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

fn write_all(connection: Connection, waiting: &Receiver<Work>) {
    while let Ok(first) = waiting.recv() {
        let mut works: VecDeque<Work> = std::iter::once(first).chain(waiting.try_iter().take(TOGETHER - 1)).collect();
        while !works.is_empty() {
            write_together(&connection, &mut works);
        }
    }
    if let Err((_, error)) = connection.close() {
        tracing::warn!(%error, "the catalogue could not be closed");
    }
}

/// Does pieces of work in one transaction, until the database undoes all of it, as it does on a full disk: then those done so far are told, and
/// the others are left.
fn write_together(connection: &Connection, works: &mut VecDeque<Work>) {
    let mut kept = Vec::new();
    let mut outcome = connection.execute_batch("BEGIN IMMEDIATE").map_err(CatalogError::from);
    while let Some(work) = works.pop_front() {
        let ready = outcome.clone().and_then(|()| Ok(connection.execute_batch("SAVEPOINT one")?));
        let Ok((error, deliver)) = catch_unwind(AssertUnwindSafe(|| work(ready.map(|()| connection)))) else {
            // Who waits for it hears nothing more, which says so.
            outcome = outcome.and_then(|()| undo_one(connection, CatalogError::Failed("writing panicked".to_owned())));
            continue;
        };
        match error {
            None => {
                kept.push(deliver);
                outcome = connection.execute_batch("RELEASE one").map_err(CatalogError::from);
            }
            Some(error) => {
                deliver(Ok(()));
                outcome = outcome.and_then(|()| undo_one(connection, error));
            }
        }
        if outcome.is_err() {
            break;
        }
    }
    let outcome = outcome.and_then(|()| connection.execute_batch("COMMIT").map_err(CatalogError::from));
    if outcome.is_err()
        && !connection.is_autocommit()
        && let Err(error) = connection.execute_batch("ROLLBACK")
    {
        tracing::error!(%error, "a failed change of the catalogue could not be undone");
    }
    kept.into_iter().for_each(|deliver| deliver(outcome.clone()));
}

/// Undoes one piece of work after its error, unless the database has undone the whole transaction.
fn undo_one(connection: &Connection, error: CatalogError) -> Result<(), CatalogError> {
    if connection.is_autocommit() {
        return Err(error);
    }
    Ok(connection.execute_batch("ROLLBACK TO one; RELEASE one")?)
}
