//! Arguments whose conversion would not name them where it fails.

use crate::fault::{Fault, of};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use std::path::PathBuf;

pub(crate) fn seed(value: &Bound<'_, PyAny>) -> PyResult<u64> {
    in_range("seed", value, value.extract())
}

pub(crate) fn vertices(value: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    in_range("vertices", value, value.extract())
}

pub(crate) fn first(value: &Bound<'_, PyAny>) -> PyResult<u32> {
    in_range("first", value, value.extract())
}

pub(crate) fn path(value: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    let path: PathBuf = value.extract()?;
    if path.as_os_str().is_empty() {
        return Err(of("path", "is empty; name a file").into());
    }
    Ok(path)
}

fn in_range<T>(name: &str, value: &Bound<'_, PyAny>, converted: PyResult<T>) -> PyResult<T> {
    converted.map_err(|error| {
        if !error.is_instance_of::<PyOverflowError>(value.py()) {
            return error;
        }
        let advice = if value.lt(0).unwrap_or(false) { "a whole number of 0 or more" } else { "a smaller number" };
        Fault::into(of(name, format!("is {value}; give {advice}")))
    })
}
