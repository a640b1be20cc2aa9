mod cages;
mod jobs;
pub(crate) mod recoveries;
mod sessions;
mod shapespaces;
mod transfers;
