//! The cages of a session, as an asynchronous iterator.

use crate::call::{Call, awaitable};
use crate::fault::Fault;
use crate::geometry::array;
use cager_client::{CageFrame, ClientError};
use futures_util::stream::{self, BoxStream, Peekable};
use futures_util::{FutureExt as _, StreamExt as _};
use pyo3::IntoPyObjectExt as _;
use pyo3::exceptions::PyStopAsyncIteration;
use pyo3::prelude::*;
use std::pin::Pin;
use std::sync::Arc;
use tokio::sync::Mutex;

type Solved = Result<CageFrame, ClientError>;

/// Cages that come as they are solved, with the numbers of their frames.
#[pyclass(frozen, module = "cager")]
pub(crate) struct Cages {
    stream: Arc<Mutex<Peekable<BoxStream<'static, Solved>>>>,
    /// The address as it was given.
    url: String,
}

impl Cages {
    pub(crate) fn new(stream: BoxStream<'static, Solved>, url: String) -> Self {
        Self { stream: Arc::new(Mutex::new(stream.peekable())), url }
    }
}

#[pymethods]
impl Cages {
    fn __aiter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __anext__<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Fault> {
        let (stream, url) = (Arc::clone(&self.stream), self.url.clone());
        awaitable(py, async move |Call { mut stop, .. }: Call| {
            // Taken when it is given to Python only, so that a call that is cancelled leaves it to the next one.
            let mut stream = stop
                .or(async {
                    let mut stream = stream.lock_owned().await;
                    Pin::new(&mut *stream).peek().await;
                    Ok(stream)
                })
                .await?;
            Ok(move |py: Python<'_>| {
                let next = stream.next().now_or_never().flatten().transpose();
                let next = next.map_err(|error| Fault::from(error).of_service(&url))?;
                let cage = next.ok_or_else(|| PyStopAsyncIteration::new_err(()))?;
                Ok((cage.frame, array(py, cage.values)?).into_py_any(py)?)
            })
        })
    }

    /// Ends it: what is connected is closed, and no cage follows.
    fn aclose<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Fault> {
        let stream = Arc::clone(&self.stream);
        awaitable(py, async move |_: Call| {
            let mut stream = stream.try_lock_owned().map_err(|_| {
                Fault::Told("the next cage is being awaited; cancel that before the iterator is closed".to_owned())
            })?;
            *stream = stream::empty().boxed().peekable();
            Ok(|py: Python<'_>| Ok(py.None()))
        })
    }
}
