//! What goes wrong, as Python gets it: one exception class, whose message names what is wrong and what to do.

use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use std::ffi::CString;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

pyo3::create_exception!(
    cager,
    CagerError,
    PyValueError,
    "What was given cannot be used, or a file cannot be read or written; the message says which and what to do."
);

/// Why a call ends without a result.
pub(crate) enum Fault {
    /// In words for the user.
    Told(String),
    /// By an exception of Python, such as one in a callback.
    Raised(PyErr),
}

/// A fault that `name` is to blame for: an argument, or a file.
pub(crate) fn of(name: impl Display, what: impl Display) -> Fault {
    Fault::Told(format!("{name}: {what}"))
}

/// Warnings for the user, `level` frames of the stack up.
pub(crate) fn warn(py: Python<'_>, warnings: &[String], level: i32) -> PyResult<()> {
    warnings.iter().try_for_each(|words| {
        let words = CString::new(words.replace('\0', ""))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &words, level)
    })
}

/// What a service says of an address that none of its routes has, and that it does not know.
const NO_ROUTE: &str = "the routes are listed in /openapi.json";

impl Fault {
    /// Names the address of a service where that leads nowhere.
    pub(crate) fn of_service(self, url: &str) -> Self {
        match self {
            Self::Told(words) if words.contains(NO_ROUTE) => of(
                url,
                "a service answers there, but has no such route; correct what follows the host, or leave it out",
            ),
            fault => fault,
        }
    }
}

macro_rules! told {
    ($($error:ty),*) => {$(
        impl From<$error> for Fault {
            fn from(error: $error) -> Self {
                Self::Told(error.to_string())
            }
        }
    )*};
}
told!(
    cager_formats::Error,
    cager_capture::decode::DecodeError,
    cager_capture::coding::CodingError,
    cager_client::ClientError
);

impl From<PyErr> for Fault {
    fn from(error: PyErr) -> Self {
        Self::Raised(error)
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        match fault {
            // The sentences are those of the command line.
            Fault::Told(words) => CagerError::new_err(
                words
                    .replace(
                        "is there already; name another file",
                        "is there already; name another file, or pass overwrite=True",
                    )
                    .replace("take one of them (--frame K), or name a folder", "name a folder")
                    .replace("so that --up cannot", "so that up cannot")
                    .replace("so that --unit cannot", "so that unit cannot")
                    .replace("the cages that `cager decode --cages` writes", "capture.cages"),
            ),
            Fault::Raised(error) => error,
        }
    }
}

/// Computes with several threads.
pub(crate) fn computing<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Fault> + Send) -> Result<T, Fault> {
    computing_allowed()?;
    detached(py, work)
}

/// A process that is forked off another lacks the threads of its parent, and would wait for them for ever.
pub(crate) fn computing_allowed() -> Result<(), Fault> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    let here = std::process::id();
    if *FIRST.get_or_init(|| here) != here {
        let what = "this process was forked off one that had used cager before, and lacks its threads; start it with the method \"spawn\" or \"forkserver\", as multiprocessing.get_context(\"spawn\") does";
        return Err(Fault::Told(what.to_owned()));
    }
    Ok(())
}

/// Works while other threads of Python run. A panic is an error as well.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Fault> + Send) -> Result<T, Fault> {
    py.detach(|| catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(own_fault())))
}

/// A panic.
pub(crate) fn own_fault() -> Fault {
    Fault::Told("stopped by a fault in cager itself, told above; please report it with what you gave".to_owned())
}
