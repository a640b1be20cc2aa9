//! How a mesh is bound to joints, and where that takes its points.

use std::sync::{Arc, Mutex, PoisonError};

use glam::{DAffine3, DVec3};

use super::inherited;
use super::rig::{MOST_JOINTS, Rig};
use super::shapes::{self, Shape};
use crate::error::Fault;
use crate::scene::{Deformer, affine, damaged};
use crate::usd::layer::Layer;

/// Joints that move one point; programs write four or eight, seldom more.
const MOST_OF_POINT: u64 = 1 << 10;

const INDICES: &str = "primvars:skel:jointIndices";
const WEIGHTS: &str = "primvars:skel:jointWeights";

pub(in crate::usd) struct Skin {
    rig: Arc<Mutex<Rig>>,
    shapes: Vec<Shape>,
    /// From the space of the mesh to that of the skeleton as the mesh was bound.
    bind: DAffine3,
    /// Joints and their weights, so many for each point or for all.
    influences: Vec<(u32, f32)>,
    of_point: usize,
    is_rigid: bool,
}

impl Skin {
    /// Of a mesh of so many points and the prims above it, whose binding it inherits.
    pub(super) fn read(
        layer: &mut Layer<'_>,
        above: &[usize],
        rig: Arc<Mutex<Rig>>,
        points: usize,
    ) -> Result<Self, Fault> {
        let locked = rig.lock().unwrap_or_else(PoisonError::into_inner);
        let shapes = shapes::read(layer, above[0], &locked, points)?;
        let bound = match inherited(layer, above, INDICES)? {
            Some(prim) => Some((prim, inherited(layer, above, WEIGHTS)?.unwrap_or(prim))),
            None => None,
        };
        let (mut influences, mut is_rigid) = (Vec::new(), false);
        if let Some((prim, of_weights)) = bound {
            check_method(layer, above)?;
            let most = MOST_OF_POINT.saturating_mul(points.max(1) as u64);
            let indices = layer.integers(prim, INDICES, most)?;
            let weights = layer.floats(of_weights, WEIGHTS, 1, most)?;
            is_rigid = !matches!(layer.source.interpolation(prim, INDICES)?.as_str(), "vertex" | "varying");
            if weights.len() != indices.len() || (!is_rigid && indices.len() % points.max(1) != 0) {
                let what = "it has other numbers of joints (primvars:skel:jointIndices) than weights or points";
                return Err(damaged(what));
            }
            let joints = joints(layer, above, &locked)?;
            let joint = |&k: &i32| usize::try_from(k).ok().and_then(|k| joints.get(k).copied());
            for (index, &weight) in indices.iter().zip(&weights) {
                let joint = joint(index).ok_or_else(|| damaged("a point is bound to a joint that is not there"))?;
                influences.push((joint, weight));
            }
        }
        let of_point = if is_rigid { influences.len() } else { influences.len() / points.max(1) };
        let bind = match inherited(layer, above, "primvars:skel:geomBindTransform")? {
            Some(prim) if bound.is_some() => layer.numbers(prim, "primvars:skel:geomBindTransform")?,
            _ => None,
        };
        let bind = bind.filter(|numbers| numbers.len() == 16).map_or(DAffine3::IDENTITY, |numbers| affine(&numbers));
        drop(locked);
        Ok(Self { rig, shapes, bind, influences, of_point, is_rigid })
    }

    pub(super) fn has_joints(&self) -> bool {
        self.of_point > 0
    }

    pub(super) fn is_mirrored(&self) -> bool {
        self.bind.matrix3.determinant() < 0.0
    }
}

/// Refuses ways of skinning that are not linear.
fn check_method(layer: &mut Layer<'_>, above: &[usize]) -> Result<(), Fault> {
    let name = "primvars:skel:skinningMethod";
    let Some(prim) = inherited(layer, above, name)? else { return Ok(()) };
    if layer.tokens(prim, name, 1)?.is_none_or(|method| method == ["classicLinear"]) {
        return Ok(());
    }
    let what = "is skinned by dual quaternions, which is not read; export it with its points baked, or as Alembic";
    Err(Fault::unsupported(what))
}

/// The joints of the skeleton that a mesh counts, which may have an order of its own.
fn joints(layer: &mut Layer<'_>, above: &[usize], rig: &Rig) -> Result<Vec<u32>, Fault> {
    let Some(prim) = inherited(layer, above, "skel:joints")? else { return Ok((0..rig.count() as u32).collect()) };
    let names = layer.tokens(prim, "skel:joints", MOST_JOINTS)?.unwrap_or_default();
    let joint = |name: &String| rig.joints.get(name).map(|&joint| joint as u32);
    let joints: Option<Vec<u32>> = names.iter().map(joint).collect();
    joints.ok_or_else(|| damaged("a mesh names a joint that its skeleton does not have"))
}

impl Deformer for Skin {
    fn times(&self) -> Vec<f64> {
        self.rig.lock().unwrap_or_else(PoisonError::into_inner).times()
    }

    fn deform(&mut self, time: f64, points: &mut [f64]) -> Result<(), Fault> {
        let mut rig = self.rig.lock().unwrap_or_else(PoisonError::into_inner);
        let weights = rig.weights(time);
        self.shapes.iter().for_each(|shape| shape.apply(&weights, points));
        if !self.has_joints() {
            return Ok(());
        }
        let joints = rig.pose(time);
        let mut all = self.influences.chunks_exact(self.of_point);
        let of_all = if self.is_rigid { all.next() } else { None };
        for point in points.as_chunks_mut::<3>().0 {
            let Some(influences) = of_all.or_else(|| all.next()) else { break };
            let bound = self.bind.transform_point3(DVec3::from(*point));
            let moved = influences
                .iter()
                .filter(|(_, weight)| *weight != 0.0)
                .map(|&(joint, weight)| f64::from(weight) * joints[joint as usize].transform_point3(bound));
            *point = moved.sum::<DVec3>().into();
        }
        Ok(())
    }
}
