//! `/v1/transfers`: motions moved onto other models.

pub(super) mod create;
pub(super) mod jobs;
pub(super) mod results;
