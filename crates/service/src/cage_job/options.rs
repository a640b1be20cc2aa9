//! Validation of the options of a cage design.

use crate::preparation::{VERTICES, check_told, vertices_detail};
use crate::problem::{self, ApiError};
use cager_cages::{DesignOptions, Goal, Style};
use cager_proto::cage_messages::{CageOptions, CageStyle};
use std::time::Duration;

/// Validates the options of a design and converts them.
///
/// # Errors
/// An option that is out of range, not available, or contradicts another.
pub(super) fn design_options(options: &CageOptions, max_seconds: u64) -> Result<DesignOptions, ApiError> {
    let mut design = DesignOptions::default();
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
    check_told(options.name.as_deref(), None, None)?;
    if let Some(name) = options.coordinates.as_deref().filter(|&name| name != "mvc") {
        return refuse(format!("coordinates: cages are designed for mvc only, not for {name:?}; leave it out"));
    }
    design.goal = match (options.vertices, options.mean_error) {
        (Some(_), Some(_)) => {
            return refuse(
                "vertices and mean_error: give the number of vertices or the error to reach, not both".into(),
            );
        }
        (Some(vertices), None) if !VERTICES.contains(&vertices) => return refuse(vertices_detail(vertices)),
        (Some(vertices), None) => Goal::Vertices(vertices as usize),
        (None, Some(error)) if !(error.is_finite() && error > 0.0) => {
            return refuse(format!("mean_error: is {error}; give a positive fraction of the diagonal, such as 0.001"));
        }
        (None, Some(error)) => Goal::MeanError(error),
        (None, None) => design.goal,
    };
    if options.frames == Some(0) {
        return refuse("frames: a capture has at least one frame".into());
    }
    let most = Duration::from_secs(max_seconds);
    let limit = match options.time_limit_s {
        None => most,
        Some(seconds) if !(seconds.is_finite() && seconds > 0.0) => {
            return refuse(format!("time_limit_s: is {seconds}; give a positive number of seconds"));
        }
        Some(seconds) if seconds > most.as_secs_f64() => {
            let detail = format!("time_limit_s: is {seconds}, and this service allows {max_seconds} s");
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail).limit(max_seconds));
        }
        Some(seconds) => Duration::from_secs_f64(seconds),
    };
    design.style = match options.style.unwrap_or_default() {
        CageStyle::Free => Style::Free,
        CageStyle::Editable => Style::Editable,
    };
    design.time_limit = Some(limit);
    design.seed = options.seed.unwrap_or(design.seed);
    Ok(design)
}
