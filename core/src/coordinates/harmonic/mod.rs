//! Harmonic coordinates (Joshi, Meyer, DeRose, Green and Sanocki 2007) by boundary elements.
//!
//! The coordinate of a cage vertex is harmonic inside the cage, and on it the hat function `u` of that vertex. With the single layer `S`
//! and the double layer `K` of the cage, Green's representation formula is `u = S q − K u` inside and `S q = ½ u + K u` on the faces, up to
//! the signs of the layers; the unknown is the normal derivative `q`. It is approximated by polynomials on elements that divide the
//! faces, and found by Galerkin's method: symmetric positive definite equations, one factorisation for all vertices
//! ([`galerkin`], [`solve`]). The double layer of hat functions has a closed form, and is exact.
//!
//! Elements are divided, or get a higher degree, where that changes a coordinate of one of the points ([`elements`]): the difference
//! to the solution without the highest degrees is known with the solution itself. Refining ends when it is below 1e-3 everywhere, and
//! the difference is reported. Values near faces and edges are tied to those on the surface ([`evaluate`]); they are
//! never clamped, which would lose linear functions. Those have densities that are constant on faces; what quadrature misses
//! of them is put back by a small correction of all coordinates ([`affine`]), so that they are exact to rounding.

mod affine;
mod basis;
mod closed_form;
mod elements;
mod evaluate;
mod galerkin;
mod near;
mod patch;
mod potential;
mod quadrature;
mod solve;
mod surface;
mod triangle;

use super::layer::Layers;
use super::{CoordinateSystem, Coordinates, CoordinatesError, Refinement};
use crate::cage::Cage;
use crate::mesh::Point;
use elements::Unknowns;
use evaluate::{Evaluated, Solution};
use surface::{Foot, Side, Surface};

/// Harmonic coordinates: one unknown per cage vertex, defined inside the cage and on it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Harmonic;

const NAME: &str = "harmonic";
/// Refinements at most.
const REFINEMENTS: usize = 8;
/// Elements that refining may make, unless there are half as many at first: the time grows with their cube.
const ELEMENTS: usize = 2500;
/// Elements up to which all have so many low degrees: the equations of low unknowns are dense.
const LOW_DEGREES: [(usize, usize); 3] = [(1300, 2), (3000, 1), (10_000, 0)];
/// Linear functions that are missed by more than this say that nothing was solved.
const MISSED: f64 = 0.1;

impl CoordinateSystem for Harmonic {
    fn name(&self) -> &'static str {
        NAME
    }

    fn columns(&self, cage: &Cage) -> usize {
        cage.vertices().len()
    }

    fn rest_values(&self, cage: &Cage) -> Vec<Point> {
        cage.vertices().to_vec()
    }

    fn check(&self, cage: &Cage, points: &[Point]) -> Result<(), CoordinatesError> {
        check_inside(&Surface::new(cage.vertices(), cage).feet(points), cage.diagonal())
    }

    fn coordinates(&self, cage: &Cage, points: &[Point]) -> Result<Coordinates, CoordinatesError> {
        if let Some(point) = points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(not_computed(format!("point {point} is not finite")));
        }
        let layers = Layers::new(cage);
        let points: Vec<Point> = points.iter().map(|p| p.map(|c| c * layers.scale())).collect();
        let surface = Surface::new(layers.vertices(), cage);
        let feet = surface.feet(&points);
        check_inside(&feet, cage.diagonal() * layers.scale())?;
        let (found, refinement) =
            refine(&Problem { layers: &layers, surface: &surface, points: &points, feet: &feet })?;
        Ok(Coordinates { phi: found.phi, outside: Vec::new(), refinement: Some(refinement) })
    }
}

fn not_computed(reason: String) -> CoordinatesError {
    CoordinatesError::NotComputed { system: NAME, reason }
}

fn check_inside(feet: &[Foot], diagonal: f64) -> Result<(), CoordinatesError> {
    let outside = |i: &usize| feet[*i].side == Side::Outside;
    let points: Vec<u32> = (0..feet.len()).filter(outside).map(|i| i as u32).collect();
    if points.is_empty() {
        return Ok(());
    }
    let distance = points.iter().map(|&i| feet[i as usize].distance).fold(0.0, f64::max) / diagonal;
    Err(CoordinatesError::Outside { system: NAME, points, distance })
}

/// What is to be solved, in the unit of the layers.
struct Problem<'a> {
    layers: &'a Layers,
    surface: &'a Surface<'a>,
    points: &'a [Point],
    feet: &'a [Foot],
}

/// Solves on finer and finer elements until that changes nothing more, or no more of them are allowed.
fn refine(problem: &Problem<'_>) -> Result<(Evaluated, Refinement), CoordinatesError> {
    let Problem { layers, points, feet, .. } = problem;
    let tables = potential::Tables::new();
    let affine = affine::AffineFit::new(layers.vertices());
    let corners: Vec<[Point; 3]> =
        layers.triangles().iter().map(|t| t.map(|v| layers.vertices()[v as usize])).collect();
    let inside = feet.iter().zip(*points).filter(|(foot, _)| foot.side == Side::Inside);
    let inside: Vec<Point> = inside.map(|(_, &x)| x).collect();
    let mut elements = elements::elements(&corners, &inside);
    let mut degree = low_degree(elements.len()).ok_or_else(|| {
        not_computed(format!("it would take {} boundary elements, more than {}", elements.len(), LOW_DEGREES[2].0))
    })?;
    let most = ELEMENTS.max(2 * elements.len());
    let mut refinements = 0;
    loop {
        let unknowns = Unknowns::new(elements, degree);
        let mut found = solve_on(problem, &tables, &affine, &unknowns)?;
        let change = found.change.max(found.correction);
        let refinement = Refinement { elements: unknowns.elements.len(), refinements, change };
        if refinement.reached() || refinements == REFINEMENTS {
            return Ok((found, refinement));
        }
        if found.correction > Refinement::TOLERANCE {
            elements::mark_thin(&unknowns.elements, &mut found.marked);
        }
        elements = elements::refined(&unknowns.elements, &found.marked);
        let more = elements.len() <= most && found.marked.contains(&true);
        let Some(next) = low_degree(elements.len()).filter(|_| more) else {
            return Ok((found, refinement));
        };
        degree = next;
        refinements += 1;
    }
}

/// Highest degree of the polynomials that all of so many elements have; `None` for too many.
fn low_degree(elements: usize) -> Option<usize> {
    LOW_DEGREES.iter().find(|(most, _)| elements <= *most).map(|(_, degree)| *degree)
}

/// Coordinates with these elements.
fn solve_on(
    problem: &Problem<'_>,
    tables: &potential::Tables,
    affine: &affine::AffineFit,
    unknowns: &Unknowns,
) -> Result<Evaluated, CoordinatesError> {
    let Problem { layers, surface, points, feet } = problem;
    let outer = galerkin::Outer::new(tables);
    let operator = galerkin::operator(tables, &outer, unknowns);
    let sides = galerkin::right_hand_sides(&outer, layers, unknowns);
    let densities = solve::solve(operator, &sides, unknowns, layers.triangles())
        .ok_or_else(|| not_computed("the equations on its faces are singular in double precision".to_owned()))?;
    let solution = Solution { tables, layers, surface, affine, unknowns, densities: &densities };
    let found = evaluate::evaluate(&solution, points, feet, Refinement::TOLERANCE);
    // Written so that NaN is an error.
    if !(found.correction <= MISSED && found.change.is_finite()) {
        return Err(not_computed(format!(
            "linear functions are missed by {:.0e}, as happens in cages much thinner than wide",
            found.correction
        )));
    }
    Ok(found)
}
