//! How many vertices a designed cage should have for what a file is to meet.

use super::goal::Goal;
use super::meshes::meshes_bytes;
use crate::design::most_vertices;
use cager_cages::{Components, Rates, SuitedSize};
use cager_core::coordinates::CoordinateSystem;
use cager_geometry::mesh::Model;

/// The number of vertices with which the file is smallest, or its error where a size is the goal, as
/// evenly spaced frames of the `total` of a capture suggest; see [`Rates`]. `None` where the goal
/// does not say which is better, or nothing can be measured.
pub fn suited_cage_size(
    goal: Goal,
    system: &dyn CoordinateSystem,
    rest: &Model,
    components: Option<&Components>,
    frames: &[Vec<f64>],
    total: usize,
) -> Option<SuitedSize> {
    let rates = || match components {
        Some(components) => components.rates(frames, total),
        None => Rates::new(rest, frames, total),
    };
    let suited = match goal {
        Goal::MaxError(error) => rates().ok()?.suited(error),
        Goal::Size(_) => rates().ok()?.suited_to_bytes(goal.room(meshes_bytes(goal, rest)?, total)?.bytes as f64),
        Goal::MeanError(_) | Goal::Preview | Goal::Standard => return None,
    };
    let most = (most_vertices(system, rest.points.len()) / 2).max(4);
    Some(SuitedSize { vertices: suited.vertices.min(most), ..suited })
}
