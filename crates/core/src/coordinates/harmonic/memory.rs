//! How much memory boundary elements take.

use super::basis::{MAX_FUNCTIONS, functions};
use super::elements::{Element, LOW_DEGREES, MAX_ELEMENTS, MAX_ELEMENTS_FOR_SHAPE, Unknowns};
use super::galerkin::is_near;
use super::patch::MAX_PATCH_UNKNOWNS;
use cager_geometry::mesh::Point;
use rayon::prelude::*;

/// More than this is refused: a file must not make its reader take any amount.
pub(super) const MAX_BYTES: u64 = 16 << 30;

/// Bytes that solving on these elements takes at its peak, for a cage of so many vertices.
pub(super) fn needed(unknowns: &Unknowns, vertices: usize) -> u64 {
    let size = |element: &Element| functions(element.degree) as u64;
    let near = near_pairs(&unknowns.elements, |a, b| size(a) * size(b));
    bytes(unknowns.low_count(), unknowns.high_count(), vertices, near)
}

/// Upper bound of [`needed`], for the most elements that refining may end with.
pub(super) fn upper_bound(faces: &[[Point; 3]], vertices: usize) -> u64 {
    let whole: Vec<Element> = faces.iter().enumerate().map(|(f, &corners)| Element::face(f, corners)).collect();
    let elements = MAX_ELEMENTS.max(2 * faces.len().max(MAX_ELEMENTS_FOR_SHAPE)).min(LOW_DEGREES[2].0);
    let low = LOW_DEGREES.iter().map(|&(most, degree)| elements.min(most) * functions(degree)).max().unwrap_or(0);
    let pairs = (near_pairs(&whole, |_, _| 1) * elements as u64).div_ceil(faces.len().max(1) as u64);
    bytes(low, elements * MAX_FUNCTIONS, vertices, pairs * (MAX_FUNCTIONS * MAX_FUNCTIONS) as u64)
}

/// Dense equations in both precisions, right-hand sides, densities, near pairs, a patch per thread.
fn bytes(low: usize, high: usize, vertices: usize, near: u64) -> u64 {
    let [low, high, vertices] = [low, high, vertices].map(|count| count as u64);
    let patches = rayon::current_num_threads() as u64 * (MAX_PATCH_UNKNOWNS * MAX_PATCH_UNKNOWNS) as u64;
    12 * low * low + 8 * (vertices * (3 * low + 2 * high) + near + patches)
}

/// The sum of something over all pairs of near elements, each with itself among them.
fn near_pairs(elements: &[Element], of: impl Fn(&Element, &Element) -> u64 + Sync) -> u64 {
    let from = |i: usize| -> u64 {
        let a = &elements[i];
        elements[..=i].iter().filter(|b| is_near(a, b)).map(|b| of(a, b)).sum()
    };
    (0..elements.len()).into_par_iter().map(from).sum()
}
