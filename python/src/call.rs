//! Calls that Python awaits: native coroutines whose work runs on threads of their own and ends on the event loop.
//!
//! A task that is cancelled stops the work, and waits until what is to be cleaned up is.

use crate::fault::{Fault, computing_allowed, own_fault};
use futures_util::FutureExt as _;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyCFunction;
use std::ffi::CString;
use std::io;
use std::panic::AssertUnwindSafe;
use std::sync::{Mutex, OnceLock, PoisonError};
use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

/// Threads for the network; what computes or waits for a disk has others.
const THREADS: usize = 2;

/// A call under way, as its work sees it.
pub(crate) struct Call {
    /// `call_soon_threadsafe` of the event loop.
    pub(crate) post: Py<PyAny>,
    pub(crate) stop: Stop,
}

/// Whether the task that awaits a call has been cancelled.
pub(crate) struct Stop(watch::Receiver<bool>);

impl Stop {
    /// The result of `work`, which is dropped where the task is cancelled.
    pub(crate) async fn or<T>(&mut self, work: impl Future<Output = Result<T, Fault>>) -> Result<T, Fault> {
        tokio::select! {
            result = work => result,
            () = self.stopped() => Err(Fault::Told("the call was cancelled".to_owned())),
        }
    }

    async fn stopped(&mut self) {
        // An error: the coroutine is gone.
        let _ = self.0.wait_for(|&stopped| stopped).await;
    }
}

/// A coroutine that starts `work` when it is awaited. What `work` gives is made a result of Python on the thread of the event loop.
pub(crate) fn awaitable<'py, F, T>(
    py: Python<'py>,
    work: impl FnOnce(Call) -> F + Send + 'static,
) -> Result<Bound<'py, PyAny>, Fault>
where
    F: Future<Output = Result<T, Fault>> + Send + 'static,
    T: FnOnce(Python<'_>) -> Result<Py<PyAny>, Fault> + Send + 'static,
{
    static CALL: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    computing_allowed()?;
    let runtime = runtime()?;
    let call = CALL.get_or_try_init(py, || {
        let code = CString::new(include_str!("call.py"))?;
        Ok::<_, PyErr>(PyModule::from_code(py, &code, c"cager/call.py", c"cager._call")?.getattr("call")?.unbind())
    })?;
    let work = Mutex::new(Some(work));
    let start = PyCFunction::new_closure(py, None, None, move |arguments, _| {
        let (post, end): (Py<PyAny>, Py<PyAny>) = arguments.extract()?;
        let Some(work) = taken(&work) else {
            return Err(Fault::Told("the call has been made already".to_owned()).into());
        };
        let py = arguments.py();
        let (stop, stopped) = watch::channel(false);
        let work = work(Call { post: post.clone_ref(py), stop: Stop(stopped) });
        runtime.spawn(async move {
            let result = AssertUnwindSafe(work).catch_unwind().await.unwrap_or_else(|_| Err(own_fault()));
            finish(&post, end, result);
        });
        let stop = PyCFunction::new_closure(py, None, None, move |_, _| {
            let _ = stop.send(true);
        })?;
        Ok::<_, PyErr>(stop.unbind())
    })?;
    Ok(call.bind(py).call1((start,))?)
}

/// Ends a call on its event loop, unless Python or the loop has ended already and nobody waits.
fn finish<T>(post: &Py<PyAny>, end: Py<PyAny>, result: Result<T, Fault>)
where
    T: FnOnce(Python<'_>) -> Result<Py<PyAny>, Fault> + Send + 'static,
{
    let result = Mutex::new(Some(result));
    let _ = Python::try_attach(|py| {
        let finish = PyCFunction::new_closure(py, None, None, move |arguments, _| {
            let Some(result) = taken(&result) else { return Err(own_fault()) };
            result?(arguments.py())
        })?;
        // What it gives keeps the result, and is dropped while Python is attached: elsewhere it would stay until the next call from here into Python, and
        // with it what a result holds that nobody took, such as the turn of a follower.
        post.call1(py, (end, finish)).map(drop)
    });
}

/// Work that computes, or waits for a disk, on a thread for that.
pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Fault> + Send + 'static,
) -> Result<T, Fault> {
    tokio::task::spawn_blocking(work).await.unwrap_or_else(|_| Err(own_fault()))
}

fn taken<T>(slot: &Mutex<Option<T>>) -> Option<T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner).take()
}

fn runtime() -> Result<&'static Runtime, Fault> {
    static RUNTIME: OnceLock<io::Result<Runtime>> = OnceLock::new();
    let made = RUNTIME.get_or_init(|| {
        Builder::new_multi_thread().worker_threads(THREADS).thread_name("cager-network").enable_all().build()
    });
    made.as_ref().map_err(|error| {
        Fault::Told(format!("the network cannot be used ({error}); free some memory or files and try again"))
    })
}
