//! Filling of holes without new vertices, by triangles of least area (Barequet and Sharir 1995).

use glam::DVec3;

/// Longest border loop that is filled; longer ones are left to the user.
pub(super) const MAX_HOLE_EDGES: usize = 40;

/// Faces that fill a border loop: one polygon of at most four corners, otherwise triangles.
pub(super) fn fill(border: &[u32], position: impl Fn(u32) -> DVec3) -> Vec<Vec<u32>> {
    let n = border.len();
    if n <= 4 {
        return vec![border.to_vec()];
    }
    let at: Vec<DVec3> = border.iter().map(|&v| position(v)).collect();
    let area = |i: usize, j: usize, k: usize| (at[j] - at[i]).cross(at[k] - at[i]).length();
    // cost[i][k]: least area over the chain i..=k, and the corner it takes.
    let mut cost = vec![vec![(0.0_f64, 0_usize); n]; n];
    for span in 2..n {
        for i in 0..n - span {
            let k = i + span;
            let through = |j: usize| cost[i][j].0 + cost[j][k].0 + area(i, j, k);
            let best = (i + 1..k).min_by(|&a, &b| through(a).total_cmp(&through(b))).unwrap_or(i + 1);
            cost[i][k] = (through(best), best);
        }
    }
    let mut faces = Vec::new();
    let mut chains = vec![(0, n - 1)];
    while let Some((i, k)) = chains.pop() {
        if k - i >= 2 {
            let j = cost[i][k].1;
            faces.push(vec![border[i], border[j], border[k]]);
            chains.extend([(i, j), (j, k)]);
        }
    }
    faces
}
