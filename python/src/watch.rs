//! Progress of a computation: told to Python's callback, whose exceptions, and the interrupts of the user, end it.

use crate::fault::Fault;
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::sync::Mutex;

/// Who is told of the progress.
pub(crate) struct Watch {
    callback: Option<Py<PyAny>>,
    raised: Mutex<Option<PyErr>>,
}

impl Watch {
    pub(crate) fn new(callback: Option<Py<PyAny>>) -> Self {
        Self { callback, raised: Mutex::new(None) }
    }

    /// Tells what is done now, and which fraction of it is; [`ControlFlow::Break`] from the first exception on.
    pub(crate) fn tell(&self, stage: &str, fraction: f64) -> ControlFlow<()> {
        if self.is_stopped() {
            return ControlFlow::Break(());
        }
        let told = Python::attach(|py| {
            py.check_signals()?;
            self.callback.as_ref().map_or(Ok(()), |callback| callback.call1(py, (stage, fraction)).map(drop))
        });
        match told {
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
