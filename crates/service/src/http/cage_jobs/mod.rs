//! `/v1/cages`: cages designed by example.

pub(super) mod cage_obj;
pub(super) mod create;
pub(super) mod events;
pub(super) mod jobs;
