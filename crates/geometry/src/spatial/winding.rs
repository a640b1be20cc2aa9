//! Generalised winding numbers of open meshes and polygon soups (Jacobson et al. 2013), with
//! distant faces taken together by their dipoles (Barill et al. 2018).

use super::bvh::Node;
use super::{Aabb, Surface};
use glam::{DMat3, DVec3};
use std::f64::consts::PI;

/// A cluster stands for its faces from so many radii on, with an error of one hundredth at most.
const FAR: f64 = 3.0;

/// The winding number of any triangles: 1 inside a closed surface, in between near holes.
#[derive(Clone, Debug)]
pub struct GeneralizedWinding<'a> {
    surface: &'a Surface,
    clusters: Vec<Cluster>,
}

/// Dipole expansion of the faces below a node.
#[derive(Clone, Copy, Debug)]
struct Cluster {
    /// Mean of the faces' centres by area.
    center: DVec3,
    /// No corner is farther from the centre.
    radius2: f64,
    /// Sum of the faces' normals, of length area each.
    normal: DVec3,
    /// Sum of (centre of face − centre) ⊗ normal: column k times component k of the normal.
    moment: DMat3,
    area: f64,
}

impl<'a> GeneralizedWinding<'a> {
    /// Gathers the dipoles of a surface.
    pub fn new(surface: &'a Surface) -> Self {
        let tree = &surface.tree;
        let empty = Cluster { center: DVec3::ZERO, radius2: 0.0, normal: DVec3::ZERO, moment: DMat3::ZERO, area: 0.0 };
        let mut clusters = vec![empty; tree.nodes()];
        for node in (0..tree.nodes()).rev() {
            let parts: Vec<Cluster> = match tree.node(node) {
                Node::Inner(children) => children.iter().map(|&c| clusters[c]).collect(),
                Node::Leaf(faces) => faces.iter().map(|&f| of_face(surface.corners(f))).collect(),
            };
            clusters[node] = joined(&parts, tree.node_box(node));
        }
        Self { surface, clusters }
    }

    /// The winding number around `p`.
    pub fn at(&self, p: DVec3) -> f64 {
        let mut angle = 0.0;
        let mut stack = [0_u32; 64];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let node = stack[height] as usize;
            let cluster = &self.clusters[node];
            let r = cluster.center - p;
            let d2 = r.length_squared();
            if d2 > FAR * FAR * cluster.radius2 {
                angle += far_angle(cluster, r, d2);
                continue;
            }
            match self.surface.tree.node(node) {
                Node::Inner([left, right]) => {
                    stack[height] = right as u32;
                    stack[height + 1] = left as u32;
                    height += 2;
                }
                Node::Leaf(faces) => {
                    angle += faces.iter().map(|&f| solid_angle(p, self.surface.corners(f))).sum::<f64>();
                }
            }
        }
        angle / (4.0 * PI)
    }
}

/// Solid angle of a triangle seen from `p`, positive from behind (Van Oosterom and Strackee 1983).
pub fn solid_angle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let (a, b, c) = (a - p, b - p, c - p);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    2.0 * a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
}

fn far_angle(cluster: &Cluster, r: DVec3, d2: f64) -> f64 {
    if d2 == 0.0 {
        return 0.0;
    }
    let inverse3 = 1.0 / (d2 * d2.sqrt());
    // Gradient of r/|r|³: (I − 3 r rᵀ/|r|²)/|r|³, contracted with the moment.
    let trace = cluster.moment.x_axis.x + cluster.moment.y_axis.y + cluster.moment.z_axis.z;
    inverse3 * (r.dot(cluster.normal) + trace - 3.0 * r.dot(cluster.moment * r) / d2)
}

fn of_face([a, b, c]: [DVec3; 3]) -> Cluster {
    let normal = 0.5 * (b - a).cross(c - a);
    Cluster { center: (a + b + c) / 3.0, radius2: 0.0, normal, moment: DMat3::ZERO, area: normal.length() }
}

fn joined(parts: &[Cluster], around: &Aabb) -> Cluster {
    let area: f64 = parts.iter().map(|p| p.area).sum();
    let weighted: DVec3 = parts.iter().map(|p| p.area * p.center).sum();
    let center = if area > 0.0 { weighted / area } else { parts.first().map_or(DVec3::ZERO, |p| p.center) };
    let mut moment = DMat3::ZERO;
    for part in parts {
        let offset = part.center - center;
        let [x, y, z] = part.normal.to_array();
        moment += part.moment + DMat3::from_cols(offset * x, offset * y, offset * z);
    }
    let reach = (around.low - center).abs().max((around.high - center).abs());
    let radius2 = if parts.is_empty() { 0.0 } else { reach.length_squared() };
    Cluster { center, radius2, normal: parts.iter().map(|p| p.normal).sum(), moment, area }
}
