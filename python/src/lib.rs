//! The Python module `cager`: captures as numpy arrays, encoded into `.cager` files and decoded from them.

mod apart;
mod arguments;
mod arrays;
mod call;
mod capture;
mod client;
mod encode;
mod export;
mod fault;
mod follow;
mod frames;
mod geometry;
mod handed_frames;
mod kept_frames;
mod loop_progress;
mod meaning;
mod own_file;
mod remote_encode;
mod watch;

/// Captures of animated meshes as numpy arrays, in light and editable .cager files.
#[pyo3::pymodule]
mod cager {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::capture::{Capture, open};
    #[pymodule_export]
    use crate::client::Client;
    #[pymodule_export]
    use crate::encode::encode;
    #[pymodule_export]
    use crate::fault::CagerError;
    #[pymodule_export]
    use crate::geometry::{coordinates, design_cage};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
