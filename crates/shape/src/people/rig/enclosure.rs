//! Whether a template lies inside the cage of a rig, and the correction of one that sticks out.

use super::Rig;
use super::topology::{CAGE_VERTICES, triangles};
use crate::points::{range, vectors, vertex_normals};
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::{Surface, outside};
use cager_geometry::vector::{add, dot, norm, sub};
use glam::DVec3;

/// How much of a template lies outside a cage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Enclosure {
    /// Points outside, ascending.
    pub outside: Vec<u32>,
    /// The farthest of them from the cage, as a fraction of the height.
    pub farthest: f64,
    /// Farthest that the correction moved a corner, as a fraction of the height.
    pub moved: f64,
}

/// Rounds of correction at the most.
const ROUNDS: usize = 60;

impl Rig {
    /// How much of a template lies outside the cage.
    pub fn enclosure(&self, template: &TriMesh) -> Enclosure {
        let found = outside(&self.cage(), &template.vertices);
        let farthest =
            found.iter().map(|&(_, distance)| distance).fold(0.0, f64::max) / extent(&template.vertices, self.up);
        Enclosure { outside: found.into_iter().map(|(point, _)| point).collect(), farthest, moved: 0.0 }
    }
}

/// Pushes corners out until the template, and what is `margin` of its height around it, lies
/// inside.
pub fn enclose(mut rig: Rig, template: &TriMesh, margin: f64) -> (Rig, Enclosure) {
    let height = extent(&template.vertices, rig.up);
    let normals = vertex_normals(&template.vertices, &template.triangles);
    let mut wanted = template.vertices.clone();
    wanted.extend(
        template.vertices.iter().zip(&normals).map(|(&p, &n)| (DVec3::from(p) + margin * height * n).to_array()),
    );
    let before = rig.cage().vertices;
    for _ in 0..ROUNDS {
        let cage = rig.cage();
        let found = outside(&cage, &wanted);
        if found.is_empty() {
            break;
        }
        let surface = Surface::new(vectors(&cage.vertices), triangles().to_vec());
        // Of each vertex, the longest way that any point asks for.
        let mut steps = [DVec3::ZERO; CAGE_VERTICES];
        for (point, _) in found {
            let p = DVec3::from(wanted[point as usize]);
            let Some(nearest) = surface.nearest(p) else { continue };
            let squares: f64 = nearest.weights.iter().map(|w| w * w).sum();
            // A little beyond the point, but never so far that it tears a face away.
            let away = (p - nearest.point) * 1.05 + (p - nearest.point).normalize_or_zero() * 2e-4 * height;
            for (v, weight) in triangles()[nearest.face as usize].into_iter().zip(nearest.weights) {
                let step = (away * (weight / squares)).clamp_length_max(0.02 * height);
                if step.length() > steps[v as usize].length() {
                    steps[v as usize] = step;
                }
            }
        }
        rig.shift(&steps);
    }
    let moved = rig.cage().vertices.iter().zip(&before).map(|(a, b)| norm(sub(*a, *b))).fold(0.0, f64::max) / height;
    let enclosure = Enclosure { moved, ..rig.enclosure(template) };
    (rig, enclosure)
}

impl Rig {
    fn shift(&mut self, steps: &[DVec3; CAGE_VERTICES]) {
        let corners = self.quads.iter_mut().flat_map(|quad| &mut quad.corners).chain(&mut self.crotch);
        for (corner, step) in corners.zip(steps) {
            *corner = add(*corner, step.to_array());
        }
    }
}

/// Extent of points along an axis.
pub(crate) fn extent(points: &[Point], up: Point) -> f64 {
    let (low, high) = range(points.iter().map(|&p| dot(p, up)));
    (high - low).max(f64::MIN_POSITIVE)
}
