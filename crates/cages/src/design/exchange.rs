//! Adaptive remeshing: splits edges that lower the error most, removes vertices that matter least.

use super::contact::Obstacles;
use super::fit::{BLOCK_ROWS, Fit};
use super::topology::{self, Collapse, OneRings};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::linalg::{solve_cholesky, solve_definite, solve_lower, to_double, transposed_product};
use cager_geometry::mesh::{Point, TriMesh};
use faer::Mat;
use glam::DVec3;

/// A remeshed cage.
pub(super) struct Remeshing {
    pub(super) mesh: TriMesh,
    /// Previous index of each vertex; indices out of range are new vertices.
    pub(super) kept: Vec<u32>,
}

/// Splits the most useful edges and merges the least useful vertices, up to a share of all, while a
/// split gains more than a merger costs; beyond that as many as bring the cage towards `goal`
/// vertices.
pub(super) fn exchange(
    cage: &Cage,
    points: &[Point],
    phi: &Mat<f32>,
    fit: &Fit,
    obstacles: &Obstacles,
    share: f64,
    goal: usize,
) -> Remeshing {
    let mesh = cage.mesh();
    let m = mesh.vertices.len();
    let max_count = ((share * m as f64) as usize).max(1);
    let (missing, surplus) = (goal.saturating_sub(m), m.saturating_sub(goal));
    let rings = OneRings::new(mesh);
    let gains = split_gains(cage, points, phi, fit);
    let costs = removal_costs(mesh, &rings, fit);
    let mut touched = vec![false; m];

    let mut edges: Vec<usize> = (0..gains.len()).collect();
    edges.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]));
    let mut splits: Vec<usize> = Vec::new();
    for e in edges {
        let ends = cage.edges()[e].vertices;
        if splits.len() == max_count.max(missing.min(m / 4)) {
            break;
        }
        if !ends.iter().any(|&v| touched[v as usize]) {
            ends.iter().for_each(|&v| touched[v as usize] = true);
            splits.push(e);
        }
    }

    let mut order: Vec<usize> = (0..m).collect();
    order.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]));
    let mut current = mesh.clone();
    let mut merged: Vec<(u32, u32)> = Vec::new();
    for v in order {
        // The split that this removal makes room for.
        let split = splits.get((missing + merged.len()).saturating_sub(surplus));
        let is_worth_it = merged.len() < surplus || split.is_some_and(|&e| gains[e] > costs[v]);
        if merged.len() >= max_count.max(surplus.min(m / 4)) || !is_worth_it {
            break;
        }
        let ring = rings.of(v);
        if touched[v] || ring.iter().any(|&w| touched[w as usize]) {
            continue;
        }
        let allowed = |c: &Collapse| obstacles.allow(&current, &c.old, &c.new);
        if let Some(Collapse { into, old, new, .. }) = topology::collapses(mesh, &rings, v).into_iter().find(allowed) {
            current.triangles.retain(|t| !old.contains(t));
            current.triangles.extend(new);
            touched[v] = true;
            ring.iter().for_each(|&w| touched[w as usize] = true);
            merged.push((v as u32, into));
        }
    }
    splits.truncate((missing + merged.len()).saturating_sub(surplus));
    let mut mesh = mesh.clone();
    for e in splits {
        topology::split(&mut mesh, cage.edges()[e].vertices);
    }
    let (mesh, kept) = topology::merged(&mesh, &merged);
    Remeshing { mesh, kept }
}

/// For every edge of the cage, by how much a vertex at its middle would lower `‖X − Φ C‖²`.
///
/// A split adds one function `b` to those of the cage, so the error falls by `‖bᵀ R‖²/‖b − Π b‖²`,
/// with `R` the residual and `Π` the projection on the columns of `Φ`. All edges' functions come
/// from one subdivision of the whole cage, whose functions have a somewhat smaller support.
fn split_gains(cage: &Cage, points: &[Point], phi: &Mat<f32>, fit: &Fit) -> Vec<f64> {
    let m = cage.vertices().len();
    let Ok(fine) = Cage::new(topology::subdivided(cage)) else { return vec![0.0; cage.edges().len()] };
    let columns = MeanValue.smooth_coordinates(&fine, points);
    let b = columns.as_ref().subcols(m, cage.edges().len());
    let along = transposed_product(b, fit.residual.as_ref(), BLOCK_ROWS);
    // `‖Π b‖² = ‖L⁻¹ Φᵀ b‖²`.
    let mut projected = to_double(transposed_product(phi.as_ref(), b, BLOCK_ROWS).as_ref());
    solve_lower(fit.factor.as_ref(), &mut projected);
    let square = |x: &mut dyn Iterator<Item = &f32>| x.map(|&x| f64::from(x) * f64::from(x)).sum::<f64>();
    let gains = (0..cage.edges().len()).map(|e| {
        let own = square(&mut b.col(e).iter());
        let explained = projected.col(e).squared_norm_l2();
        let gain = square(&mut along.row(e).iter());
        gain / (own - explained).max(0.02 * own).max(f64::MIN_POSITIVE)
    });
    gains.collect()
}

/// For every vertex, by how much `‖X − Φ C‖²` would rise if it followed its neighbours, `a C = 0`:
/// by `‖a C‖²/(a (ΦᵀΦ)⁻¹ aᵀ)`.
fn removal_costs(mesh: &TriMesh, neighbours: &OneRings<'_>, fit: &Fit) -> Vec<f64> {
    let m = mesh.vertices.len();
    let mut inverse = Mat::<f64>::identity(m, m);
    solve_cholesky(fit.factor.as_ref(), &mut inverse);
    let costs = (0..m).map(|v| {
        let weights = neighbour_weights(mesh, v, &neighbours.of(v));
        let row: Vec<(usize, f64)> = std::iter::once((v, 1.0)).chain(weights.iter().map(|&(k, w)| (k, -w))).collect();
        let spread: f64 =
            row.iter().map(|&(i, x)| row.iter().map(|&(j, y)| x * y * inverse[(i, j)]).sum::<f64>()).sum();
        let moved: f64 = (0..fit.cages.ncols())
            .map(|c| row.iter().map(|&(i, x)| x * f64::from(fit.cages[(i, c)])).sum::<f64>().powi(2))
            .sum();
        moved / spread.max(f64::MIN_POSITIVE)
    });
    costs.collect()
}

/// Weights of the neighbours that sum to one and reproduce a vertex's place as well as they can.
fn neighbour_weights(mesh: &TriMesh, v: usize, ring: &[u32]) -> Vec<(usize, f64)> {
    let at = |i: usize| DVec3::from_array(mesh.vertices[i]);
    let k = ring.len();
    let offsets: Vec<DVec3> = ring.iter().map(|&r| at(r as usize) - at(v)).collect();
    let scale = offsets.iter().map(|o| o.length_squared()).sum::<f64>() / k as f64;
    // min Σ λ² ε + |Σ λ o|²/scale with Σ λ = 1: λ = A⁻¹ 1, normalised.
    let a = Mat::from_fn(k, k, |i, j| {
        offsets[i].dot(offsets[j]) / scale.max(f64::MIN_POSITIVE) + if i == j { 0.05 } else { 0.0 }
    });
    let ones = Mat::full(k, 1, 1.0);
    let x = solve_definite(a, ones.clone()).unwrap_or(ones);
    let sum: f64 = (0..k).map(|i| x[(i, 0)]).sum();
    ring.iter().enumerate().map(|(i, &r)| (r as usize, x[(i, 0)] / sum)).collect()
}
