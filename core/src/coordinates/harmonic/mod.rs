//! Harmonic coordinates (Joshi, Meyer, DeRose, Green and Sanocki 2007) by boundary elements.

mod affine;
mod basis;
mod elements;
mod evaluate;
mod galerkin;
mod potential;
mod quadrature;
mod solve;
mod surface;

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
/// Refining ends when it changes no coordinate of a point by more than this.
const TOLERANCE: f64 = 1e-3;
/// Refinements at most.
const REFINEMENTS: usize = 8;
/// Elements up to which all have so many low degrees: the equations of low unknowns are dense.
const LOW_DEGREES: [(usize, usize); 3] = [(1300, 2), (3000, 1), (10_000, 0)];

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

    fn coordinates(&self, cage: &Cage, points: &[Point]) -> Result<Coordinates, CoordinatesError> {
        if let Some(point) = points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(not_computed(format!("point {point} is not finite")));
        }
        let layers = Layers::new(cage);
        let points: Vec<Point> = points.iter().map(|p| p.map(|c| c * layers.scale())).collect();
        let surface = Surface::new(layers.vertices(), cage);
        let feet = surface.feet(&points);
        check_inside(&feet, cage.diagonal() * layers.scale())?;
        let (found, refinement) = refine(&Problem { layers: &layers, surface: &surface, points: &points, feet: &feet })?;
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

/// Solves on finer and finer elements until that changes nothing more.
fn refine(problem: &Problem<'_>) -> Result<(Evaluated, Refinement), CoordinatesError> {
    let Problem { layers, points, feet, .. } = problem;
    let tables = potential::Tables::new();
    let affine = affine::AffineFit::new(layers.vertices());
    let corners: Vec<[Point; 3]> = layers.triangles().iter().map(|t| t.map(|v| layers.vertices()[v as usize])).collect();
    let inside = feet.iter().zip(*points).filter(|(foot, _)| foot.side == Side::Inside);
    let inside: Vec<Point> = inside.map(|(_, &x)| x).collect();
    let mut elements = elements::elements(&corners, &inside);
    let mut refinements = 0;
    loop {
        let count = elements.len();
        let Some((_, degree)) = LOW_DEGREES.iter().find(|(most, _)| count <= *most) else {
            return Err(not_computed(format!("it would take {count} boundary elements, more than {}", LOW_DEGREES[2].0)));
        };
        let unknowns = Unknowns::new(elements, *degree);
        let found = solve_on(problem, &tables, &affine, &unknowns)?;
        if found.change <= TOLERANCE {
            let refinement = Refinement { elements: count, refinements, change: found.change };
            return Ok((found, refinement));
        }
        if refinements == REFINEMENTS {
            let change = found.change;
            return Err(not_computed(format!("{refinements} refinements on, they still change by {change:.0e}")));
        }
        refinements += 1;
        elements = elements::refined(&unknowns.elements, &found.marked);
    }
}

/// Coordinates with these elements.
fn solve_on(
    problem: &Problem<'_>,
    tables: &potential::Tables,
    affine: &affine::AffineFit,
    unknowns: &Unknowns,
) -> Result<Evaluated, CoordinatesError> {
    let Problem { layers, surface, points, feet } = problem;
    let clock = std::time::Instant::now();
    let say = |what: &str| if std::env::var_os("HARMONIC_TIMES").is_some() { eprintln!("{:8.3} {what}", clock.elapsed().as_secs_f64()) };
    let outer = galerkin::Outer::new(tables);
    let operator = galerkin::operator(tables, &outer, unknowns);
    say("operator");
    let sides = galerkin::right_hand_sides(&outer, layers, unknowns);
    say("right-hand sides");
    let densities = solve::solve(operator, &sides, unknowns, layers.triangles())
        .ok_or_else(|| not_computed("the equations on its faces are singular in double precision".to_owned()))?;
    say("solved");
    let solution = Solution { tables, layers, surface, affine, unknowns, densities: &densities };
    let found = evaluate::evaluate(&solution, points, feet, TOLERANCE);
    say(&format!("evaluated {} elements {} {} unknowns change {:.2e} marked {} correction {:.1e}", unknowns.elements.len(), unknowns.low_count(), unknowns.high_count(), found.change, found.marked.iter().filter(|m| **m).count(), found.correction));
    // Written so that NaN is an error.
    if !(found.correction <= TOLERANCE && found.change.is_finite()) {
        return Err(not_computed(format!(
            "linear functions are missed by {:.0e}, as happens in cages much thinner than wide",
            found.correction
        )));
    }
    Ok(found)
}
