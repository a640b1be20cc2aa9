//! Skins: meshes whose vertices follow several joints, at rest.

use cager_geometry::mesh::Point;
use glam::{DAffine3, DVec3};
use gltf::json::mesh::{Primitive, Semantic};

use super::accessor::{JOINTS, MATRICES, WEIGHTS, attribute};
use super::buffers::Buffers;
use super::faults::{damaged, item, too_large};
use super::scene::{Scene, affine, mirrors};
use crate::error::Fault;

/// Sets of four joints that vertices may have; sets that repeat an accessor then cost little.
pub(super) const MAX_SETS: u32 = 8;

/// From the space that the mesh was bound in to the world's, for each joint of a skin.
pub(super) struct Joints(Vec<DAffine3>);

impl Joints {
    /// Those of a skin; at most `most` matrices are read, and their number is given back too.
    pub(super) fn of(index: usize, scene: &Scene, buffers: &Buffers<'_>, most: usize) -> Result<(Self, usize), Fault> {
        let skin = item(&buffers.root.skins, "skin", index)?;
        let place = format!("skin {index}");
        let bound = match skin.inverse_bind_matrices {
            Some(accessor) => buffers.values(accessor.value(), &MATRICES, most, &place)?,
            None => Vec::new(),
        };
        let read = bound.len().max(skin.joints.len());
        if read > most {
            return Err(too_large());
        }
        let joint = |(k, node): (usize, &gltf::json::Index<_>)| {
            let inverse = match bound.get(k) {
                Some(columns) => affine(columns),
                None if bound.is_empty() => DAffine3::IDENTITY,
                None => {
                    let (matrices, joints) = (bound.len(), skin.joints.len());
                    return Err(damaged(&place, format!("has {matrices} inverse bind matrices for {joints} joints")));
                }
            };
            Ok(*scene.world(node.value())? * inverse)
        };
        Ok((Self(skin.joints.iter().enumerate().map(joint).collect::<Result<_, _>>()?), read))
    }

    /// Whether triangles turn around, so that they must be turned back.
    pub(super) fn mirror(&self) -> bool {
        2 * self.0.iter().filter(|joint| mirrors(joint)).count() > self.0.len()
    }

    /// Moves the points of a primitive to where the joints put them; without weights they stay.
    pub(super) fn pose(
        &self,
        points: &mut [Point],
        primitive: &Primitive,
        buffers: &Buffers<'_>,
        place: &str,
    ) -> Result<(), Fault> {
        let mut moved = vec![(DVec3::ZERO, 0.0); points.len()];
        let attribute = |semantic| attribute(primitive, semantic);
        if attribute(Semantic::Joints(MAX_SETS)).is_some() {
            return Err(Fault::unsupported(format!(
                "{place}: vertices have more than {} joints each; export the mesh with fewer",
                4 * MAX_SETS
            )));
        }
        // Four joints a vertex in each set.
        for set in 0..MAX_SETS {
            let (Some(joints), Some(weights)) = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)))
            else {
                break;
            };
            let joints: Vec<[f64; 4]> = buffers.values(joints, &JOINTS, points.len(), place)?;
            let weights: Vec<[f64; 4]> = buffers.values(weights, &WEIGHTS, points.len(), place)?;
            if joints.len().min(weights.len()) < points.len() {
                return Err(damaged(place, "not every vertex has joints"));
            }
            for (k, (moved, (joints, weights))) in moved.iter_mut().zip(joints.iter().zip(&weights)).enumerate() {
                for (&joint, &weight) in joints.iter().zip(weights).filter(|&(_, &weight)| weight != 0.0) {
                    let transform = self.0.get(joint as usize).ok_or_else(|| {
                        damaged(place, format!("vertex {k} names joint {joint}, but the skin has {}", self.0.len()))
                    })?;
                    moved.0 += weight * transform.transform_point3(points[k].into());
                    moved.1 += weight;
                }
            }
        }
        for (point, (sum, weight)) in points.iter_mut().zip(moved).filter(|(_, (_, weight))| *weight != 0.0) {
            // Weights of few bits do not always add up to 1.
            *point = (sum / weight).into();
        }
        Ok(())
    }
}
