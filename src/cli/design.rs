//! Cage design with a progress bar, for `cager cage` and `cager encode`.

use super::progress;
use anyhow::{Result, bail};
use cager_cages::{Components, Design, DesignError, DesignOptions, Goal, Progress};
use cager_capture::design::{default_vertices, design_components};
use cager_core::cage::CageError;
use cager_geometry::mesh::{Model, TriMesh};
use std::ops::ControlFlow;
use std::path::Path;

/// What the number of vertices of a cage around so many points follows from: what is asked for, as
/// far as the points determine so many.
pub(super) fn goal(vertices: Option<u32>, mean_error: Option<f64>, points: usize) -> Result<Goal> {
    let vertices = vertices.filter(|&vertices| vertices as usize <= points);
    match mean_error {
        Some(error) if !(error.is_finite() && error > 0.0) => {
            bail!("--mean-error: is {error}; give a fraction of the rest pose's diagonal above 0, such as 0.001")
        }
        Some(error) => Ok(Goal::MeanError(error)),
        None => Ok(Goal::Vertices(vertices.map_or(default_vertices(points), |n| n as usize))),
    }
}

/// Designs a cage; errors name the file that caused them.
pub(super) fn design(
    rest: (&Path, &Model),
    frames: (&Path, &[Vec<f64>]),
    start: Option<(&Path, &TriMesh)>,
    components: Option<&Components>,
    options: &DesignOptions,
) -> Result<Design> {
    const PARTS: u64 = 1000;
    let bar = progress::steps();
    bar.set_length(PARTS);
    let mut watch = |now: Progress<'_>| {
        let error = now.error.map_or_else(String::new, |error| format!(", error {:.4} %", 100.0 * error));
        bar.set_message(format!("{}{error}", now.stage));
        bar.set_position((now.fraction * PARTS as f64) as u64);
        ControlFlow::Continue(())
    };
    let start_mesh = start.map(|(_, mesh)| mesh);
    let result = match start_mesh {
        Some(_) => cager_cages::design(rest.1, frames.1, start_mesh, options, &mut watch),
        None => design_components(components, rest.1, frames.1, options, &mut watch),
    };
    bar.finish_and_clear();
    result.map_err(|error| {
        let path = match &error {
            DesignError::TooManyVertices { .. } if start.is_none() => return anyhow::anyhow!("--vertices: {error}"),
            DesignError::Enclose(_) => rest.0,
            DesignError::Start(CageError::Inward { .. }) => {
                let path = start.map_or(rest.0, |(path, _)| path).display();
                return anyhow::anyhow!(
                    "{path}: the faces of the cage point inwards; turn them with `cager cage --repair {path}` first"
                );
            }
            DesignError::Start(_) | DesignError::NotSymmetric { .. } | DesignError::TooManyVertices { .. } => {
                start.map_or(rest.0, |(path, _)| path)
            }
            DesignError::BadGoal(_) => return anyhow::anyhow!("--mean-error: {error}"),
            _ => frames.0,
        };
        anyhow::anyhow!("{}: {error}", path.display())
    })
}
