mod cages;
mod jobs;
mod recoveries;
mod sessions;
mod shapespaces;
mod transfers;
