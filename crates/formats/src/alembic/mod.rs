//! Alembic archives in the Ogawa container: one polygon mesh that moves, read frame by frame and written frame by frame.
//!
//! An archive is a tree of objects; a mesh is a `PolyMesh` or a `SubD`, and lies below transforms, which are applied. Alembic
//! winds faces clockwise; they are turned around on the way in and on the way out. An archive says neither its unit nor which
//! axis points up.

mod mesh;
mod objects;
mod ogawa;
mod properties;
mod sampling;
mod timing;
mod unread;
mod write;

pub(crate) use mesh::open;
pub(crate) use write::{MeshWriter, Schedule};
