//! Which connected parts of a mesh lie inside others, by rays through one tree over all faces.

use super::surface::crossing;
use super::{Aabb, Surface};
use crate::mesh::Point;
use crate::vector::{cross, dot, sub};
use glam::DVec3;

/// The connected parts of a triangle mesh, to be asked which of them the others enclose.
pub struct Nesting<'a> {
    /// The mesh, turned so that rays run along its first axis.
    surface: Surface,
    part_of: &'a [u32],
    /// A face of each part.
    first: Vec<u32>,
}

impl<'a> Nesting<'a> {
    /// Of triangles whose vertices exist, and the part of each, numbered from 0 on without gaps.
    pub fn new(vertices: &[Point], triangles: &[[u32; 3]], part_of: &'a [u32]) -> Self {
        let mut first = vec![0; part_of.iter().max().map_or(0, |&last| last as usize + 1)];
        for (face, &part) in part_of.iter().enumerate().rev() {
            first[part as usize] = face as u32;
        }
        // Along the axis that the parts are least spread over, rays meet the fewest of them.
        let starts = first.iter().map(|&f| DVec3::from(vertices[triangles[f as usize][0] as usize]));
        let spread = Aabb::around(starts).size();
        let axis = (1..3).fold(0, |best, k| if spread[k] < spread[best] { k } else { best });
        let turned = |p: &Point| DVec3::from_array([0, 1, 2].map(|k| p[(axis + k) % 3]));
        Self { surface: Surface::new(vertices.iter().map(turned).collect(), triangles.to_vec()), part_of, first }
    }

    /// The first face of a part.
    pub fn first_face(&self, part: u32) -> u32 {
        self.first[part as usize]
    }

    /// Whether other parts have a part inside, each counted by its `sign`: −1 turned inside out.
    pub fn is_enclosed(&self, part: u32, sign: impl Fn(u32) -> i32) -> bool {
        let [a, b, c] = self.surface.corners(self.first[part as usize]);
        // A vertex may lie on a part that it only touches.
        [a, (a + b + c) / 3.0].into_iter().any(|p| {
            let mut winding = 0;
            self.surface.tree.visit(&Aabb { low: p, high: DVec3::new(f64::INFINITY, p.y, p.z) }, |face| {
                let other = self.part_of[face as usize];
                if other != part {
                    winding += sign(other) * crossing(p, self.surface.corners(face));
                }
                true
            });
            winding > 0
        })
    }
}

/// Signed volumes of the parts of a triangle mesh, each relative to one of its vertices.
pub fn part_volumes(vertices: &[Point], triangles: &[[u32; 3]], part_of: &[u32]) -> Vec<f64> {
    let mut parts: Vec<Option<(Point, f64)>> = vec![None; part_of.iter().max().map_or(0, |&last| last as usize + 1)];
    for (triangle, &part) in triangles.iter().zip(part_of) {
        let corners = triangle.map(|v| vertices[v as usize]);
        let (origin, volume) = parts[part as usize].get_or_insert((corners[0], 0.0));
        let [a, b, c] = corners.map(|p| sub(p, *origin));
        *volume += dot(a, cross(b, c)) / 6.0;
    }
    parts.into_iter().map(|part| part.map_or(0.0, |(_, volume)| volume)).collect()
}
