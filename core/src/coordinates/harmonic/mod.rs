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
use super::{CoordinateSystem, Coordinates, CoordinatesError};
use crate::cage::Cage;
use crate::mesh::Point;

/// Harmonic coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub struct Harmonic;

/// Refinement ends when no coordinate of a point changes by more than this.
const TOLERANCE: f64 = 1e-3;
/// Refinements at most.
const ROUNDS: usize = 8;

impl CoordinateSystem for Harmonic {
    fn name(&self) -> &'static str {
        "harmonic"
    }

    fn unknowns(&self, cage: &Cage) -> usize {
        cage.vertices().len()
    }

    fn rest_unknowns(&self, cage: &Cage) -> Vec<Point> {
        cage.vertices().to_vec()
    }

    fn coordinates(&self, cage: &Cage, points: &[Point]) -> Result<Coordinates, CoordinatesError> {
        let fail = |reason: &str| CoordinatesError::NotComputed { system: "harmonic", reason: reason.to_owned() };
        let clock = std::time::Instant::now();
        let say = |what: &str| if std::env::var_os("HARMONIC_TIMES").is_some() { eprintln!("{:8.3} {what}", clock.elapsed().as_secs_f64()) };
        let layers = Layers::new(cage);
        let points: Vec<Point> = points.iter().map(|p| p.map(|c| c * layers.scale())).collect();
        let surface = surface::Surface::new(layers.vertices(), cage);
        let feet = surface.feet(&points);
        let outside: Vec<u32> =
            (0..points.len()).filter(|&i| feet[i].outside && feet[i].distance > surface::ON_SURFACE).map(|i| i as u32).collect();
        if !outside.is_empty() {
            let distance = outside.iter().map(|&i| feet[i as usize].distance).fold(0.0, f64::max);
            let distance = distance / (cage.diagonal() * layers.scale());
            return Err(CoordinatesError::Outside { system: "harmonic", points: outside, distance });
        }
        say("feet");
        let tables = potential::Tables::new();
        let outer = galerkin::Outer::new(&tables);
        let affine = affine::AffineFit::new(layers.vertices());
        let corners: Vec<[Point; 3]> =
            layers.triangles().iter().map(|t| t.map(|v| layers.vertices()[v as usize])).collect();
        let free: Vec<Point> = (0..points.len()).filter(|&i| feet[i].distance > surface::ON_SURFACE).map(|i| points[i]).collect();
        let mut elements = elements::elements(&corners, &free);
        for round in 0..ROUNDS {
            let degree = if elements.len() <= 1200 { 2 } else { 1 };
            let unknowns = elements::Unknowns::new(elements, degree);
            say(&format!("{} elements, {} + {} unknowns", unknowns.elements.len(), unknowns.low_count(), unknowns.high_count()));
            let mut by = [0; 8];
            for e in &unknowns.elements { by[e.degree] += 1; }
            say(&format!("by degree {by:?}"));
            let a = galerkin::operator(&tables, &outer, &unknowns);
            say("operator");
            let b = galerkin::right_hand_sides(&outer, &layers, &unknowns);
            say("right-hand sides");
            let densities = solve::solve(a, &b, &unknowns, layers.triangles()).ok_or_else(|| fail("its equations are singular"))?;
            say("solved");
            let solution = evaluate::Solution { tables: &tables, layers: &layers, affine: &affine, unknowns: &unknowns, densities: &densities };
            let found = evaluate::evaluate(&solution, &points, &feet, TOLERANCE);
            say("evaluated");
            say(&format!("round {round} change max {:.1e}; {} elements marked; correction {:.1e}", found.change, found.marked.iter().filter(|m| **m).count(), found.correction));
            if found.change <= TOLERANCE {
                return Ok(Coordinates { phi: found.phi, outside: Vec::new() });
            }
            elements = elements::refined(&unknowns.elements, &found.marked);
        }
        Err(fail("more"))
    }
}
