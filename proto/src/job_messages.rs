//! The JSON body of `GET /v1/jobs`: long jobs of all kinds in one list.

use crate::messages::JobState;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum JobKind {
    /// Designs a cage: `/v1/cages`.
    Cage,
    /// Recovers an animation from surfaces: `/v1/recoveries`.
    Recovery,
    /// Moves a motion onto another model: `/v1/transfers`.
    Transfer,
}

/// A job as lists of all kinds have it; its own address has the rest.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct Job {
    /// What it does.
    pub kind: JobKind,
    /// Identifier.
    pub id: String,
    /// What it is called.
    pub name: Option<String>,
    /// What it is doing; a recovery that waits for frames is queued.
    pub state: JobState,
    /// Creation time, seconds since 1970.
    pub created: f64,
    /// Its address.
    pub url: String,
    /// Why there is no result.
    pub detail: Option<String>,
}

/// A page of jobs of all kinds, newest first.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct JobList {
    /// The jobs.
    pub jobs: Vec<Job>,
    /// Give it as `after` to get the next page; null on the last.
    pub next: Option<String>,
}
