//! How many vertices a cage needs for a goal: some frames are coded with cages of several sizes.

use super::error::CodingError;
use super::goal::{BYTES_PER_POSITION, Carried, Goal, group_frames};
use super::group::GroupCoder;
use super::meshes::RestMeshes;
use super::model::GroupDecoder;
use crate::memory::Memory;
use cager_cages::{Components, EncloseOptions, enclose};
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{BATCH, PrepareError, Rows, Solver};
use cager_geometry::mesh::{Model, diagonal};
use cager_proto::container::colors_bytes;
use std::sync::Arc;

/// Numbers of vertices that are compared.
const SIZES: [usize; 6] = [80, 120, 180, 250, 350, 500];
/// Frames that are coded for each.
pub const FRAMES: usize = 64;

/// What the sizes are compared for.
pub struct CageSizes<'a> {
    /// What the file is to meet.
    pub goal: Goal,
    /// The rest pose.
    pub rest: &'a Model,
    /// The components of its cage, where it is not one for all points.
    pub components: Option<&'a Components>,
    /// Coordinate system.
    pub system: &'a dyn CoordinateSystem,
    /// The first frames of the capture, at most [`FRAMES`].
    pub frames: &'a [Vec<f64>],
    /// Frames of the capture.
    pub total: usize,
    /// What coding may hold in memory.
    pub memory: Memory,
}

impl CageSizes<'_> {
    /// The number of vertices that gives the smallest file, or the smallest error where a size is
    /// the goal. `None` where the goal does not say which is better, or no cage can be coded.
    /// `prepare` makes a solver for a cage and a rest pose.
    pub fn best(&self, prepare: impl Fn(&Cage, &Model) -> Result<Solver, PrepareError>) -> Option<usize> {
        if !matches!(self.goal, Goal::MaxError(_) | Goal::Size(_)) || self.frames.is_empty() {
            return None;
        }
        let most = self.rest.points.len() / 2;
        let (mut best, mut worse) = (None::<(f64, usize)>, 0);
        for vertices in SIZES.into_iter().filter(|&vertices| vertices <= most) {
            let Some(cost) = self.cost(vertices, &prepare) else { continue };
            if best.is_none_or(|(least, _)| cost < least) {
                (best, worse) = (Some((cost, vertices)), 0);
            } else {
                worse += 1;
            }
            // It falls, then grows.
            if worse == 2 {
                break;
            }
        }
        best.map(|(_, vertices)| vertices)
    }

    /// Bytes of the whole file, or the mean error in its size.
    fn cost(&self, vertices: usize, prepare: &impl Fn(&Cage, &Model) -> Result<Solver, PrepareError>) -> Option<f64> {
        let around = || enclose(self.rest, &EncloseOptions { vertices, ..EncloseOptions::default() }).ok();
        let cage = match self.components {
            Some(components) => components.enclose(vertices).ok()?,
            None => Cage::new(around()?).ok()?,
        };
        let meshes = RestMeshes::new(self.goal, self.rest, &cage, self.system)?;
        let rest = &meshes.rest.mesh;
        let solver = prepare(&meshes.checked, rest).ok()?;
        let model = GroupDecoder::new(self.system, &meshes.checked, rest, &solver).ok()?;
        let other = (meshes.rest.bytes() + meshes.cage.bytes() + colors_bytes(&rest.colors)) as u64;
        let most = group_frames(rest.points.len(), solver.decoder().unknowns()).min(self.frames.len());
        let most = self.memory.frames(BYTES_PER_POSITION * rest.points.len(), most);
        let carried = Carried { room: self.goal.room(other, self.total), ..Carried::default() };
        let mut coder = GroupCoder::new(self.goal, Arc::new(model), diagonal(&rest.points), most, carried);
        let frames: Vec<&[f64]> = self.frames[..most].iter().map(Vec::as_slice).collect();
        assert!(!solver.follows_previous(), "every cage depends on the one before");
        for batch in frames.chunks(BATCH) {
            for (frame, inverted) in batch.iter().zip(solver.invert(Rows::All, None, batch)) {
                coder.push(frame.to_vec(), inverted.cage);
            }
        }
        let cost: Result<f64, CodingError> = match self.goal {
            Goal::Size(_) => coder.close().map(|group| group.mean()),
            _ => coder.usual_bytes().map(|bytes| other as f64 + bytes * self.total as f64 / most as f64),
        };
        cost.ok()
    }
}
