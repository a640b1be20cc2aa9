//! The cages of a session, as an asynchronous iterator.

use crate::call::{Call, awaitable};
use crate::fault::Fault;
use crate::geometry::array;
use cager_client::{CageFrame, ClientError};
use futures_util::StreamExt as _;
use futures_util::stream::BoxStream;
use pyo3::IntoPyObjectExt as _;
use pyo3::exceptions::PyStopAsyncIteration;
use pyo3::prelude::*;
use std::sync::Arc;
use tokio::sync::Mutex;

/// Cages that come as they are solved, with the numbers of their frames.
#[pyclass(frozen, module = "cager")]
pub(crate) struct Cages(Arc<Mutex<BoxStream<'static, Result<CageFrame, ClientError>>>>);

impl Cages {
    pub(crate) fn new(stream: BoxStream<'static, Result<CageFrame, ClientError>>) -> Self {
        Self(Arc::new(Mutex::new(stream)))
    }
}

#[pymethods]
impl Cages {
    fn __aiter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __anext__<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Fault> {
        let stream = Arc::clone(&self.0);
        awaitable(py, async move |Call { mut stop, .. }: Call| {
            // The stream goes on where it was when a call is cancelled.
            let next = stop.or(async { Ok(stream.lock().await.next().await.transpose()?) }).await?;
            Ok(move |py: Python<'_>| {
                let cage = next.ok_or_else(|| PyStopAsyncIteration::new_err(()))?;
                Ok((cage.frame, array(py, cage.values)?).into_py_any(py)?)
            })
        })
    }
}
