//! What readers of scenes share, so that each is a parser: a tree of nodes, of whose meshes one is
//! chosen; values at times, read when a frame is asked for; transforms above the mesh; its frames.

mod bytes;
mod faces;
mod mesh;
mod node;
mod reader;
mod track;
mod transform;

pub(crate) use bytes::{Allowance, Fields, Reader, Source, damaged};
pub(crate) use mesh::{MeshTracks, MovingMesh, bounds, no_points};
pub(crate) use node::{Node, Tree, ancestry, choose, list, named, shown, shown_path};
pub(crate) use reader::{Animation, MeshInfo, open};
pub(crate) use track::{Points, Timeline, Track, Value, Values, check_held, union};
pub(crate) use transform::{Chain, MOST_OPERATIONS, Operation};
