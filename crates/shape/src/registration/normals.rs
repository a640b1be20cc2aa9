//! Normals of a cloud of points, estimated.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use cager_geometry::vector::{Point, dot};
use rayon::prelude::*;

use super::nearest::NearestPoints;
use crate::points::Moments;

/// Points that a plane is laid through.
const PLANE_POINTS: u32 = 12;
/// Neighbours that agree on a side.
const NEIGHBOURS: u32 = 8;

/// Unit normals of the points `kept`, of planes through their neighbours, all on one side: from
/// point to neighbour along the way on which planes turn least (Hoppe et al. 1992), from the
/// highest point. None where all points lie on a line.
pub(crate) fn estimated_normals(points: &[Point], kept: &[u32]) -> Option<Vec<Point>> {
    let tree = NearestPoints::new(points.iter().copied());
    let mut normals: Vec<Point> = kept
        .par_iter()
        .map(|&k| {
            plane_normal(&tree.several(PLANE_POINTS, points[k as usize]).iter().map(|&i| points[i]).collect::<Vec<_>>())
        })
        .collect();
    if normals.iter().all(|n| *n == [0.0; 3]) {
        return None;
    }
    let kept_points: Vec<Point> = kept.iter().map(|&k| points[k as usize]).collect();
    agree(&kept_points, &mut normals);
    Some(normals)
}

/// The normal of the plane through some points; zero where they lie on a line or in one place.
pub(crate) fn plane_normal(points: &[Point]) -> Point {
    let Moments { variances, axes, .. } = Moments::new(points);
    if variances[1] > 1e-12 * variances[0] { axes[2].to_array() } else { [0.0; 3] }
}

/// Turns normals to one side.
fn agree(points: &[Point], normals: &mut [Point]) {
    let tree = NearestPoints::new(points.iter().copied());
    let near: Vec<Vec<usize>> = points.par_iter().map(|&p| tree.several(NEIGHBOURS + 1, p)).collect();
    // Neighbourhood goes both ways.
    let mut neighbours: Vec<Vec<usize>> = vec![Vec::new(); points.len()];
    for (i, list) in near.iter().enumerate() {
        for &j in list.iter().filter(|&&j| j != i) {
            neighbours[i].push(j);
            neighbours[j].push(i);
        }
    }
    let mut from_above: Vec<usize> = (0..points.len()).collect();
    from_above.sort_by(|&i, &j| points[j][1].total_cmp(&points[i][1]));
    let mut done = vec![false; points.len()];
    for first in from_above {
        if done[first] {
            continue;
        }
        if normals[first][1] < 0.0 {
            normals[first] = normals[first].map(|x| -x);
        }
        let mut next = BinaryHeap::from([(Reverse(0_u64), first, first)]);
        while let Some((_, i, from)) = next.pop() {
            if done[i] {
                continue;
            }
            done[i] = true;
            if dot(normals[i], normals[from]) < 0.0 {
                normals[i] = normals[i].map(|x| -x);
            }
            for &j in neighbours[i].iter().filter(|&&j| !done[j]) {
                let turn = (1.0 - dot(normals[i], normals[j]).abs()).max(0.0);
                next.push((Reverse(turn.to_bits()), j, i));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_of_a_random_torus_point_outwards() {
        let mut random = fastrand::Rng::with_seed(5);
        let (points, truth): (Vec<Point>, Vec<Point>) = (0..4000)
            .map(|_| {
                let (u, v) = (random.f64() * std::f64::consts::TAU, random.f64() * std::f64::consts::TAU);
                let n = [v.cos() * u.cos(), v.sin(), v.cos() * u.sin()];
                ([3.0 * u.cos() + n[0], n[1], 3.0 * u.sin() + n[2]], n)
            })
            .unzip();
        let kept: Vec<u32> = (0..4000).step_by(3).collect();
        let normals = estimated_normals(&points, &kept).unwrap();
        let wrong = kept.iter().zip(&normals).filter(|&(&k, &n)| dot(n, truth[k as usize]) < 0.9).count();
        assert!(wrong < 10, "{wrong}");
    }

    #[test]
    fn a_line_has_none() {
        let line: Vec<Point> = (0..50).map(|i| [f64::from(i), 2.0, 3.0]).collect();
        assert_eq!(estimated_normals(&line, &[0, 1, 2]), None);
    }
}
