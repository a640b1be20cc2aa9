//! Boundary elements: triangles on the cage's faces, each with a polynomial density.

use super::basis::functions;
use super::triangle::Triangle;
use crate::simd::{LANES, Lanes, dot, grouped, multiversion};
use cager_geometry::mesh::{Point, distance2_to_triangle};
use cager_geometry::vector::{self, middle, sub};
use rayon::prelude::*;

/// Elements that refining may make, unless there are half as many at first.
pub(super) const MAX_ELEMENTS: usize = 2500;
/// Elements up to which all have so many low degrees: the equations of low unknowns are dense.
pub(super) const LOW_DEGREES: [(usize, usize); 3] = [(1300, 2), (3000, 1), (10_000, 0)];
/// Least degree that refining gives an element.
pub(super) const MIN_DEGREE: usize = 3;

/// One element.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) triangle: Triangle,
    /// Face of the cage it is part of.
    pub(super) face: u32,
    /// Degree of its density; one less in the coarse space.
    pub(super) degree: usize,
    /// Cuts of the face that come before this element in preorder, as in a plan.
    pub(super) cuts: Vec<u8>,
    /// Cuts above it from before the first solution, by which unknowns are sorted.
    depth: u32,
}

/// The cut into four; smaller numbers are those of the corner from which a triangle is halved.
pub(super) const QUARTERS: u8 = 7;
/// What is added to the number of a corner where the cut was made after the first solution.
pub(super) const LATER: u8 = 8;

impl Element {
    /// A face.
    pub(super) fn face(face: usize, corners: [Point; 3]) -> Self {
        Self { triangle: Triangle::new(corners), face: face as u32, degree: 0, cuts: Vec::new(), depth: 0 }
    }

    /// The parts that a cut gives.
    pub(super) fn parts(&self, cut: u8) -> Vec<Self> {
        let first = if cut == QUARTERS { 0 } else { usize::from(cut % LATER) };
        let corner = |i: usize| self.triangle.corners[(first + i) % 3];
        let [a, b, c] = [0, 1, 2].map(corner);
        let triangles = if cut == QUARTERS {
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            vec![[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        } else {
            let d = middle(b, c);
            vec![[a, b, d], [a, d, c]]
        };
        let depth = self.depth + u32::from(cut < QUARTERS);
        let part = |corners| Self { triangle: Triangle::new(corners), cuts: Vec::new(), depth, ..*self };
        let mut parts: Vec<Self> = triangles.into_iter().map(part).collect();
        parts[0].cuts = [self.cuts.as_slice(), &[cut]].concat();
        parts
    }

    /// The cut across the longest side; none where there is no single longest one.
    fn halving(&self) -> Option<u8> {
        let corners = self.triangle.corners;
        let length2 = |i: usize| -> f64 {
            let (a, b) = (corners[(i + 1) % 3], corners[(i + 2) % 3]);
            let side = sub(a, b);
            vector::dot(side, side)
        };
        (0..3).find(|&i| (1..3).all(|j| length2(i) > TIE * length2((i + j) % 3))).map(|top| top as u8)
    }

    /// Highest degree for this shape: in thin ones high polynomials nearly depend on each other.
    fn most(&self) -> usize {
        let aspect = self.triangle.diameter() / self.triangle.height();
        MAX_ASPECT.iter().find(|(limit, _)| aspect < *limit).map_or(MIN_DEGREE, |m| m.1)
    }

    /// Distance over the diameter to the nearest of these points, but for those as good as on it.
    fn nearness(&self, points: &[[Lanes; 3]]) -> f64 {
        nearest(&self.triangle, points) / self.triangle.diameter()
    }
}

multiversion! {
    /// Distance from a triangle to the nearest of these points, but for those as good as on it.
    fn nearest(triangle: &Triangle, points: &[[Lanes; 3]]) -> f64 {
        let Triangle { centre, radius, corners, .. } = triangle;
        let mut nearest = f64::INFINITY;
        let mut near2 = f64::INFINITY;
        let least2 = (ON * triangle.diameter()).powi(2);
        for group in points {
            let r = [group[0] - centre[0], group[1] - centre[1], group[2] - centre[2]];
            let d2 = dot(&r, &r);
            if !d2.any(Lanes::splat(near2), |d2, near2| d2 < near2) {
                continue;
            }
            for l in 0..LANES {
                if d2.0[l] < near2 {
                    let found = distance2_to_triangle(*corners, group.map(|c| c.0[l]));
                    if found < nearest && found >= least2 {
                        nearest = found;
                        near2 = (nearest.sqrt() + radius).powi(2);
                    }
                }
            }
        }
        nearest.sqrt()
    }
}

/// Nearest point, in diameters, from which on each degree is enough.
const ENOUGH: [(f64, usize); 4] = [(0.4, 3), (0.18, 4), (0.1, 5), (0.06, 6)];
/// Points nearer than this are left to what is known on the surface.
const ON: f64 = 0.01;
/// Ratio of length to height below which a triangle may have each degree.
const MAX_ASPECT: [(f64, usize); 3] = [(4.0, 6), (8.0, 5), (14.0, 4)];
/// Sides differ when their squares do by more than this factor: symmetric cages are divided alike.
const TIE: f64 = 1.0 + 1e-9;
/// No elements are divided for the sake of their shape once there are so many.
pub(super) const MAX_ELEMENTS_FOR_SHAPE: usize = 1200;

/// The faces of a cage, in their order, divided where points are near.
pub(super) fn elements(faces: &[[Point; 3]], points: &[Point]) -> Vec<Element> {
    let points = grouped(points, [f64::INFINITY; 3]);
    let mut elements: Vec<Element> =
        faces.iter().enumerate().map(|(face, &corners)| Element::face(face, corners)).collect();
    loop {
        // Those without a degree have to be looked at.
        let waiting = elements.iter().filter(|element| element.degree == 0).count();
        if waiting == 0 {
            return elements;
        }
        let divide = elements.len() + waiting <= MAX_ELEMENTS_FOR_SHAPE;
        let judge = |mut element: Element| {
            if element.degree > 0 {
                return vec![element];
            }
            let nearness = element.nearness(&points);
            let wanted = ENOUGH.iter().find(|(least, _)| nearness >= *least).map_or(usize::MAX, |e| e.1);
            let most = element.most();
            if wanted > most
                && divide
                && let Some(cut) = element.halving()
            {
                return element.parts(cut);
            }
            element.degree = wanted.min(most);
            vec![element]
        };
        let judged: Vec<Vec<Element>> = elements.into_par_iter().map(judge).collect();
        elements = judged.into_iter().flatten().collect();
    }
}

/// Marks the thinnest elements too, where they are what makes the equations inexact.
pub(super) fn mark_thin(elements: &[Element], marked: &mut [bool]) {
    let aspect = |element: &Element| element.triangle.diameter() / element.triangle.height();
    let limit = (0.4 * elements.iter().map(aspect).fold(0.0, f64::max)).max(MAX_ASPECT[0].0);
    for (element, marked) in elements.iter().zip(marked) {
        *marked |= aspect(element) >= limit;
    }
}

/// The elements in preorder, the marked ones one degree higher, or divided.
pub(super) fn refined(unknowns: &Unknowns, marked: &[bool]) -> Vec<Element> {
    let mut out = Vec::new();
    for (element, marked) in unknowns.preorder.iter().map(|&k| (&unknowns.elements[k], marked[k])) {
        if !marked {
            out.push(element.clone());
        } else if element.degree < element.most() {
            out.push(Element { degree: element.degree + 1, ..element.clone() });
        } else {
            out.extend(element.parts(element.halving().map_or(QUARTERS, |corner| LATER + corner)));
        }
    }
    out
}

/// Low unknowns of all elements are solved for together, high ones around each vertex.
pub(super) struct Unknowns {
    pub(super) elements: Vec<Element>,
    /// Places of the elements in preorder, face by face.
    pub(super) preorder: Vec<usize>,
    /// Degree of the low polynomials, and how many every element has.
    pub(super) low_degree: usize,
    pub(super) low: usize,
    /// First high unknown of each element, and the number of all of them.
    starts: Vec<usize>,
}

impl Unknowns {
    /// Takes elements in preorder.
    pub(super) fn new(elements: &[Element], low_degree: usize) -> Self {
        let mut order: Vec<usize> = (0..elements.len()).collect();
        order.sort_by_key(|&k| elements[k].depth);
        let mut preorder = vec![0; elements.len()];
        for (place, &k) in order.iter().enumerate() {
            preorder[k] = place;
        }
        let elements: Vec<Element> = order.iter().map(|&k| elements[k].clone()).collect();
        let low = functions(low_degree);
        let mut starts = vec![0];
        for element in &elements {
            starts.push(starts[starts.len() - 1] + functions(element.degree) - low);
        }
        Self { elements, preorder, low_degree, low, starts }
    }

    /// Number of low unknowns.
    pub(super) fn low_count(&self) -> usize {
        self.low * self.elements.len()
    }

    /// Number of high unknowns.
    pub(super) fn high_count(&self) -> usize {
        self.starts[self.elements.len()]
    }

    /// The high unknowns of an element.
    pub(super) fn high(&self, element: usize) -> std::ops::Range<usize> {
        self.starts[element]..self.starts[element + 1]
    }
}
