//! The catalogue in PostgreSQL: what every catalogue does, and what is special about a server that others use and that may be away.

#[macro_use]
#[path = "../conformance/mod.rs"]
mod conformance;
mod away;
mod claim;
mod copying;
mod damage;
mod figures;
mod opening;
mod sharing;
mod support;

use cager_store::Catalog;

fn with_catalog(story: fn(&dyn Catalog)) {
    if let Some(server) = support::Server::start() {
        story(&server.open());
    }
}

mod conforms {
    conformance!(crate::with_catalog);
}
