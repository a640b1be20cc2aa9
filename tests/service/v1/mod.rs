mod cages;
mod recoveries;
mod sessions;
mod shapespaces;
mod transfers;
