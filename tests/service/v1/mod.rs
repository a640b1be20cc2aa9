mod cages;
mod sessions;
