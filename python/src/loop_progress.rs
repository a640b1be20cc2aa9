//! Progress of a call that is awaited, told on its event loop: the newest state, where the loop is busy.

use crate::fault::Fault;
use pyo3::prelude::*;
use pyo3::types::PyCFunction;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::Notify;

/// Who is told of the progress.
pub(crate) struct LoopProgress {
    callback: Option<Py<PyAny>>,
    /// `call_soon_threadsafe` of the event loop.
    post: Py<PyAny>,
    state: Mutex<State>,
    raised: Notify,
}

#[derive(Default)]
struct State {
    /// What the loop has not told yet.
    waiting: Option<(String, f64)>,
    /// What the callback has raised.
    error: Option<PyErr>,
    /// Whether nobody waits for the result any more.
    ended: bool,
}

impl LoopProgress {
    pub(crate) fn new(callback: Option<Py<PyAny>>, post: Py<PyAny>) -> Arc<Self> {
        Arc::new(Self { callback, post, state: Mutex::default(), raised: Notify::new() })
    }

    /// Tells what is done now, and which fraction of it is.
    pub(crate) fn tell(self: &Arc<Self>, stage: &str, fraction: f64) {
        if self.callback.is_none() || self.lock().waiting.replace((stage.to_owned(), fraction)).is_some() {
            return;
        }
        let progress = Arc::clone(self);
        // Where Python or the loop has ended, nobody listens.
        let _ = Python::try_attach(|py| {
            let run = PyCFunction::new_closure(py, None, None, move |arguments, _| progress.run(arguments.py()))?;
            self.post.call1(py, (run,)).map(drop)
        });
    }

    /// On the event loop.
    fn run(&self, py: Python<'_>) {
        let mut state = self.lock();
        let (Some((stage, fraction)), None) = (state.waiting.take(), &state.error) else { return };
        drop(state);
        let Some(callback) = &self.callback else { return };
        if let Err(error) = callback.call1(py, (stage, fraction)) {
            let mut state = self.lock();
            state.error = Some(error);
            state.ended = true;
            drop(state);
            self.raised.notify_one();
        }
    }

    /// The result of `work`, which is dropped where the callback raises an exception.
    pub(crate) async fn or<T>(&self, work: impl Future<Output = Result<T, Fault>>) -> Result<T, Fault> {
        tokio::select! {
            result = work => result,
            () = self.raised.notified() => Err(Fault::Told("stopped by an exception".to_owned())),
        }
    }

    /// A result, unless the callback has raised an exception.
    pub(crate) fn unless_raised<T>(&self, result: Result<T, Fault>) -> Result<T, Fault> {
        self.lock().error.take().map_or(result, |error| Err(Fault::Raised(error)))
    }

    /// What still computes stops.
    pub(crate) fn end(&self) {
        self.lock().ended = true;
    }

    pub(crate) fn is_ended(&self) -> bool {
        self.lock().ended
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
