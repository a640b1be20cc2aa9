//! Alembic archives in the Ogawa container: meshes that move, read and written.
//!
//! An archive is a tree of objects; a mesh is a `PolyMesh` or a `SubD`, and lies below transforms,
//! which are applied. Alembic winds faces clockwise; they are turned around on the way in and out.
//! An archive says neither its unit nor which axis points up.

mod instances;
mod mesh;
mod objects;
mod ogawa;
mod parameters;
mod properties;
mod sampling;
mod surface;
mod unread;
mod write;

pub(crate) use mesh::open;
pub(crate) use write::{MeshWriter, Scene, Schedule};
