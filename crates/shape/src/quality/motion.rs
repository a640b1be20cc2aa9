//! What a motion does to a mesh, gathered frame by frame.

use cager_geometry::mesh::{Point, TriMesh};
use glam::DVec3;
use serde::Serialize;

use super::frame::Quality;
use crate::canonical::size;

/// Gathers how good the frames of a moved target are: push them in order, then ask for the summary.
pub struct MotionQuality {
    /// None for a cloud of points.
    quality: Option<Quality>,
    frames: usize,
    folded: f64,
    stretched: f64,
    volume: Option<[f64; 2]>,
    target: Jitter,
    source: Jitter,
}

/// What a motion does to the model that took it, over all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MotionSummary {
    /// Share of the area that is folded, in the mean over the frames; none for a cloud of points.
    pub folded: Option<f64>,
    /// Share of the area that is stretched, likewise.
    pub stretched: Option<f64>,
    /// The least and the greatest volume over that at rest; none for a mesh that is not closed.
    pub volume: Option<[f64; 2]>,
    /// Mean second difference of the target's points over the source's, by their sizes. None for
    /// fewer than three frames, or where the source moves evenly.
    pub jitter: Option<f64>,
}

impl MotionQuality {
    /// Of a target, with or without faces, and the rest pose of the source whose motion it takes.
    pub fn new(target: &TriMesh, source: &[Point]) -> Self {
        let quality = (!target.triangles.is_empty()).then(|| Quality::new(target));
        let [target, source] = [&target.vertices[..], source].map(Jitter::new);
        Self { quality, frames: 0, folded: 0.0, stretched: 0.0, volume: None, target, source }
    }

    /// The next frame: the target's points, and those of the source that it was made of.
    pub fn push(&mut self, target: &[Point], source: &[Point]) {
        self.frames += 1;
        self.target.push(target);
        self.source.push(source);
        let Some(measured) = self.quality.as_ref().map(|quality| quality.measure(target)) else { return };
        self.folded += measured.folded;
        self.stretched += measured.stretched;
        if let Some(volume) = measured.volume {
            let [least, most] = self.volume.unwrap_or([volume; 2]);
            self.volume = Some([least.min(volume), most.max(volume)]);
        }
    }

    /// Of all frames so far.
    pub fn summary(&self) -> MotionSummary {
        let mean = |sum: f64| (self.quality.is_some() && self.frames > 0).then(|| sum / self.frames as f64);
        let jitter = self.target.mean() / self.source.mean();
        MotionSummary {
            folded: mean(self.folded),
            stretched: mean(self.stretched),
            volume: self.volume,
            jitter: Some(jitter).filter(|jitter| jitter.is_finite()),
        }
    }
}

/// Second differences of points over time.
struct Jitter {
    size: f64,
    before: [Vec<Point>; 2],
    sum: f64,
    count: usize,
}

impl Jitter {
    fn new(rest: &[Point]) -> Self {
        Self { size: size(rest), before: [Vec::new(), Vec::new()], sum: 0.0, count: 0 }
    }

    fn push(&mut self, frame: &[Point]) {
        let [first, second] = &self.before;
        for ((a, b), c) in first.iter().zip(second).zip(frame) {
            self.sum += (DVec3::from(*a) - 2.0 * DVec3::from(*b) + DVec3::from(*c)).length();
            self.count += 1;
        }
        self.before.swap(0, 1);
        self.before[1] = frame.to_vec();
    }

    /// As a share of the size; NaN where there were too few frames.
    fn mean(&self) -> f64 {
        self.sum / self.count as f64 / self.size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(size: f64) -> TriMesh {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|p| p.map(|x| size * x));
        TriMesh { vertices: vertices.to_vec(), triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }
    }

    #[test]
    fn a_target_that_shakes_twice_as_much_for_its_size_has_a_jitter_of_two() {
        let (target, source) = (tetrahedron(1.0), tetrahedron(10.0));
        let shaken = |mesh: &TriMesh, by: f64, frame: u32| -> Vec<Point> {
            let by = by * f64::from(frame % 2);
            mesh.vertices.iter().map(|p| [p[0] + by, p[1] + 0.3 * f64::from(frame), p[2]]).collect()
        };
        let mut quality = MotionQuality::new(&target, &source.vertices);
        for frame in 0..2 {
            quality.push(&shaken(&target, 0.2, frame), &shaken(&source, 1.0, frame));
        }
        assert_eq!(quality.summary().jitter, None);
        for frame in 2..9 {
            quality.push(&shaken(&target, 0.2, frame), &shaken(&source, 1.0, frame));
        }
        let found = quality.summary();
        assert!((found.jitter.unwrap() - 2.0).abs() < 1e-9, "{found:?}");
        assert!(found.folded == Some(0.0) && found.stretched == Some(0.0));
        let volume = found.volume.unwrap();
        assert!((volume[0] - 1.0).abs() < 1e-9 && (volume[1] - 1.0).abs() < 1e-9);
        quality.push(&tetrahedron(1.2).vertices, &source.vertices);
        assert!((quality.summary().volume.unwrap()[1] - 1.728).abs() < 1e-9);
    }

    #[test]
    fn a_cloud_has_neither_folds_nor_volume() {
        let cloud = TriMesh { triangles: Vec::new(), ..tetrahedron(1.0) };
        let mut quality = MotionQuality::new(&cloud, &cloud.vertices);
        quality.push(&cloud.vertices, &cloud.vertices);
        let found = quality.summary();
        assert_eq!(found, MotionSummary { folded: None, stretched: None, volume: None, jitter: None });
    }
}
