mod cages;
mod recoveries;
mod sessions;
