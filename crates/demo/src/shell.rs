//! The grid over height and angle, and the cage grown on it.

use std::f64::consts::TAU;

use super::figure::{HEIGHT, heights, place, pushed_out, radius, silhouette_normal, spine};
use cager_geometry::mesh::{Model, Point, Polygons, TriMesh};

/// Distance the cage aims to keep from the figure.
const MARGIN: f64 = 0.02;

/// Rings of vertices between two poles.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) rings: usize,
    pub(super) columns: usize,
}

impl Grid {
    /// The grid of about `vertices` vertices with about `aspect` rings per column.
    pub(super) fn near(vertices: usize, aspect: f64) -> Self {
        let inner = (vertices - 2) as f64;
        let ideal = (inner * aspect).sqrt().round() as usize;
        let candidates = (ideal.saturating_sub(2).max(3)..=ideal + 2)
            .map(|rings| Self { rings, columns: (inner / rings as f64).round().max(5.0) as usize });
        candidates.min_by_key(|grid| grid.len().abs_diff(vertices)).expect("the range is never empty")
    }

    pub(super) fn len(self) -> usize {
        self.rings * self.columns + 2
    }

    pub(super) fn angle(self, column: usize) -> f64 {
        TAU * column as f64 / self.columns as f64
    }

    /// Index of a vertex; ring 0 and ring `rings + 1` are the poles.
    fn vertex(self, ring: usize, column: usize) -> u32 {
        let index = match ring {
            0 => 0,
            _ if ring > self.rings => self.len() - 1,
            _ => 1 + (ring - 1) * self.columns + column % self.columns,
        };
        index as u32
    }

    /// Corners of the cell above ring `k`, counter-clockwise from outside; two coincide at a pole.
    pub(super) fn cell(self, k: usize, j: usize) -> [u32; 4] {
        [self.vertex(k, j), self.vertex(k, j + 1), self.vertex(k + 1, j + 1), self.vertex(k + 1, j)]
    }
}

/// A cage of about `vertices` vertices with all of `points` strictly inside.
pub(super) fn fitted_cage(points: &[Point], vertices: usize) -> TriMesh {
    let mut shell = Shell::around_silhouette(Grid::near(vertices, 0.7));
    shell.grow_around(points);
    shell.into_mesh()
}

/// A cage in the making: a radius for each vertex of a grid over height and angle about the spine.
struct Shell {
    grid: Grid,
    /// Heights of the rings, poles included.
    heights: Vec<f64>,
    /// Radii by vertex; the poles' stay zero.
    radii: Vec<f64>,
}

impl Shell {
    /// The figure's own radii, moved out by the margin along the normal of the silhouette.
    ///
    /// The poles move further, so that the cones beneath them hold the figure's round ends.
    fn around_silhouette(grid: Grid) -> Self {
        let inner = heights(grid.rings);
        let mut shell = Self { grid, heights: vec![-MARGIN - 0.3 * inner[0]], radii: vec![0.0; grid.len()] };
        for (k, &z) in inner.iter().enumerate() {
            let [out, up] = silhouette_normal(z);
            shell.heights.push(z + MARGIN * up);
            for j in 0..grid.columns {
                shell.radii[grid.vertex(k + 1, j) as usize] = radius(z, grid.angle(j)) + MARGIN * out;
            }
        }
        let end = inner[inner.len() - 1];
        shell.heights.push(HEIGHT + MARGIN + 0.3 * (HEIGHT - end));
        shell
    }

    /// Moves vertices out until every point is inside by half the margin or more.
    fn grow_around(&mut self, points: &[Point]) {
        loop {
            let mut growth = vec![0.0_f64; self.radii.len()];
            for &point in points {
                let (own, shell, corners) = self.radii_at(pushed_out(point, 0.5 * MARGIN));
                if shell < own {
                    // The smallest change of the corners that moves the shell well past where the
                    // loop stops.
                    let squares: f64 = corners.iter().map(|(_, weight)| weight * weight).sum();
                    for (vertex, weight) in corners {
                        growth[vertex] = growth[vertex].max(weight / squares * (own + 0.5 * MARGIN - shell));
                    }
                }
            }
            // A pole stays where it is; its share is small and the next round asks the ring for it.
            growth[0] = 0.0;
            *growth.last_mut().expect("a grid has poles") = 0.0;
            if growth.iter().all(|&g| g == 0.0) {
                return;
            }
            for (radius, growth) in self.radii.iter_mut().zip(growth) {
                *radius += growth;
            }
        }
    }

    /// Distance from the spine of a point and of the shell there, and the shell's triangle with
    /// weights.
    fn radii_at(&self, [x, y, z]: Point) -> (f64, f64, [(usize, f64); 3]) {
        let k = self.heights.partition_point(|&ring| ring <= z).clamp(1, self.heights.len() - 1) - 1;
        let s = (z - self.heights[k]) / (self.heights[k + 1] - self.heights[k]);
        // The shell's spine is straight between rings, as its triangles are flat.
        let (low, high) = (spine(self.heights[k]), spine(self.heights[k + 1]));
        let (dx, dy) = (x - low[0] - s * (high[0] - low[0]), y - low[1] - s * (high[1] - low[1]));
        let angle = dy.atan2(dx).rem_euclid(TAU);
        let j = ((angle / TAU * self.grid.columns as f64) as usize).min(self.grid.columns - 1);
        let [a, b, c, d] = self.grid.cell(k, j).map(|index| index as usize);
        let (from, to) = (self.grid.angle(j), self.grid.angle(j + 1));
        let at = |r: f64, v: f64| [r * v.cos(), r * v.sin()];
        let mix = |p: [f64; 2], q: [f64; 2]| [(1.0 - s) * p[0] + s * q[0], (1.0 - s) * p[1] + s * q[1]];
        let cross = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
        let direction = [angle.cos(), angle.sin()];
        let diagonal = mix(at(self.radii[a], from), at(self.radii[c], to));
        // The slice of the cell is two segments that meet on the diagonal a c.
        let after = cross(diagonal, direction) > 0.0;
        let (p, q) = if after {
            (diagonal, mix(at(self.radii[b], to), at(self.radii[c], to)))
        } else {
            (mix(at(self.radii[a], from), at(self.radii[d], from)), diagonal)
        };
        let (left, right) = (cross(p, direction), cross(direction, q));
        let t = if left + right > 0.0 { left / (left + right) } else { 0.5 };
        let hit = [(1.0 - t) * p[0] + t * q[0], (1.0 - t) * p[1] + t * q[1]];
        let corners = if after {
            [(a, (1.0 - t) * (1.0 - s)), (b, t * (1.0 - s)), (c, s)]
        } else {
            [(a, 1.0 - s), (d, (1.0 - t) * s), (c, t * s)]
        };
        (dx.hypot(dy), hit[0].hypot(hit[1]), corners)
    }

    fn into_mesh(self) -> TriMesh {
        let Self { grid, heights, radii } = self;
        let mut mesh = TriMesh::default();
        for (k, &z) in heights.iter().enumerate() {
            let pole = k == 0 || k == grid.rings + 1;
            for j in 0..if pole { 1 } else { grid.columns } {
                mesh.vertices.push(place(spine(z), radii[grid.vertex(k, j) as usize], grid.angle(j), z));
            }
        }
        for k in 0..=grid.rings {
            for j in 0..grid.columns {
                let [a, b, c, d] = grid.cell(k, j);
                if k < grid.rings {
                    mesh.triangles.push([a, c, d]);
                }
                if k > 0 {
                    mesh.triangles.push([a, b, c]);
                }
            }
        }
        mesh
    }
}

pub(super) fn figure(points: usize) -> Model {
    let grid = Grid::near(points, 1.15);
    let heights = heights(grid.rings);
    let mut positions = Vec::with_capacity(grid.len());
    positions.push(place(spine(0.0), 0.0, 0.0, 0.0));
    for &z in &heights {
        positions.extend((0..grid.columns).map(|j| place(spine(z), radius(z, grid.angle(j)), grid.angle(j), z)));
    }
    positions.push(place(spine(HEIGHT), 0.0, 0.0, HEIGHT));
    let mut faces = Polygons::new();
    for k in 0..=grid.rings {
        for j in 0..grid.columns {
            let [a, b, c, d] = grid.cell(k, j);
            match k {
                0 => faces.push(&[a, c, d]),
                _ if k == grid.rings => faces.push(&[a, b, c]),
                _ => faces.push(&[a, b, c, d]),
            }
        }
    }
    Model { points: positions, faces, ..Model::default() }
}
