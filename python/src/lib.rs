//! The Python module `cager`: captures as numpy arrays, encoded into `.cager` files and decoded from them.

mod arrays;
mod capture;
mod encode;
mod fault;
mod frames;
mod geometry;
mod watch;

#[pyo3::pymodule]
mod cager {
    #[pymodule_export]
    use crate::capture::{Capture, open};
    #[pymodule_export]
    use crate::encode::encode;
    #[pymodule_export]
    use crate::fault::CagerError;
    #[pymodule_export]
    use crate::geometry::{coordinates, design_cage};
}
