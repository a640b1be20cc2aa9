//! Values at corners, as positions of the mesh that is torn at its seams: predicted by the same parallelograms.

use crate::error::{Error, Result};
use crate::grid::{Grid, decode_positions, encode_positions};
use cager_geometry::mesh::{Point, Polygons};

/// Components that are coded together.
const TOGETHER: usize = 3;

/// Codes values in steps of `step`, or of twice as much again and again where they reach too far for that. Three
/// components are coded together; further ones follow behind 1, or are all 1 behind 0.
pub(super) fn encode_values<const N: usize>(torn: &Polygons, values: &[[f32; N]], step: f64) -> Vec<u8> {
    let mut bytes = Vec::new();
    if values.is_empty() {
        return bytes;
    }
    for first in (0..N).step_by(TOGETHER) {
        if first > 0 {
            let opaque = values.iter().all(|value| value[first..].iter().all(|&x| x == 1.0));
            bytes.push(u8::from(!opaque));
            if opaque {
                continue;
            }
        }
        let component = |value: &[f32; N], k: usize| value.get(first + k).map_or(0.0, |&x| f64::from(x));
        let points: Vec<Point> = values.iter().map(|value| [0, 1, 2].map(|k| component(value, k))).collect();
        let mut step = step;
        let grid = loop {
            match Grid::of_multiples(&points, step) {
                Some(grid) => break grid,
                None => step *= 2.0,
            }
        };
        let coded = encode_positions(grid, torn, &points);
        bytes.extend((coded.len() as u32).to_le_bytes());
        bytes.extend(coded);
    }
    bytes
}

/// The values of [`encode_values`].
pub(super) fn decode_values<const N: usize>(mut bytes: &[u8], torn: &Polygons, count: usize) -> Result<Vec<[f32; N]>> {
    const CUT: Error = Error::Damaged("values at corners are cut");
    let mut values = vec![[1.0; N]; count];
    if count == 0 {
        return Ok(values);
    }
    for first in (0..N).step_by(TOGETHER) {
        if first > 0 {
            let (&is_coded, rest) = bytes.split_first().ok_or(CUT)?;
            bytes = rest;
            if is_coded == 0 {
                continue;
            }
        }
        let (length, rest) = bytes.split_first_chunk::<4>().ok_or(CUT)?;
        let (coded, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CUT)?;
        bytes = rest;
        for (value, point) in values.iter_mut().zip(decode_positions(coded, torn, count)?) {
            value[first..].iter_mut().zip(point).for_each(|(to, x)| *to = x as f32);
        }
    }
    if values.as_flattened().iter().any(|x| !x.is_finite()) {
        return Err(Error::Damaged("a value at a corner is not finite"));
    }
    Ok(values)
}
