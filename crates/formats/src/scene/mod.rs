//! What readers of scenes share, so that each is a parser: a tree of nodes, of whose meshes some are
//! chosen; values at times, read when a frame is asked for; transforms above a mesh; its frames.

mod bytes;
mod deform;
mod faces;
mod mesh;
mod moving;
mod node;
mod reader;
mod shown;
mod surface;
mod track;
mod transform;

pub(crate) use bytes::{Allowance, Fields, Reader, Source, damaged};
pub(crate) use deform::Deformer;
pub(crate) use faces::{faces, most_corners};
pub(crate) use mesh::{MeshTracks, bounds};
pub(crate) use moving::{MovingScene, SceneTracks, no_points};
pub use node::chosen_parts;
pub(crate) use node::{Node, Tree, Wanted, ancestry, choose, list, named, path, shown, shown_path};
pub(crate) use reader::{Animation, MeshInfo, open};
pub(crate) use shown::{Steps, Visibility, said};
pub(crate) use surface::{creases, merged};
pub(crate) use track::{Points, Timeline, Track, Value, Values, check_held, union, whole_frames};
pub(crate) use transform::{Chain, MOST_OPERATIONS, Operation, affine};
