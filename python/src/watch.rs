//! Progress of a computation: told to Python's callback, whose exceptions, and the interrupts of the user, end it.

use crate::fault::Fault;
use crate::loop_progress::LoopProgress;
use pyo3::exceptions::PyInterruptedError;
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

/// Who is told of the progress.
pub(crate) struct Watch {
    tell: Box<Tell>,
    raised: Mutex<Option<PyErr>>,
}

type Tell = dyn Fn(&str, f64) -> PyResult<()> + Send + Sync;

impl Watch {
    /// Of a call that waits for the computation.
    pub(crate) fn new(callback: Option<Py<PyAny>>) -> Self {
        let tell = move |stage: &str, fraction| {
            Python::attach(|py| {
                py.check_signals()?;
                callback.as_ref().map_or(Ok(()), |callback| callback.call1(py, (stage, fraction)).map(drop))
            })
        };
        Self { tell: Box::new(tell), raised: Mutex::new(None) }
    }

    /// Of a call that is awaited.
    pub(crate) fn on_loop(progress: Arc<LoopProgress>) -> Self {
        let tell = move |stage: &str, fraction| {
            progress.tell(stage, fraction);
            if progress.is_ended() { Err(PyInterruptedError::new_err("stopped")) } else { Ok(()) }
        };
        Self { tell: Box::new(tell), raised: Mutex::new(None) }
    }

    /// Tells what is done now, and which fraction of it is; [`ControlFlow::Break`] from the first exception on.
    pub(crate) fn tell(&self, stage: &str, fraction: f64) -> ControlFlow<()> {
        if self.is_stopped() {
            return ControlFlow::Break(());
        }
        match (self.tell)(stage, fraction) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                *self.lock() = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.lock().is_some()
    }

    /// A result, unless an exception has ended the computation.
    pub(crate) fn unless_stopped<T>(&self, result: Result<T, Fault>) -> Result<T, Fault> {
        self.lock().take().map_or(result, |error| Err(Fault::Raised(error)))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Option<PyErr>> {
        self.raised.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
