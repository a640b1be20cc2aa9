//! Skeletons and shapes that move meshes, as UsdSkel has them: linear blend skinning.

mod rig;
mod shapes;
mod skin;

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex};

use super::layer::{Kind, Layer};
use crate::error::Fault;
use crate::scene::{Track, ancestry, shown_path};
use rig::Rig;
use skin::Skin;

/// Values of an attribute that is an array, all of which are read, each once.
#[derive(Default)]
struct Arrays {
    track: Track,
    values: HashMap<u64, Vec<f32>>,
}

impl Arrays {
    /// Of at most so many vectors of `width` numbers each.
    fn read(layer: &mut Layer<'_>, prim: usize, (name, width): (&str, usize), most: u64) -> Result<Self, Fault> {
        let (track, mut values) = (layer.attribute(prim, name)?, HashMap::new());
        for &value in track.values.iter().chain(&track.default) {
            if let Entry::Vacant(entry) = values.entry(value.0) {
                entry.insert(layer.source.floats(value, width, most)?);
            }
        }
        Ok(Self { track, values })
    }

    /// The array at a time, the next one, and the share of the way there.
    fn at(&self, time: f64) -> Option<(&[f32], &[f32], f64)> {
        let (value, next, share) = self.track.at(time)?;
        let (value, next) = (self.values.get(&value.0)?, self.values.get(&next.0)?);
        // Where its length changes, those before hold.
        Some(if value.len() == next.len() { (value, next, share) } else { (value, value, 0.0) })
    }
}

/// The skeletons of a layer that are in use: several meshes may share one.
#[derive(Default)]
pub(super) struct Rigs(HashMap<usize, Arc<Mutex<Rig>>>);

/// What moves a mesh.
pub(super) struct Bound {
    pub(super) skin: Skin,
    /// The prim in whose space the points are then.
    pub(super) space: usize,
    /// Whether they are mirrored on the way there.
    pub(super) is_mirrored: bool,
}

impl Rigs {
    /// What moves a mesh of so many points; none where it lies below no root of skeletons or is
    /// bound to none.
    pub(super) fn bind(&mut self, layer: &mut Layer<'_>, mesh: usize, points: usize) -> Result<Option<Bound>, Fault> {
        let mut above: Vec<usize> = ancestry(&layer.nodes, mesh).collect();
        let Some(root) = above.iter().rposition(|&prim| layer.prims[prim].kind == Kind::SkelRoot) else {
            return Ok(None);
        };
        above.truncate(root + 1);
        let Some(skeleton) = inherited_target(layer, &above, "skel:skeleton")? else { return Ok(None) };
        if layer.prims[skeleton].kind != Kind::Skeleton {
            return Ok(None);
        }
        let rig = match self.0.get(&skeleton) {
            Some(rig) => Arc::clone(rig),
            None => {
                let above: Vec<usize> = ancestry(&layer.nodes, skeleton).collect();
                let animation = inherited_target(layer, &above, "skel:animationSource")?;
                let name = shown_path(&layer.nodes, skeleton);
                let rig = Rig::read(layer, skeleton, animation).map_err(|fault| fault.within(&name))?;
                Arc::clone(self.0.entry(skeleton).or_insert(Arc::new(Mutex::new(rig))))
            }
        };
        let skin = Skin::read(layer, &above, rig, points)?;
        let (space, is_mirrored) = (if skin.has_joints() { skeleton } else { mesh }, skin.is_mirrored());
        Ok(Some(Bound { skin, space, is_mirrored }))
    }
}

/// Where the innermost relationship leads of those that prims have, from the inside to the outside.
fn inherited_target(layer: &mut Layer<'_>, above: &[usize], name: &str) -> Result<Option<usize>, Fault> {
    for &prim in above {
        if let Some((target, _)) = layer.source.target(prim, name)? {
            return Ok(Some(target));
        }
    }
    Ok(None)
}

/// The innermost of prims that has an attribute.
fn inherited(layer: &mut Layer<'_>, above: &[usize], name: &str) -> Result<Option<usize>, Fault> {
    for &prim in above {
        if !layer.attribute(prim, name)?.is_empty() {
            return Ok(Some(prim));
        }
    }
    Ok(None)
}
