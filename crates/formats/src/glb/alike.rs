//! Points that are one, though a file stores them several times along seams and hard edges: those
//! that lie in one place at rest, and that joints and morph targets move in the same way.

use std::collections::HashMap;

use gltf::json::mesh::{Primitive, Semantic};

use super::accessor::{JOINTS, POSITIONS, WEIGHTS, attribute};
use super::buffers::Buffers;
use super::skin::MAX_SETS;
use crate::error::Fault;

/// Points of a primitive as they are stored.
pub(super) struct Block<'a> {
    pub(super) primitive: &'a Primitive,
    pub(super) first: usize,
    pub(super) count: usize,
    /// Whether no face has them.
    pub(super) is_cloud: bool,
}

/// A number for each point, the same where they are one.
pub(super) struct Alike {
    numbers: Vec<u64>,
    next: u64,
}

/// Bytes of a point that is looked up.
const LOOKED_UP: usize = 4;

impl Alike {
    /// Of the blocks of a mesh, whose first point is `first`; `take` counts work in bytes.
    pub(super) fn of(
        blocks: &[Block<'_>],
        first: usize,
        has_joints: bool,
        buffers: &Buffers<'_>,
        mut take: impl FnMut(usize) -> Result<(), Fault>,
    ) -> Result<Self, Fault> {
        let count = blocks.last().map_or(0, |block| block.first + block.count - first);
        let mut alike = Self { numbers: vec![0; count], next: 1 };
        let place = "points along seams";
        let mut known = HashMap::new();
        for block in blocks {
            take(LOOKED_UP * block.count)?;
            let Some(positions) = attribute(block.primitive, Semantic::Positions) else { continue };
            let positions = buffers.values::<3>(positions, &POSITIONS, block.count, place)?;
            let start = block.first - first;
            alike.split(positions.into_iter().enumerate().map(|(k, p)| (start + k, p)), &mut known);
        }
        // Those of a cloud are as many as are there.
        for block in blocks.iter().filter(|block| block.is_cloud) {
            let own = (0..block.count).map(|k| (block.first - first + k, [k as f64]));
            alike.split(own, &mut HashMap::new());
        }
        for set in 0..if has_joints { MAX_SETS } else { 0 } {
            let mut known = HashMap::new();
            for block in blocks {
                let both = [(Semantic::Joints(set), &JOINTS), (Semantic::Weights(set), &WEIGHTS)];
                for (semantic, wanted) in both {
                    let Some(index) = attribute(block.primitive, semantic.clone()) else { continue };
                    take(LOOKED_UP * block.count)?;
                    let values = buffers.values::<4>(index, wanted, block.count, place)?;
                    let is_weight = f64::from(u8::from(matches!(semantic, Semantic::Weights(_))));
                    let start = block.first - first;
                    let all = values.into_iter().enumerate();
                    alike.split(all.map(|(k, [a, b, c, d])| (start + k, [is_weight, a, b, c, d])), &mut known);
                }
            }
        }
        let targets = |block: &Block<'_>| block.primitive.targets.as_ref().map_or(0, Vec::len);
        for target in 0..blocks.iter().map(targets).max().unwrap_or(0) {
            let mut known = HashMap::new();
            for block in blocks {
                let target = block.primitive.targets.as_ref().and_then(|targets| targets.get(target));
                let Some(index) = target.and_then(|target| target.positions.as_ref()) else { continue };
                let (index, start) = (index.value(), block.first - first);
                let moved = match buffers.moved_points(index, block.count, place)? {
                    Some(moved) => moved,
                    None => buffers.values(index, &POSITIONS, block.count, place)?.into_iter().enumerate().collect(),
                };
                take(LOOKED_UP * (moved.len() + 1))?;
                let moved = moved.into_iter().filter(|(_, by)| *by != [0.0; 3]);
                alike.split(moved.map(|(k, by)| (start + k, by)), &mut known);
            }
        }
        Ok(alike)
    }

    /// Tells points apart that have other values.
    fn split<const N: usize>(
        &mut self,
        values: impl Iterator<Item = (usize, [f64; N])>,
        known: &mut HashMap<(u64, [u64; N]), u64>,
    ) {
        for (at, value) in values {
            let Some(number) = self.numbers.get_mut(at) else { continue };
            // 0 and −0 are one.
            *number = *known.entry((*number, value.map(|x| (x + 0.0).to_bits()))).or_insert_with(|| {
                self.next += 1;
                self.next - 1
            });
        }
    }

    /// The points in the order in which they come: the new number of each that is stored, and those
    /// that are kept.
    pub(super) fn merged(self) -> (Vec<u32>, Vec<u32>) {
        let (mut kept, mut names) = (Vec::new(), HashMap::new());
        let name = |(k, number): (u32, &u64)| {
            *names.entry(*number).or_insert_with(|| {
                kept.push(k);
                kept.len() as u32 - 1
            })
        };
        let merged = (0..).zip(&self.numbers).map(name).collect();
        (merged, kept)
    }
}
