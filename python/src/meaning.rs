//! What positions and frames mean: unit, upward axis and numbers of frames, as they are given.

use crate::arrays::Floats;
use crate::fault::{Fault, of};
use cager_geometry::units::{Units, Up};
use pyo3::prelude::*;
use std::sync::Arc;

/// Units of length by name, as on the command line.
const LENGTHS: [(&str, f64); 5] = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254), ("ft", 0.3048)];

/// Frames are counted up to here, as on the command line.
const FARTHEST: f64 = 1e9;

/// The meaning of `unit` and `up`, each where it is given.
pub(crate) fn units(unit: Option<&Bound<'_, PyAny>>, up: Option<&str>) -> Result<Units, Fault> {
    let up = match up {
        None => None,
        Some("y" | "Y") => Some(Up::Y),
        Some("z" | "Z") => Some(Up::Z),
        Some(other) => return Err(of("up", format!("there is no axis {other:?}; give \"y\" or \"z\""))),
    };
    Ok(Units { up, metres_per_unit: unit.map(metres).transpose()? })
}

fn metres(unit: &Bound<'_, PyAny>) -> Result<f64, Fault> {
    let wanted = || {
        let names = LENGTHS.map(|(name, _)| format!("{name:?}")).join(", ");
        of("unit", format!("is {unit}; give one of {names}, or the length of 1 in metres, such as 0.01"))
    };
    if let Ok(name) = unit.extract::<String>() {
        return LENGTHS.iter().find(|(known, _)| *known == name).map(|&(_, metres)| metres).ok_or_else(wanted);
    }
    unit.extract::<f64>().ok().filter(|&metres| Units::is_length(metres)).ok_or_else(wanted)
}

/// The number of each of so many frames, of `start` or `times`; 0, 1, 2, … where neither is given.
pub(crate) fn numbers(
    start: Option<f64>,
    times: Option<&Bound<'_, PyAny>>,
    frames: usize,
) -> Result<Arc<[f64]>, Fault> {
    let is_number = |number: &f64| number.abs() < FARTHEST;
    let Some(times) = times else {
        let start = start.unwrap_or(0.0);
        if !is_number(&start) {
            return Err(of("start", format!("is {start}; give the number of the first frame")));
        }
        return Ok((0..frames).map(|frame| start + frame as f64).collect());
    };
    if start.is_some() {
        return Err(of("start", "either it is given or times; leave one of them out"));
    }
    let found = Floats::new(times, "times")?.numbers()?;
    if found.len() != frames {
        return Err(of(
            "times",
            format!("has {} numbers where there are {frames} frames; give one for each", found.len()),
        ));
    }
    if let Some(at) = found.iter().position(|number| !is_number(number)) {
        return Err(of("times", format!("number {at} is {}; give the number of each frame", found[at])));
    }
    if let Some(at) = found.windows(2).position(|pair| pair[0] >= pair[1]) {
        let what = format!(
            "number {} is {}, and {} comes before it; give them in ascending order",
            at + 1,
            found[at + 1],
            found[at]
        );
        return Err(of("times", what));
    }
    Ok(found.into())
}
