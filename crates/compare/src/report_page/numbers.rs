//! Numbers of a page's geometry: little-endian bytes as base64.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use cager_geometry::mesh::{Point, bounds};
use serde::Serialize;

/// Numbers as `f32`.
pub(crate) fn floats(values: impl IntoIterator<Item = f64>) -> String {
    STANDARD.encode(values.into_iter().flat_map(|value| (value as f32).to_le_bytes()).collect::<Vec<u8>>())
}

/// Numbers of vertices, as `u16` where there are at most 65,536, otherwise as `u32`.
pub(super) fn indices(values: impl IntoIterator<Item = u32>, vertices: usize) -> String {
    let bytes: Vec<u8> = match vertices {
        0..=0x1_0000 => values.into_iter().flat_map(|value| (value as u16).to_le_bytes()).collect(),
        _ => values.into_iter().flat_map(u32::to_le_bytes).collect(),
    };
    STANDARD.encode(bytes)
}

/// A box along the axes.
#[derive(Clone, Copy, Debug)]
pub struct Box3 {
    pub(crate) low: Point,
    pub(crate) high: Point,
}

impl Box3 {
    /// Around the origin, up to `reach` along every axis.
    pub(crate) fn around_zero(reach: f64) -> Self {
        Self { low: [-reach; 3], high: [reach; 3] }
    }

    /// The bounding box of points, wider by `margin` on every side.
    pub fn around(points: &[Point], margin: f64) -> Self {
        let (low, high) = bounds(points);
        Self { low: low.map(|x| x - margin), high: high.map(|x| x + margin) }
    }
}

/// Points or vectors as unsigned integers of `bits` bits: a coordinate is `low + step · integer`.
#[derive(Clone, Debug, Serialize)]
pub struct Quantised {
    low: Point,
    step: f64,
    bits: u32,
    data: String,
}

impl Quantised {
    /// With 8 or 16 bits over the points' bounding box within `most`; points beyond are moved to
    /// its border.
    pub fn new(points: &[Point], bits: u32, most: Box3) -> Self {
        let finite: Vec<Point> = points.iter().filter(|p| p.iter().all(|x| x.is_finite())).copied().collect();
        let (low, high) = if finite.is_empty() { ([0.0; 3], [0.0; 3]) } else { bounds(&finite) };
        let within = |x: f64, k: usize| x.min(most.high[k]).max(most.low[k]);
        let (low, high) = ([0, 1, 2].map(|k| within(low[k], k)), [0, 1, 2].map(|k| within(high[k], k)));
        let extent = [0, 1, 2].map(|k| high[k] - low[k]).into_iter().fold(0.0, f64::max);
        let largest = f64::from((1u32 << bits) - 1);
        let step = if extent > 0.0 { extent / largest } else { 1.0 };
        let whole = |x: f64, k: usize| ((x - low[k]) / step).round().clamp(0.0, largest) as u16;
        let integers = points.iter().flat_map(|p| [0, 1, 2].map(|k| whole(p[k], k)));
        let bytes: Vec<u8> = match bits {
            8 => integers.map(|i| i as u8).collect(),
            _ => integers.flat_map(u16::to_le_bytes).collect(),
        };
        Self { low, step, bits, data: STANDARD.encode(bytes) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn restored(of: &Quantised) -> Vec<f64> {
        let bytes = STANDARD.decode(&of.data).expect("base64");
        let integers: Vec<u16> = match of.bits {
            8 => bytes.into_iter().map(u16::from).collect(),
            _ => bytes.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b)).collect(),
        };
        integers.iter().enumerate().map(|(k, i)| of.low[k % 3] + of.step * f64::from(*i)).collect()
    }

    #[test]
    fn points_come_back_to_half_a_step_and_far_ones_to_the_border() {
        let points = [[0.0, -2.0, 5.0], [1.0, 0.5, 5.0], [0.3, 1e9, 5.0]];
        for bits in [8, 16] {
            let found = Quantised::new(&points, bits, Box3::around_zero(10.0));
            for (k, x) in restored(&found).into_iter().enumerate() {
                assert!((x - points[k / 3][k % 3].min(10.0)).abs() <= 0.5001 * found.step, "{bits} bits: {x}");
            }
        }
    }

    #[test]
    fn what_is_not_finite_does_no_harm() {
        let found =
            Quantised::new(&[[f64::NAN; 3], [f64::INFINITY, 0.0, 0.0], [1.0, 2.0, 3.0]], 16, Box3::around_zero(4.0));
        assert!(restored(&found).iter().all(|x| x.is_finite()));
        assert_eq!(restored(&found)[6..], [1.0, 2.0, 3.0]);
        assert_eq!(Quantised::new(&[], 8, Box3::around_zero(1.0)).data, "");
    }

    #[test]
    fn indices_take_as_many_bytes_as_they_need() {
        assert_eq!(STANDARD.decode(indices([65_535], 65_536)).expect("base64"), [255, 255]);
        assert_eq!(STANDARD.decode(indices([65_536], 65_537)).expect("base64"), [0, 0, 1, 0]);
        assert_eq!(STANDARD.decode(floats([1.0])).expect("base64"), 1.0f32.to_le_bytes());
    }
}
