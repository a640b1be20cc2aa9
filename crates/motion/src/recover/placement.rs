//! Where a template begins: turned, moved and scaled as asked for, or whether it should have been.

use super::any_subject::Recovering;
use super::{RecoverError, RecoverOptions};
use cager_core::cage::Cage;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::units::{Units, Up};
use cager_geometry::vector::{cross, norm, sub};
use cager_shape::registration::{
    AlignOptions, Alignment, FitOptions, Observation, ObservationOptions, RegistrationError, Target, alignments,
    least_turned,
};
use std::path::Path;

/// How a template was brought to the first surface.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Placement {
    /// The angle it was turned by, in degrees.
    pub degrees: f64,
    /// The factor it was scaled by.
    pub scale: f64,
    /// What it was moved by then.
    pub translation: Point,
    /// Root mean square distance after it, of positions and normals, over the surface's size.
    pub score: f64,
    /// The same of the best other turn, over this one's: near one, either may be right.
    pub runner_up: f64,
}

/// Runners-up below this are told as equal.
const SAME: f64 = 1.005;
/// A first fit that a turn makes better than this share of it was turned wrongly.
const CLEARLY_BETTER: f64 = 0.8;
/// Turns below this, in degrees, are left to the fit.
const MIN_TURN: f64 = 12.0;
/// Sizes that differ by less are motion.
const SAME_SIZE: f64 = 0.05;

/// What positions of a placed template mean, where its file says `said`: a scaled one has the
/// frames' unit, a turned one any axis up, unless `up` says which.
pub fn placed_units(said: Units, up: Option<Up>, [align, scale]: [bool; 2]) -> Units {
    Units { up: up.or(said.up.filter(|_| !align && !scale)), metres_per_unit: said.metres_per_unit.filter(|_| !scale) }
}

impl Placement {
    /// Brings a template and its cage to a surface.
    pub(super) fn find(
        template: &mut Model,
        cage: &mut TriMesh,
        surface: &Observation,
        options: &RecoverOptions,
    ) -> Result<Option<Self>, RecoverError> {
        if let Some(up) = options.up {
            let turn = |p: &mut Point| *p = turned(*p, up);
            template.points.iter_mut().chain(&mut cage.vertices).for_each(turn);
        }
        if !options.align && !options.scale {
            return Ok(None);
        }
        let up = options.up.map(|up| if up == Up::Z { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] });
        let own = seen(template).ok_or(RegistrationError::NoSurface)?;
        let all = alignments(&own, surface, &AlignOptions { up, scale: options.scale });
        let Alignment { similarity, score, runner_up } = least_turned(&all).ok_or(RegistrationError::NoSurface)?;
        template.points = similarity.apply_all(&template.points);
        cage.vertices = similarity.apply_all(&cage.vertices);
        let (degrees, translation) = (similarity.angle().to_degrees(), similarity.translation.to_array());
        Ok(Some(Self { degrees, scale: similarity.scale, translation, score, runner_up }))
    }

    /// What the user should know.
    pub(super) fn warning(&self) -> Option<String> {
        (self.runner_up < Alignment::AMBIGUOUS_BELOW).then(|| {
            format!(
                "the template may be turned otherwise: another turn lies {} on the first surface; look at the result, or turn the template yourself",
                if self.runner_up < SAME { "as well".to_owned() } else { format!("only {:.0} % worse", 100.0 * (self.runner_up - 1.0)) }
            )
        })
    }
}

/// A point whose model stood along the other of the two usual axes.
fn turned([x, y, z]: Point, up: Up) -> Point {
    match up {
        Up::Z => [x, -z, y],
        Up::Y => [x, z, -y],
    }
}

/// A template as a surface.
pub(super) fn seen(template: &Model) -> Option<Observation> {
    let mesh = TriMesh::from(template);
    Observation::of_mesh(&mesh.vertices, &mesh.triangles, &ObservationOptions::default()).ok().map(|(seen, _)| seen)
}

/// Refuses a template that lies better when it is turned, and one of another size.
pub(super) fn check_start(
    model: &Model,
    rest: &TriMesh,
    cage: &Cage,
    recovering: &Recovering<'_>,
    (path, surface): (&Path, &Observation),
) -> Result<(), RecoverError> {
    let template = &recovering.template;
    let target = Target::new(surface, template.diagonal());
    let fit = |start: &[Point]| {
        let mut known = template.unmatched(&target);
        let fitted = template.fit(&target, start, &FitOptions::FAR, &mut known);
        let score = template.score(&target, &fitted, 1, &mut known);
        (fitted, score)
    };
    let (fitted, score) = fit(cage.vertices());
    let path = || path.to_owned();
    if let Some(seen) = seen(model) {
        let found = alignments(&seen, surface, &AlignOptions::default())[0].similarity;
        let degrees = found.angle().to_degrees();
        if degrees > MIN_TURN && fit(&found.apply_all(cage.vertices())).1 < CLEARLY_BETTER * score {
            return Err(RecoverError::Turned { path: path(), degrees });
        }
    }
    let area = |cage: &[Point]| area(&recovering.positions(cage), &rest.triangles);
    let scale = (area(&fitted) / area(cage.vertices())).sqrt();
    if (scale - 1.0).abs() > SAME_SIZE {
        return Err(RecoverError::OtherSize { path: path(), scale });
    }
    Ok(())
}

/// The area of triangles.
fn area(vertices: &[Point], triangles: &[[u32; 3]]) -> f64 {
    let corner = |v: u32| vertices[v as usize];
    triangles.iter().map(|&[a, b, c]| 0.5 * norm(cross(sub(corner(b), corner(a)), sub(corner(c), corner(a))))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_template_that_is_scaled_or_turned_means_what_the_frames_do() {
        let said = Units::new(Up::Z, 0.01);
        let units = |up, placed| placed_units(said, up, placed);
        assert_eq!(units(None, [false, false]), said);
        assert_eq!(units(Some(Up::Y), [false, false]), Units::new(Up::Y, 0.01));
        assert_eq!(units(None, [true, false]), Units { up: None, ..said });
        assert_eq!(units(Some(Up::Z), [true, true]), Units { metres_per_unit: None, ..said });
        assert_eq!(units(None, [false, true]), Units::UNKNOWN);
    }
}
