//! Sizes and diagnostics of a prepared session, stored beside it so that they are known after a restart without loading the solver.

use crate::preparation::Prepared;
use cager_proto::messages::{CacheUse, ConditionNumber, PreparationSeconds, Problem};
use serde::{Deserialize, Serialize};

/// Sizes and diagnostics of a prepared session.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct Facts {
    pub(crate) points: u32,
    pub(crate) unknowns: u32,
    pub(crate) handle_count: u32,
    /// BLAKE3 digest of the handle indices, hexadecimal; empty in notes of earlier versions.
    #[serde(default)]
    pub(crate) handles_digest: String,
    /// Whether handle rows of a frame are enough: to invert it, and since nothing has to be coded.
    pub(crate) reads_handles_only: bool,
    pub(crate) cage_vertices: u32,
    pub(crate) cage_faces: u32,
    pub(crate) spectrum: u32,
    pub(crate) condition_number: ConditionNumber,
    pub(crate) rank: u32,
    pub(crate) affine_reproduction_error: f64,
    pub(crate) cache: CacheUse,
    pub(crate) seconds: PreparationSeconds,
    pub(crate) warnings: Vec<String>,
}

/// How a preparation ended.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Outcome {
    /// The session takes frames.
    Ready(Box<Facts>),
    /// Preparation failed for good.
    Failed(Box<Problem>),
}

impl Facts {
    pub(crate) fn new(prepared: &Prepared, is_coded: bool, cache: CacheUse, seconds: PreparationSeconds) -> Self {
        let solver = &prepared.solver;
        let found = solver.preparation();
        Self {
            points: solver.decoder().points() as u32,
            unknowns: solver.decoder().unknowns() as u32,
            handle_count: solver.handles().len() as u32,
            handles_digest: prepared.handles_digest.clone(),
            reads_handles_only: !solver.reads_all() && !is_coded,
            cage_vertices: prepared.cage_vertices,
            cage_faces: prepared.cage_faces,
            spectrum: prepared.options.spectrum as u32,
            condition_number: ConditionNumber { full: found.condition_full, handles: found.condition_handles },
            rank: found.rank as u32,
            affine_reproduction_error: found.affine_reproduction_error,
            cache,
            seconds,
            warnings: prepared.warnings.clone(),
        }
    }
}
