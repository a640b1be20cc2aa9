//! Harmonic coordinates.
mod affine;
mod basis;
mod elements;
mod evaluate;
mod galerkin;
mod potential;
mod quadrature;
mod solve;

use super::layer::Layers;
use super::{CoordinateSystem, Coordinates, CoordinatesError};
use crate::cage::Cage;
use crate::mesh::Point;

/// Harmonic coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub struct Harmonic;

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
        let scaled: Vec<Point> = points.iter().map(|p| p.map(|c| c * layers.scale())).collect();
        let faces: Vec<[Point; 3]> =
            cage.mesh().triangles.iter().map(|t| t.map(|v| layers.vertices()[v as usize])).collect();
        let tables = potential::Tables::new();
        let outer = galerkin::Outer::new(&tables);
        let affine = affine::AffineFit::new(layers.vertices());
        let elements = elements::elements(&faces, &scaled);
        let mut elements = elements;
        for round in 0..8 {
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
            let densities = solve::solve(a, &b, &unknowns, &cage.mesh().triangles).ok_or_else(|| fail("its equations are singular"))?;
            say("solved");
            let found = evaluate::evaluate(&tables, &layers, &affine, &unknowns, &densities, points, 1e-3);
            say("evaluated");
            let mut s = found.changes.clone();
            s.sort_by(f64::total_cmp);
            say(&format!("round {round} change median {:.1e} 90 % {:.1e} 99 % {:.1e} max {:.1e}; {} elements marked by {} points; correction {:.1e}", s[s.len() / 2], s[s.len() * 9 / 10], s[s.len() * 99 / 100], s[s.len() - 1], found.marked.iter().filter(|m| **m).count(), s.iter().filter(|&&c| c > 1e-3).count(), found.correction));
            if s[s.len() - 1] <= 1e-3 {
                return Ok(Coordinates { phi: found.phi, outside: Vec::new() });
            }
            for (e, _) in unknowns.elements.iter().zip(&found.marked).filter(|p| *p.1) { say(&format!("   marked degree {} aspect {:.1} diameter {:.4}", e.degree, e.triangle.diameter() / e.triangle.height(), e.triangle.diameter())); }
            elements = elements::refined(&unknowns.elements, &found.marked);
        }
        Err(fail("more"))
    }
}
