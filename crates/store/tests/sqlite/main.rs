//! The catalogue in a file: what every catalogue does, and what is special about files.

#[macro_use]
#[path = "../conformance/mod.rs"]
mod conformance;
mod damage;
mod durability;
mod full_disk;
mod opening;
mod sharing;
mod support;
mod upkeep;

use cager_store::Catalog;

fn with_catalog(story: fn(&dyn Catalog)) {
    story(&support::Dir::new().open());
}

mod conforms {
    conformance!(crate::with_catalog);
}
