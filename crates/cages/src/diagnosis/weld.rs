//! Welding of coincident vertices along open borders, where flat shading and UV seams split them.

use cager_geometry::mesh::{Model, diagonal};
use cager_geometry::topology::edges;
use glam::DVec3;
use std::collections::HashMap;

/// Vertices closer than this fraction of the diagonal are in the same place.
const SAME_PLACE: f64 = 1e-6;

/// A mesh whose seams were closed.
#[derive(Clone, Debug, PartialEq)]
pub struct Welded {
    /// The mesh, its vertices in the order of the first of each place, its faces as they were.
    pub model: Model,
    /// For each vertex before, the one that it became.
    pub target: Vec<u32>,
    /// Vertices that are gone.
    pub merged: usize,
}

/// Merges vertices in the same place where the surface is open; `None` where no two are. Parts of a
/// closed surface that touch stay apart.
pub fn weld(model: &Model) -> Option<Welded> {
    if model.faces.indices().iter().any(|&v| v as usize >= model.points.len()) {
        return None;
    }
    let faces: Vec<&[u32]> = model.faces.iter().collect();
    let points: Vec<DVec3> = model.points.iter().map(|&p| p.into()).collect();
    let same = same_place(&points, &faces);
    let merged = same.iter().enumerate().filter(|(v, t)| *v != **t as usize).count();
    if merged == 0 {
        return None;
    }
    let mut kept = Vec::with_capacity(points.len() - merged);
    let mut colors = Vec::new();
    let mut target = vec![0; points.len()];
    for (v, &first) in same.iter().enumerate() {
        target[v] = if first as usize == v {
            kept.push(model.points[v]);
            colors.extend(model.colors.get(v));
            kept.len() as u32 - 1
        } else {
            target[first as usize]
        };
    }
    let faces = model.faces.renamed(&target);
    Some(Welded { model: Model { points: kept, faces, colors, ..Model::default() }, target, merged })
}

/// For each vertex, the first one in its place, where both lie on open borders; otherwise itself.
pub(super) fn same_place(points: &[DVec3], faces: &[impl AsRef<[u32]>]) -> Vec<u32> {
    let edges = edges(faces);
    let mut border: Vec<u32> = edges.iter().filter(|(_, u)| u.len() == 1).flat_map(|(e, _)| *e).collect();
    border.sort_unstable();
    border.dedup();
    let finite: Vec<[f64; 3]> = points.iter().filter(|p| p.is_finite()).map(DVec3::to_array).collect();
    let tolerance = (SAME_PLACE * diagonal(&finite)).max(f64::MIN_POSITIVE);
    let cell = |p: DVec3| (p / tolerance).round().to_array().map(|x| x as i64);
    let mut first: HashMap<[i64; 3], u32> = HashMap::new();
    let mut target: Vec<u32> = (0..points.len() as u32).collect();
    for v in border {
        let p = points[v as usize];
        let [x, y, z] = cell(p);
        let near = (0..27).find_map(|i| {
            let key = [x.saturating_add(i % 3 - 1), y.saturating_add(i / 3 % 3 - 1), z.saturating_add(i / 9 - 1)];
            first.get(&key).copied().filter(|&w| points[w as usize].distance(p) <= tolerance)
        });
        match near {
            Some(w) => target[v as usize] = w,
            None => {
                first.insert(cell(p), v);
            }
        }
    }
    target
}
