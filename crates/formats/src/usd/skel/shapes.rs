//! Shapes that a mesh takes: offsets of its points, by the weights of an animation.

use super::rig::Rig;
use crate::error::Fault;
use crate::scene::damaged;
use crate::usd::layer::{Kind, Layer};

/// Attributes of a shape in which others are that it takes on the way.
const BETWEEN: &str = "inbetweens:";

/// Shapes of a mesh, as long as it has that many; programs write some hundreds.
const MOST_SHAPES: usize = 1 << 12;

/// A BlendShape.
pub(super) struct Shape {
    /// Which weight of the animation is its own.
    weight: usize,
    /// The points that are moved; all where there are none.
    points: Vec<u32>,
    /// At ascending weights, the offsets of these points: at 0 there are none.
    steps: Vec<(f64, Vec<f32>)>,
}

/// The shapes of a mesh of so many points that an animation moves.
pub(super) fn read(layer: &mut Layer<'_>, mesh: usize, rig: &Rig, points: usize) -> Result<Vec<Shape>, Fault> {
    let names = layer.tokens(mesh, "skel:blendShapes", MOST_SHAPES)?.unwrap_or_default();
    let targets = layer.source.targets(mesh, "skel:blendShapeTargets")?;
    let mut shapes = Vec::new();
    for (name, target) in names.iter().zip(targets) {
        let Some((prim, _)) = target.filter(|(prim, _)| layer.prims[*prim].kind == Kind::Motion) else { continue };
        if let Some(weight) = rig.shape(name) {
            shapes.push(Shape::read(layer, prim, weight, points)?);
        }
    }
    Ok(shapes)
}

impl Shape {
    fn read(layer: &mut Layer<'_>, prim: usize, weight: usize, count: usize) -> Result<Self, Fault> {
        let points = layer.integers(prim, "pointIndices", count as u64)?;
        let points: Vec<u32> = points.into_iter().map(|point| point as u32).collect();
        if points.iter().any(|&point| point as usize >= count) {
            return Err(damaged("a blend shape moves a point that is not there"));
        }
        let mut steps = vec![(0.0, Vec::new()), (1.0, layer.floats(prim, "offsets", 3, count as u64)?)];
        for (name, _) in layer.source.properties(prim) {
            let is_offsets = name.strip_prefix(BETWEEN).is_some_and(|rest| !rest.contains(':'));
            let between = if is_offsets { layer.source.weight(prim, &name)? } else { None };
            if let (Some(weight), Some(value)) =
                (between.filter(|weight| weight.is_finite()), layer.first(prim, &name)?)
            {
                steps.push((weight, layer.source.floats(value, 3, count as u64)?));
            }
        }
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        steps.dedup_by(|later, earlier| later.0 == earlier.0);
        Ok(Self { weight, points, steps })
    }

    /// Moves points as far as the weights say: on a line between two shapes, and beyond the last.
    pub(super) fn apply(&self, weights: &[f64], points: &mut [f64]) {
        let Some(&weight) = weights.get(self.weight).filter(|&&weight| weight != 0.0) else { return };
        let next = self.steps.partition_point(|(at, _)| *at < weight).clamp(1, self.steps.len() - 1);
        let [(from, before), (to, after)] = [&self.steps[next - 1], &self.steps[next]];
        let share = (weight - from) / (to - from);
        for (offsets, share) in [(before, 1.0 - share), (after, share)] {
            for (k, offset) in offsets.as_chunks::<3>().0.iter().enumerate() {
                let point =
                    self.points.get(k).map_or(if self.points.is_empty() { k } else { usize::MAX }, |&k| k as usize);
                if let Some(point) = points.as_chunks_mut::<3>().0.get_mut(point) {
                    (0..3).for_each(|axis| point[axis] += share * f64::from(offset[axis]));
                }
            }
        }
    }
}
