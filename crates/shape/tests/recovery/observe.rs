//! Observations of captures without correspondence, clips, and errors against the truth.

#![allow(dead_code, unreachable_pub)]

use cager_formats::biovision::read_bvh;
use cager_geometry::mesh::Point;
use cager_geometry::vector::{combination, cross, distance, norm, sub};
use cager_shape::people::poses::{Naming, SkeletonPoses};
use cager_shape::people::rig::Rig;
use cager_shape::people::{PersonFit, PersonTracker, TrackedFrame};
use cager_shape::registration::Observation;
use std::ops::Range;

use crate::common::{Capture, data};

/// Points at random on the surface of a frame, with noise as a fraction of the height.
pub fn seen(capture: &Capture, frame: usize, count: usize, noise: f64) -> Observation {
    let mut random = fastrand::Rng::with_seed(frame as u64);
    let mut normal = move || {
        let u: f64 = (0..12).map(|_| random.f64()).sum();
        u - 6.0
    };
    let mut random = fastrand::Rng::with_seed(1000 + frame as u64);
    let points = &capture.frames[frame];
    let of = |t: &[u32; 3]| t.map(|v| points[v as usize]);
    let area = |[a, b, c]: [Point; 3]| cross(sub(b, a), sub(c, a));
    let mut sum = 0.0;
    let sums: Vec<f64> = capture
        .rest
        .triangles
        .iter()
        .map(|t| {
            sum += norm(area(of(t)));
            sum
        })
        .collect();
    let mut seen = Observation::default();
    for _ in 0..count {
        let at = random.f64() * sum;
        let corners = of(&capture.rest.triangles[sums.partition_point(|&s| s <= at).min(sums.len() - 1)]);
        let (u, v) = (random.f64(), random.f64());
        let (low, high) = if u < v { (u, v) } else { (v, u) };
        let p = combination([low, high - low, 1.0 - high], corners);
        seen.points.push(p.map(|x| x + noise * capture.height * normal()));
        let n = area(corners);
        seen.normals.push(n.map(|x| x / norm(n).max(f64::MIN_POSITIVE)));
    }
    seen
}

/// Poses of a rig from some frames of a clip.
pub fn poses(rig: &Rig, clip: &str, frames: Range<usize>, step: usize) -> Vec<Vec<f64>> {
    let clip = read_bvh(data().join("bvh").join(clip).with_extension("bvh")).unwrap();
    let poses = SkeletonPoses::new(&clip.skeleton, &Naming::of(&clip.skeleton).unwrap(), rig).unwrap();
    frames.step_by(step).map(|f| poses.pose(&clip.skeleton.pose(clip.motion.frame(f)))).collect()
}

/// A person followed through observations, forwards alone.
pub fn followed(fit: &PersonFit<'_>, observations: &[Observation]) -> Vec<TrackedFrame> {
    let mut tracker = PersonTracker::new(fit);
    for observation in observations {
        tracker.follow(observation);
    }
    tracker.into_frames()
}

/// Mean distance of vertices, and the largest, in percent of the height.
pub fn errors(found: &[Point], truth: &[Point], height: f64) -> [f64; 2] {
    let distances: Vec<f64> = found.iter().zip(truth).map(|(a, b)| 100.0 * distance(*a, *b) / height).collect();
    [distances.iter().sum::<f64>() / distances.len() as f64, distances.iter().copied().fold(0.0, f64::max)]
}
