//! `/v1/recoveries`: animations recovered from surfaces without correspondence.

pub(super) mod cages;
pub(super) mod create;
pub(super) mod events;
pub(super) mod frames;
pub(super) mod jobs;
pub(super) mod results;
