//! Single- and double-layer potentials of a triangle mesh in closed form.
//!
//! For a point `x`, with `r = y − x`: the double layer of a vertex's hat function, `φ_v = ∫ hat_v
//! (r·n) / 4π|r|³`, and the single layer of a face, `ψ_f = ∫_f 1 / 4π|r|`. A harmonic `u` inside a
//! closed mesh is `u(x) = Σ φ_v u_v + Σ ψ_f ∂u/∂n` if it is linear and its normal derivative
//! constant on each face (Lipman, Levin and Cohen-Or 2008, Eq. 3).
//!
//! Both follow from the solid angle `Ω` of each face and from `L = ∫ 1/|r|` along each edge. `L`
//! enters an edge's two faces, and `Ω` φ and ψ, with opposite signs, so that linear functions are
//! reproduced to rounding wherever the point lies, even where `Ω` and `L` are inaccurate: at edges,
//! where `L` is infinite, it is clamped. Weights within a face are formed from coordinates along
//! and across its longest edge, whose rounding cancels in faces a million times longer than wide.

use crate::cage::{Cage, Face};
use crate::simd::{Lanes, angle, dot, gather, ln_ratio, multiversion};
use cager_geometry::mesh::Point;
use cager_geometry::vector;

/// Closer to the plane of a face than this fraction of its longest edge, a point lies in it.
const IN_PLANE: f64 = 1e-13;
/// Largest ratio whose logarithm is taken, at edges: the range of `L`.
const LARGEST: f64 = 1.329_227_995_784_916e36;

/// A closed triangle mesh, prepared for the potentials of its layers.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    /// Scaled by a power of two to a size near one, so that nothing overflows.
    vertices: Vec<Point>,
    scale: f64,
    /// Ends and length.
    edges: Vec<([u32; 2], f64)>,
    faces: Vec<FaceBasis>,
    triangles: Vec<[u32; 3]>,
}

/// A face in its own coordinates: its longest edge runs from the first corner, at the origin, to
/// the second, at `(length, 0)`; the third is at `(foot · length, height)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceBasis {
    /// Corners, counter-clockwise.
    pub(super) vertices: [u32; 3],
    /// `edges[i]` is the edge opposite corner i.
    edges: [u32; 3],
    /// Unit vectors along the longest edge, across it, and outwards.
    axes: [Point; 3],
    length: f64,
    height: f64,
    foot: f64,
    /// Heights over the edges opposite the first two corners.
    heights: [f64; 2],
    /// Outward unit normals, in the plane, of the edges opposite the first two corners.
    normals: [[f64; 2]; 2],
}

impl FaceBasis {
    fn new(vertices: &[Point], face: &Face) -> Self {
        let between = |a: u32, b: u32| vector::sub(vertices[b as usize], vertices[a as usize]);
        let side = |i: usize| between(face.vertices[(i + 1) % 3], face.vertices[(i + 2) % 3]);
        let lengths = [0, 1, 2].map(|i| vector::norm(side(i)));
        let top = (0..3).fold(0, |a, b| if lengths[b] > lengths[a] { b } else { a });
        let (first, second) = ((top + 1) % 3, (top + 2) % 3);
        let [v0, v1, v2] = [first, second, top].map(|i| face.vertices[i]);
        // The sides opposite the longest edge are the shortest two: their product rounds least.
        let product = vector::cross(between(v2, v0), between(v2, v1));
        let double_area = vector::norm(product);
        let length = lengths[top];
        let along = between(v0, v1).map(|c| c / length);
        let normal = product.map(|c| c / double_area);
        let axes = [along, vector::cross(normal, along), normal];
        let height = double_area / length;
        let reach = vector::dot(between(v0, v2), along);
        Self {
            vertices: [v0, v1, v2],
            edges: [first, second, top].map(|i| face.edges[i]),
            axes,
            length,
            height,
            foot: reach / length,
            heights: [double_area / lengths[first], double_area / lengths[second]],
            normals: [
                [height / lengths[first], (length - reach) / lengths[first]],
                [-height / lengths[second], reach / lengths[second]],
            ],
        }
    }

    /// Outward unit normal.
    pub(super) fn normal(&self) -> Point {
        self.axes[2]
    }

    /// Affine coordinates of `x`, given as `x − v₀` in the unit of [`Layers`], by the corners in
    /// the order of [`Self::vertices`], and the coefficient of the unit normal.
    pub(super) fn affine_coordinates(&self, x: Point) -> ([f64; 3], f64) {
        let [p, q, h] = self.axes.map(|axis| vector::dot(axis, x));
        let across = q / self.height;
        let second = p / self.length - self.foot * across;
        ([1.0 - second - across, second, across], h)
    }
}

/// Potentials at the points of one lane group, all times 4π; every entry holds one group.
pub(super) struct Scratch {
    /// Vectors to the vertices and their lengths.
    corners: Vec<[Lanes; 4]>,
    /// `L`, and the product of the vectors to the ends.
    edges: Vec<[Lanes; 2]>,
    /// `4π φ`, of each vertex.
    pub(super) double: Vec<Lanes>,
    /// `4π ψ`, of each face, in the unit of [`Layers`].
    pub(super) single: Vec<Lanes>,
}

impl Layers {
    /// Prepares a mesh.
    pub(crate) fn new(cage: &Cage) -> Self {
        let scale = 2f64.powi(-(cage.diagonal().log2() as i32).clamp(-1000, 1000));
        let vertices: Vec<Point> = cage.vertices().iter().map(|v| v.map(|c| c * scale)).collect();
        let faces = cage.faces().iter().map(|face| FaceBasis::new(&vertices, face)).collect();
        let length = |[a, b]: [u32; 2]| vector::norm(vector::sub(vertices[b as usize], vertices[a as usize]));
        let edges = cage.edges().iter().map(|e| (e.vertices, length(e.vertices))).collect();
        Self { vertices, scale, edges, faces, triangles: cage.mesh().triangles.clone() }
    }

    /// Factor from the cage's unit of length to that of the prepared mesh: a power of two.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// Vertices, in the unit of the prepared mesh.
    pub(super) fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Faces, in the order of the cage.
    pub(super) fn faces(&self) -> &[FaceBasis] {
        &self.faces
    }

    /// Corners of the faces as the cage has them.
    pub(super) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Mean of the areas of the faces, in the unit of the prepared mesh.
    pub(super) fn mean_area(&self) -> f64 {
        self.faces.iter().map(|f| 0.5 * f.length * f.height).sum::<f64>() / self.faces.len() as f64
    }

    pub(super) fn scratch(&self) -> Scratch {
        Scratch {
            corners: vec![[Lanes::ZERO; 4]; self.vertices.len()],
            edges: vec![[Lanes::ZERO; 2]; self.edges.len()],
            double: vec![Lanes::ZERO; self.vertices.len()],
            single: vec![Lanes::ZERO; self.faces.len()],
        }
    }

    /// The points from `first` on, in the unit of the prepared mesh; the last point is repeated.
    pub(super) fn group(&self, points: &[Point], first: usize) -> [Lanes; 3] {
        gather(|l| points[(first + l).min(points.len() - 1)].map(|c| c * self.scale))
    }
}

/// `1/4π`.
pub(super) const INVERSE_4PI: f64 = 1.0 / (4.0 * std::f64::consts::PI);

/// What [`edge_logarithm`] gives.
pub(super) struct EdgeLogarithm {
    /// `∫ 1/|r|` along the edge, clamped on it.
    pub(super) value: Lanes,
    /// `a·b`.
    pub(super) cosine: Lanes,
}

/// `∫ 1/|r|` along an edge between `a` and `b`, as seen from the point, and their distances.
#[inline(always)]
pub(super) fn edge_logarithm(a: &[Lanes; 4], b: &[Lanes; 4], length: f64) -> EdgeLogarithm {
    let c = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let product = a[3] * b[3];
    let far = a[3] + b[3];
    let sum = far + Lanes::splat(length);
    // |a||b| + a·b, free of cancellation between the ends as well: |a × b|² / (|a||b| − a·b).
    let between = cosine.map(|c| if c < 0.0 { 1.0 } else { 0.0 });
    let top = sum * sum * (between * (product - cosine) + between.map(|b| 1.0 - b));
    let bottom = (between * dot(&c, &c) + between.map(|b| 1.0 - b) * (product + cosine)) * 2.0;
    let least = top * (1.0 / LARGEST);
    let bottom = bottom.zip(least, |a, b| if a < b { b } else { a });
    EdgeLogarithm { value: ln_ratio(top, bottom, Lanes::splat(length) / far), cosine }
}

multiversion! {
    /// Potentials at one lane group, left in the scratch.
    pub(super) fn group_potentials(layers: &Layers, x: &[Lanes; 3], scratch: &mut Scratch) {
        for (j, v) in layers.vertices.iter().enumerate() {
            let r = [Lanes::splat(v[0]) - x[0], Lanes::splat(v[1]) - x[1], Lanes::splat(v[2]) - x[2]];
            let corner = &mut scratch.corners[j];
            corner[3] = dot(&r, &r).sqrt();
            corner[0] = r[0];
            corner[1] = r[1];
            corner[2] = r[2];
            scratch.double[j] = Lanes::ZERO;
        }
        for (k, &([a, b], length)) in layers.edges.iter().enumerate() {
            let (a, b) = (&scratch.corners[a as usize], &scratch.corners[b as usize]);
            let edge = &mut scratch.edges[k];
            let logarithm = edge_logarithm(a, b, length);
            edge[0] = logarithm.value;
            edge[1] = logarithm.cosine;
        }
        for (f, face) in layers.faces.iter().enumerate() {
            let [v0, v1, v2] = face.vertices.map(|v| v as usize);
            let [e0, e1, e2] = face.edges.map(|e| &scratch.edges[e as usize]);
            let (l0, l1, l2) = (e0[0], e1[0], e2[0]);
            let (c0, c1, c2) = (&scratch.corners[v0], &scratch.corners[v1], &scratch.corners[v2]);
            let along = |axis: &Point| c0[0] * axis[0] + c0[1] * axis[1] + c0[2] * axis[2];
            let (p, q, h) = (along(&face.axes[0]), along(&face.axes[1]), along(&face.axes[2]));
            let sine = h * (face.length * face.height);
            let cosine = c0[3] * c1[3] * c2[3] + e0[1] * c0[3] + e1[1] * c1[3] + e2[1] * c2[3];
            let half = angle(sine.map(f64::abs), cosine);
            let least = IN_PLANE * face.length;
            let omega = half.zip(h, |a, h| {
                if h > least {
                    2.0 * a
                } else if h < -least {
                    -2.0 * a
                } else {
                    0.0
                }
            });
            let across = q * (1.0 / face.height);
            let first = p * (1.0 / face.length);
            let [n0, n1] = face.normals;
            let wx = l0 * n0[0] + l1 * n1[0];
            let wy = l0 * n0[1] + l1 * n1[1] - l2;
            let s = across * omega + h * wy * (1.0 / face.height);
            let t = first * omega + h * wx * (1.0 / face.length);
            let second = s * face.foot - t;
            scratch.double[v2] = scratch.double[v2] - s;
            scratch.double[v1] = scratch.double[v1] + second;
            scratch.double[v0] = scratch.double[v0] + (omega + s - second);
            let weight1 = across * face.foot - first;
            let weight0 = across - weight1 + 1.0;
            let around = weight0 * face.heights[0] * l0 + weight1 * face.heights[1] * l1 - q * l2;
            scratch.single[f] = around - h * omega;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{LANES, store};
    use cager_geometry::mesh::TriMesh;
    use faer::Mat;

    /// `φ`, n × v, and `ψ`, n × f.
    fn potentials(layers: &Layers, points: &[Point]) -> (Mat<f64>, Mat<f64>) {
        let mut phi = Mat::zeros(points.len(), layers.vertices.len());
        let mut psi = Mat::zeros(points.len(), layers.faces.len());
        let mut scratch = layers.scratch();
        for start in (0..points.len()).step_by(LANES) {
            group_potentials(layers, &layers.group(points, start), &mut scratch);
            store(phi.as_mut(), start, scratch.double.iter().map(|&w| (w * INVERSE_4PI).0));
            store(psi.as_mut(), start, scratch.single.iter().map(|&w| (w * (INVERSE_4PI / layers.scale)).0));
        }
        (phi, psi)
    }

    /// Integrates over a face by the centroids of 4^depth equal parts.
    fn integrate([a, b, c]: [Point; 3], depth: u32, f: &mut impl FnMut(Point)) {
        if depth == 0 {
            f(vector::centroid([a, b, c]));
            return;
        }
        let (ab, bc, ca) = (vector::middle(a, b), vector::middle(b, c), vector::middle(c, a));
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            integrate(part, depth - 1, f);
        }
    }

    #[test]
    fn potentials_are_the_integrals_that_define_them() {
        let vertices = vec![[0.1, 0.2, 0.0], [3.1, 0.0, 0.3], [0.4, 1.9, -0.2], [0.7, 0.5, 2.2]];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let cage = Cage::new(TriMesh { vertices, triangles }).unwrap();
        let points = [[0.9, 0.7, 0.5], [-1.0, 3.0, 2.0], [5.0, -0.3, 0.4]];
        let (phi, psi) = potentials(&Layers::new(&cage), &points);
        for (i, x) in points.iter().enumerate() {
            let mut double = [0.0; 4];
            for (f, face) in cage.faces().iter().enumerate() {
                let corners = face.vertices.map(|v| cage.vertices()[v as usize]);
                let [a, b, c] = corners;
                let sides = [b, c].map(|p| vector::sub(p, a));
                let normal = vector::cross(sides[0], sides[1]);
                let (double_area, parts) = (vector::norm(normal), f64::from(4u32.pow(8)));
                let mut single = 0.0;
                integrate(corners, 8, &mut |y| {
                    let r = vector::sub(y, *x);
                    let share = INVERSE_4PI / vector::norm(r) * 0.5 * double_area / parts;
                    single += share;
                    let seen = share * vector::dot(r, normal) / double_area / vector::dot(r, r);
                    for (i, &v) in face.vertices.iter().enumerate() {
                        let across = vector::sub(corners[(i + 2) % 3], corners[(i + 1) % 3]);
                        let from = vector::sub(y, corners[(i + 1) % 3]);
                        let hat = vector::dot(vector::cross(across, from), normal) / (double_area * double_area);
                        double[v as usize] += hat * seen;
                    }
                });
                assert!((psi[(i, f)] - single).abs() < 1e-5, "face {f} from {x:?}: {} not {single}", psi[(i, f)]);
            }
            for (v, expected) in double.into_iter().enumerate() {
                assert!((phi[(i, v)] - expected).abs() < 1e-5, "vertex {v} from {x:?}: {} not {expected}", phi[(i, v)]);
            }
        }
    }

    #[test]
    fn groups_are_written_into_rows_of_any_layout() {
        let mut rows = Mat::zeros(2, LANES + 1);
        store(rows.transpose_mut(), 1, [[3.0; LANES], [6.0; LANES]].into_iter());
        assert!((0..LANES).all(|l| (rows[(0, l + 1)], rows[(1, l + 1)]) == (3.0, 6.0)), "{rows:?}");
        assert_eq!((rows[(0, 0)], rows[(1, 0)]), (0.0, 0.0));
    }
}
