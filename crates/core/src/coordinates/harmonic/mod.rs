//! Harmonic coordinates (Joshi, Meyer, DeRose, Green and Sanocki 2007) by boundary elements.
//!
//! The coordinate of a cage vertex is harmonic inside the cage, and on it the hat function `u` of
//! that vertex. With the single layer `S` and the double layer `K` of the cage, `u = S q − K u`
//! inside and `S q = ½ u + K u` on the faces, up to the signs of the layers; the unknown is the
//! normal derivative `q`. It is approximated by polynomials on elements that divide the faces, and
//! found by Galerkin's method: definite equations, one factorisation for all vertices
//! ([`galerkin`], [`solve`]). The double layer of hat functions is exact.
//!
//! Elements are divided, or get a higher degree, where that changes a coordinate of one of the
//! points ([`elements`]): the difference to the solution without the highest degrees is known with
//! the solution itself, and reported once it is below 1e-3 everywhere. Values near faces and edges
//! are tied to those on the surface ([`evaluate`]), never clamped; linear functions are made exact
//! by a small correction of all coordinates ([`affine`]).

mod affine;
mod basis;
mod closed_form;
mod elements;
mod evaluate;
mod galerkin;
mod memory;
mod near;
mod patch;
mod plan;
mod potential;
mod quadrature;
mod solve;
mod surface;
mod triangle;

use super::layer::Layers;
use super::{CageValues, CoordinateSystem, Coordinates, CoordinatesError, Refinement};
use crate::cage::Cage;
use cager_geometry::mesh::Point;
use elements::{LOW_DEGREES, MAX_ELEMENTS, Unknowns};
use evaluate::{Evaluated, Solution};
use faer::Mat;
pub use plan::ElementPlan;
use solve::SolveRecord;
use surface::{ClosestPoint, Side, Surface};

/// Harmonic coordinates: one unknown per cage vertex, defined inside the cage and on it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Harmonic;

const NAME: &str = "harmonic";
/// Refinements at most.
const REFINEMENTS: usize = 8;
/// Linear functions that are missed by more than this say that nothing was solved.
const MISSED: f64 = 0.1;

impl CoordinateSystem for Harmonic {
    fn name(&self) -> &'static str {
        NAME
    }

    fn values(&self, cage: &Cage) -> CageValues {
        CageValues::of_vertices(cage)
    }

    fn working_bytes(&self, cage: &Cage, plan: Option<&ElementPlan>) -> u64 {
        let corners = |t: &[u32; 3]| t.map(|v| cage.vertices()[v as usize]);
        let faces: Vec<[Point; 3]> = cage.mesh().triangles.iter().map(corners).collect();
        let vertices = cage.vertices().len();
        match plan.map(|plan| plan.read(&faces, vertices)) {
            None => memory::upper_bound(&faces, vertices),
            Some(Ok((unknowns, _))) => memory::needed(&unknowns, vertices),
            Some(Err(_)) => 0,
        }
    }

    fn check(&self, cage: &Cage, points: &[Point]) -> Result<(), CoordinatesError> {
        check_inside(&Surface::new(cage.vertices(), cage).closest_points(points), cage.diagonal())
    }

    fn coordinates(
        &self,
        cage: &Cage,
        points: &[Point],
        plan: Option<&ElementPlan>,
    ) -> Result<Coordinates, CoordinatesError> {
        solve_for(cage, points, |problem| match plan {
            Some(plan) => follow(problem, plan),
            None => refine(problem),
        })
    }
}

/// Coordinates by a way to solve the problem that a cage and points pose.
fn solve_for(
    cage: &Cage,
    points: &[Point],
    solve: impl FnOnce(&Problem<'_>) -> Result<Coordinates, CoordinatesError>,
) -> Result<Coordinates, CoordinatesError> {
    if let Some(point) = points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
        return Err(not_computed(format!("point {point} is not finite")));
    }
    let layers = Layers::new(cage);
    let points: Vec<Point> = points.iter().map(|p| p.map(|c| c * layers.scale())).collect();
    let surface = Surface::new(layers.vertices(), cage);
    let closest_points = surface.closest_points(&points);
    check_inside(&closest_points, cage.diagonal() * layers.scale())?;
    let problem = Problem {
        tables: quadrature::Tables::new(),
        affine: affine::AffineFit::new(layers.vertices()),
        corners: layers.triangles().iter().map(|t| t.map(|v| layers.vertices()[v as usize])).collect(),
        layers: &layers,
        surface: &surface,
        points: &points,
        closest_points: &closest_points,
    };
    solve(&problem)
}

fn not_computed(reason: String) -> CoordinatesError {
    CoordinatesError::NotComputed { system: NAME, reason }
}

fn check_inside(closest_points: &[ClosestPoint], diagonal: f64) -> Result<(), CoordinatesError> {
    let outside = |i: &usize| closest_points[*i].side == Side::Outside;
    let points: Vec<u32> = (0..closest_points.len()).filter(outside).map(|i| i as u32).collect();
    if points.is_empty() {
        return Ok(());
    }
    let distance = points.iter().map(|&i| closest_points[i as usize].distance).fold(0.0, f64::max) / diagonal;
    Err(CoordinatesError::Outside { system: NAME, points, distance })
}

/// What is to be solved, in the unit of the layers.
struct Problem<'a> {
    tables: quadrature::Tables,
    affine: affine::AffineFit,
    /// Corners of the faces.
    corners: Vec<[Point; 3]>,
    layers: &'a Layers,
    surface: &'a Surface<'a>,
    points: &'a [Point],
    closest_points: &'a [ClosestPoint],
}

/// Solves on finer and finer elements until that changes nothing, or no more of them are allowed.
fn refine(problem: &Problem<'_>) -> Result<Coordinates, CoordinatesError> {
    let Problem { corners, points, closest_points, .. } = problem;
    let inside = closest_points.iter().zip(*points).filter(|(closest, _)| closest.side == Side::Inside);
    let inside: Vec<Point> = inside.map(|(_, &x)| x).collect();
    let mut elements = elements::elements(corners, &inside);
    let mut degree = low_degree(elements.len()).ok_or_else(|| {
        not_computed(format!("it would take {} boundary elements, more than {}", elements.len(), LOW_DEGREES[2].0))
    })?;
    let most = MAX_ELEMENTS.max(2 * elements.len());
    let mut refinements = 0;
    loop {
        let unknowns = Unknowns::new(&elements, degree);
        let (mut found, record, residual) = solve_on(problem, &unknowns, None, true)?;
        let change = found.change.max(found.correction);
        let solution = |phi: Mat<f64>| {
            let refinement =
                Refinement { elements: unknowns.elements.len(), refinements, change: change.max(residual) };
            let plan = Some(ElementPlan::new(&unknowns, &record));
            Coordinates { phi, outside: Vec::new(), refinement: Some(refinement), plan }
        };
        if change <= Refinement::TOLERANCE || refinements == REFINEMENTS {
            return Ok(solution(found.phi));
        }
        if found.correction > Refinement::TOLERANCE {
            elements::mark_thin(&unknowns.elements, &mut found.marked);
        }
        elements = elements::refined(&unknowns, &found.marked);
        let more = elements.len() <= most && found.marked.contains(&true);
        let Some(next) = low_degree(elements.len()).filter(|_| more) else {
            return Ok(solution(found.phi));
        };
        degree = next;
        refinements += 1;
    }
}

/// Solves on the elements of a plan, by its record.
fn follow(problem: &Problem<'_>, plan: &ElementPlan) -> Result<Coordinates, CoordinatesError> {
    let (unknowns, record) = plan
        .read(&problem.corners, problem.layers.vertices().len())
        .map_err(|reason| CoordinatesError::BadPlan { system: NAME, reason })?;
    // Whoever decodes cannot choose other coordinates: it is the plan that does not suit the cage.
    let (found, ..) = solve_on(problem, &unknowns, Some(&record), false)
        .map_err(|_| CoordinatesError::BadPlan { system: NAME, reason: "its equations cannot be solved" })?;
    Ok(Coordinates { phi: found.phi, outside: Vec::new(), refinement: None, plan: Some(plan.clone()) })
}

/// Highest degree of the polynomials that all of so many elements have; `None` for too many.
fn low_degree(elements: usize) -> Option<usize> {
    LOW_DEGREES.iter().find(|(most, _)| elements <= *most).map(|(_, degree)| *degree)
}

/// Coordinates with these elements, the record of the solution, and what it left of the equations.
fn solve_on(
    problem: &Problem<'_>,
    unknowns: &Unknowns,
    given: Option<&SolveRecord>,
    measures: bool,
) -> Result<(Evaluated, SolveRecord, f64), CoordinatesError> {
    let Problem { tables, affine, layers, surface, points, closest_points, .. } = problem;
    let bytes = memory::needed(unknowns, layers.vertices().len());
    if bytes > memory::MAX_BYTES {
        let gigabytes = 1e-9 * bytes as f64;
        return Err(not_computed(format!("its boundary elements would take {gigabytes:.0} GB of memory")));
    }
    let outer = galerkin::Outer::new(tables);
    let operator = galerkin::operator(tables, &outer, unknowns);
    let sides = galerkin::right_hand_sides(&outer, layers, unknowns);
    let solved = solve::solve(operator, &sides, unknowns, layers.triangles(), given, measures)
        .ok_or_else(|| not_computed("the equations on its faces are singular in double precision".to_owned()))?;
    let solution = Solution { tables, layers, surface, affine, unknowns, densities: &solved };
    let found = evaluate::evaluate(&solution, points, closest_points, Refinement::TOLERANCE);
    // Written so that NaN is an error.
    if !(found.correction <= MISSED && found.change.is_finite()) {
        return Err(not_computed(format!(
            "linear functions are missed by {:.0e}, as happens in cages much thinner than wide",
            found.correction
        )));
    }
    Ok((found, solved.record, solved.residual))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_demo::{Capture, Options};

    /// The problem of a small cage, with points of the model in it, solved on its faces.
    fn solved<T>(work: impl FnOnce(&Problem<'_>, &Unknowns, (Evaluated, SolveRecord, f64)) -> T) -> T {
        let Capture { cage, rest, .. } = Capture::new(&Options { points: 300, frames: 1, cage_vertices: 30 });
        let cage = Cage::new(cage).expect("a cage");
        let mut value = None;
        let kept = solve_for(&cage, &rest.points, |problem| {
            let elements = elements::elements(&problem.corners, &[]);
            let unknowns = Unknowns::new(&elements, 1);
            let found = solve_on(problem, &unknowns, None, true)?;
            value = Some(work(problem, &unknowns, found));
            Ok(Coordinates { phi: Mat::zeros(0, 0), outside: Vec::new(), refinement: None, plan: None })
        });
        kept.expect("coordinates");
        value.expect("a value")
    }

    /// That records which leave more of the equations say so, by no less than coordinates are off
    /// for it.
    fn shows_in_the_residual(change: impl FnOnce(&mut SolveRecord)) {
        solved(|problem, unknowns, (found, mut record, residual)| {
            assert!(residual > 0.0 && residual < 1e-3, "{residual:e}");
            change(&mut record);
            let (other, _, left) = solve_on(problem, unknowns, Some(&record), true).expect("a solution");
            let mut worst = 0.0f64;
            for v in 0..found.phi.ncols() {
                for i in 0..found.phi.nrows() {
                    worst = worst.max((other.phi[(i, v)] - found.phi[(i, v)]).abs());
                }
            }
            assert!(left > residual && worst <= left + residual, "{left:e} after {residual:e}, off by {worst:e}");
        });
    }

    #[test]
    fn an_iteration_that_ends_early_shows_in_what_is_left() {
        shows_in_the_residual(|record| record.iterations = 0);
    }

    #[test]
    fn unknowns_that_are_left_out_show_in_what_is_left() {
        shows_in_the_residual(|record| record.patches.iter_mut().for_each(|patch| patch.truncate(patch.len() / 2)));
    }

    #[test]
    fn larger_diagonals_show_in_what_is_left() {
        shows_in_the_residual(|record| record.damping = 3);
        shows_in_the_residual(|record| {
            record.patch_damping.fill(4);
            record.iterations = 1;
        });
    }

    #[test]
    fn what_is_left_is_part_of_the_change_that_is_reported() {
        let Capture { cage, rest, .. } = Capture::new(&Options { points: 300, frames: 1, cage_vertices: 30 });
        let cage = Cage::new(cage).expect("a cage");
        let found = Harmonic.coordinates(&cage, &rest.points, None).expect("coordinates");
        let (plan, change) = (found.plan.expect("a plan"), found.refinement.expect("a numerical solution").change);
        let left = solve_for(&cage, &rest.points, |problem| {
            let (unknowns, record) = plan.read(&problem.corners, cage.vertices().len()).expect("its own plan");
            let (_, _, left) = solve_on(problem, &unknowns, Some(&record), true)?;
            assert!(change >= left && left > 0.0, "{change:e} with {left:e} left");
            Ok(Coordinates { phi: Mat::zeros(0, 0), outside: Vec::new(), refinement: None, plan: None })
        });
        left.expect("coordinates");
    }
}
