//! Convex hulls by insertion of the farthest point (Barber et al. 1996), ended early and enlarged.

use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::predicates::orient3d;
use glam::DVec3;

/// A face of the hull with the points that see it.
struct Facet {
    corners: [u32; 3],
    /// Points in front of it, each listed at one face.
    seen_by: Vec<u32>,
    /// The farthest of them and how far it is.
    farthest: (u32, f64),
}

/// A convex polyhedron of at most `most` vertices, with all points at least `margin`/√3 inside.
pub(super) fn enlarged_hull(points: &[Point], most: usize, margin: f64) -> TriMesh {
    // Octahedra in place of points give the hull a volume even where the model is flat.
    let reach = 2.0 * margin;
    let arms = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let spread: Vec<DVec3> = points.iter().flat_map(|&p| arms.map(|arm| DVec3::from(p) + reach * arm)).collect();
    let facets = hull(&spread, most);
    let mut used: Vec<u32> = facets.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let center = used.iter().map(|&v| spread[v as usize]).sum::<DVec3>() / used.len() as f64;
    let mut scale = 1.0_f64;
    for facet in &facets {
        let [a, b, c] = facet.map(|v| spread[v as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let height = normal.dot(a - center);
        let farthest = spread.iter().map(|&p| normal.dot(p - center)).fold(0.0, f64::max);
        if height > 0.0 {
            scale = scale.max(farthest / height);
        }
    }
    let vertices = used.iter().map(|&v| (center + (spread[v as usize] - center) * scale).to_array()).collect();
    let index = |v: u32| used.partition_point(|&u| u < v) as u32;
    TriMesh { vertices, triangles: facets.iter().map(|f| f.map(index)).collect() }
}

/// Outward faces of the hull of some of the points, the farthest first.
fn hull(points: &[DVec3], most: usize) -> Vec<[u32; 3]> {
    let mut facets = first_tetrahedron(points);
    while vertex_count(&facets) < most {
        let best = (0..facets.len()).filter(|&f| !facets[f].seen_by.is_empty()).max_by(|&f, &g| {
            let (f, g) = (facets[f].farthest, facets[g].farthest);
            f.1.total_cmp(&g.1).then(g.0.cmp(&f.0))
        });
        let Some(best) = best else { break };
        let apex = facets[best].farthest.0;
        let p = points[apex as usize];
        let sees = |f: &Facet| {
            let [a, b, c] = f.corners.map(|v| points[v as usize]);
            orient3d(a, b, c, p) > 0.0
        };
        let (visible, hidden): (Vec<Facet>, Vec<Facet>) = facets.into_iter().partition(sees);
        let mut edges: Vec<[u32; 2]> =
            visible.iter().flat_map(|f| [0, 1, 2].map(|k| [f.corners[k], f.corners[(k + 1) % 3]])).collect();
        edges.sort_unstable();
        let horizon: Vec<[u32; 2]> =
            edges.iter().filter(|[a, b]| edges.binary_search(&[*b, *a]).is_err()).copied().collect();
        let mut left: Vec<u32> = visible.iter().flat_map(|f| &f.seen_by).copied().filter(|&i| i != apex).collect();
        left.sort_unstable();
        facets = hidden;
        for [a, b] in horizon {
            facets.push(facet([a, b, apex], points, &mut left));
        }
    }
    facets.iter().map(|f| f.corners).collect()
}

fn vertex_count(facets: &[Facet]) -> usize {
    // A closed surface without handles has half as many faces as vertices less two.
    facets.len() / 2 + 2
}

/// A face that takes those of the points that see it.
fn facet(corners: [u32; 3], points: &[DVec3], left: &mut Vec<u32>) -> Facet {
    let [a, b, c] = corners.map(|v| points[v as usize]);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let mut seen_by = Vec::new();
    let mut farthest = (0, f64::NEG_INFINITY);
    left.retain(|&i| {
        let p = points[i as usize];
        let seen = orient3d(a, b, c, p) > 0.0;
        if seen {
            seen_by.push(i);
            let height = normal.dot(p - a);
            if height > farthest.1 {
                farthest = (i, height);
            }
        }
        !seen
    });
    Facet { corners, seen_by, farthest }
}

/// A large tetrahedron; the points are those of octahedra, so that it has a volume.
fn first_tetrahedron(points: &[DVec3]) -> Vec<Facet> {
    let farthest = |measure: &dyn Fn(DVec3) -> f64| {
        let mut best = (0_u32, f64::NEG_INFINITY);
        for (i, &p) in points.iter().enumerate() {
            let m = measure(p);
            if m > best.1 {
                best = (i as u32, m);
            }
        }
        best.0
    };
    let at = |v: u32| points[v as usize];
    let a = farthest(&|p| -p.x);
    let b = farthest(&|p| p.distance_squared(at(a)));
    let c = farthest(&|p| (p - at(a)).cross(at(b) - at(a)).length_squared());
    let normal = (at(b) - at(a)).cross(at(c) - at(a));
    let d = farthest(&|p| normal.dot(p - at(a)).abs());
    let [b, c] = if orient3d(at(a), at(b), at(c), at(d)) < 0.0 { [b, c] } else { [c, b] };
    let mut left: Vec<u32> = (0..points.len() as u32).filter(|i| ![a, b, c, d].contains(i)).collect();
    [[a, b, c], [a, d, b], [b, d, c], [c, d, a]].map(|corners| facet(corners, points, &mut left)).into()
}
