//! Thin gaps between parts of a model.

use super::gap_offset::Ball;
use super::source::{NormalizedModel, area};
use cager_geometry::spatial::{Aabb, GeneralizedWinding, Surface};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};

/// Balls up to so many times the largest offset are looked for in gaps.
const MAX_BALL: f64 = 1.15;

/// A ball in a gap touches both sides: the cosine between its touching points lies below this.
const OPPOSITE: f64 = -0.6;

/// A surface that would take more samples has too many narrow gaps, which stay closed.
const MAX_SAMPLES: usize = 100_000;
/// Samples that are examined, at the most: ordinary models have less than half as many.
const MAX_EXAMINED_SAMPLES: usize = 90_000;
/// Places tried beyond one a face. Slivers as long as the model have many more than samples.
const MAX_TRIES: usize = 2_000_000;

/// Gaps shorter than so many largest offsets stay closed: few vertices could not follow both sides.
const MIN_EXTENT: f64 = 3.0;

/// Balls outside the model that touch opposite sides of long gaps; `None` of too many narrow gaps.
pub(super) fn balls_in_gaps(source: &NormalizedModel, largest: f64) -> Option<Vec<Ball>> {
    let samples = samples(&source.surface, 0.5 * largest)?;
    let winding = GeneralizedWinding::new(&source.surface);
    let touching = |&(point, normal): &(DVec3, DVec3)| {
        let ball = |outwards: DVec3| {
            let ball = ball_between(&source.surface, point, outwards, MAX_BALL * largest)?;
            (winding.at(ball.center).abs() < 0.25).then_some(ball)
        };
        [ball(normal), ball(-normal)]
    };
    let balls: Vec<Ball> =
        samples.par_iter().with_min_len(256).flat_map_iter(|s| touching(s).into_iter().flatten()).collect();
    Some(long_gaps(&balls, largest))
}

/// Points on the surface with normals, one a direction in each cube at most; `None` of too many.
fn samples(surface: &Surface, spacing: f64) -> Option<Vec<(DVec3, DVec3)>> {
    let area = (0..surface.triangles.len() as u32).map(|f| area(surface.corners(f))).sum::<f64>();
    if area > MAX_SAMPLES as f64 * spacing * spacing {
        return None;
    }
    let mut seen = HashSet::new();
    let mut samples = Vec::new();
    let mut tries = 0;
    for f in 0..surface.triangles.len() as u32 {
        let [a, b, c] = surface.corners(f);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        if normal == DVec3::ZERO {
            continue;
        }
        let side = normal.to_array().map(|x| (2.0 * x).round() as i8);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let n = ((longest / spacing).ceil() as u32).clamp(1, 100);
        tries += n as usize * (n as usize + 1) / 2 - 1;
        if samples.len() > MAX_EXAMINED_SAMPLES || tries > MAX_TRIES {
            return None;
        }
        for i in 0..n {
            for j in 0..n - i {
                let [s, t] = [i, j].map(|k| (f64::from(k) + 1.0 / 3.0) / f64::from(n));
                let point = a + s * (b - a) + t * (c - a);
                let cube = (point / spacing).floor().to_array().map(|x| x as i32);
                if seen.insert((cube, side)) {
                    samples.push((point, normal));
                }
            }
        }
    }
    Some(samples)
}

/// The ball that touches the surface at a point and, opposite, at another, by shrinking from a
/// radius (Ma, Bae and Choi 2012); `None` where there is none.
fn ball_between(surface: &Surface, point: DVec3, normal: DVec3, largest: f64) -> Option<Ball> {
    let mut radius = largest;
    let mut other = None;
    for _ in 0..16 {
        let Some(hit) = surface.nearest_within(point + radius * normal, radius * (1.0 - 1e-3)) else { break };
        let across = hit.point - point;
        let next = across.length_squared() / (2.0 * across.dot(normal));
        if !(next > 0.0 && next < radius) {
            return None;
        }
        radius = next;
        other = Some(hit.point);
    }
    let center = point + radius * normal;
    let cosine = (point - center).dot(other? - center) / (radius * radius);
    (cosine < OPPOSITE).then_some(Ball { center, radius })
}

/// The balls of gaps that are long enough.
fn long_gaps(balls: &[Ball], largest: f64) -> Vec<Ball> {
    let cube = |b: &Ball| (b.center / largest).floor().to_array().map(|x| x as i32);
    let mut cubes: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (i, ball) in balls.iter().enumerate() {
        cubes.entry(cube(ball)).or_default().push(i);
    }
    let mut kept = vec![false; balls.len()];
    for ball in balls {
        // Each gap is taken out of the map by the first of its balls.
        let mut waiting = vec![cube(ball)];
        let mut members = Vec::new();
        while let Some(at) = waiting.pop() {
            let Some(found) = cubes.remove(&at) else { continue };
            members.extend(found);
            waiting.extend((0..27).map(|s| [at[0] + s % 3 - 1, at[1] + s / 3 % 3 - 1, at[2] + s / 9 - 1]));
        }
        let extent = Aabb::around(members.iter().map(|&i| balls[i].center)).size();
        if !members.is_empty() && extent.length() >= MIN_EXTENT * largest {
            members.iter().for_each(|&i| kept[i] = true);
        }
    }
    balls.iter().zip(kept).filter(|(_, kept)| *kept).map(|(b, _)| *b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_gaps_stay_closed() {
        let chain = |x: f64, length: f64| {
            (0..=20).map(move |i| Ball { center: DVec3::new(x, length * f64::from(i) / 20.0, 0.0), radius: 0.005 })
        };
        let balls: Vec<Ball> = chain(0.0, 0.029).chain(chain(0.5, 0.031)).collect();
        let kept = long_gaps(&balls, 0.01);
        assert_eq!(kept.len(), 21);
        assert!(kept.iter().all(|b| b.center.x > 0.4));
    }

    #[test]
    fn a_ball_between_two_sheets_touches_both_and_none_lies_beside_one() {
        let sheet = |z: f64| [[-1.0, -1.0, z], [3.0, -1.0, z], [-1.0, 3.0, z]].map(DVec3::from);
        let vertices = [sheet(0.0), sheet(0.3)].concat();
        let surface = Surface::new(vertices, vec![[0, 1, 2], [3, 4, 5]]);
        let ball = ball_between(&surface, DVec3::ZERO, DVec3::Z, 1.0).unwrap();
        assert!((ball.radius - 0.15).abs() < 1e-9 && ball.center.distance(DVec3::new(0.0, 0.0, 0.15)) < 1e-9);
        assert!(ball_between(&surface, DVec3::ZERO, -DVec3::Z, 1.0).is_none());
        assert!(ball_between(&surface, DVec3::ZERO, DVec3::Z, 0.1).is_none());
    }
}
