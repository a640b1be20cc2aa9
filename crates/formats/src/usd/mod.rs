//! Universal Scene Description: one polygon mesh that moves, read frame by frame and written frame by frame.
//!
//! One layer is read, binary, as text, or the first in a package; what it is composed of beside itself is refused. Positions are given as the layer has
//! them, moved by the transforms above the mesh, together with the unit and the upward axis that the layer says.

mod binary;
mod choice;
mod layer;
mod mesh;
mod package;
mod text;
mod timing;
mod transform;
mod unread;
mod write;

use std::io::{Read, Seek};

use crate::dropped::Dropped;
use crate::error::Fault;
use crate::scene::{Failure, MovingMesh};
use crate::signature::Signature;
use binary::Binary;
use layer::Layer;
use text::Text;
pub(crate) use write::{MeshWriter, Scene};

/// Opens the mesh in a file of `length` bytes that `prim` names, or the only one; of its first frame alone where what is not
/// read is to be told.
pub(crate) fn open<'a>(
    source: impl Read + Seek + Send + 'a,
    length: u64,
    prim: Option<&str>,
    dropped: Option<&mut Dropped>,
) -> Result<MovingMesh<'a>, Failure> {
    mesh::open(open_layer(source, length)?, prim, dropped)
}

/// The layer that a file is, or the first one in a package, whatever its name.
fn open_layer<'a>(mut source: impl Read + Seek + Send + 'a, length: u64) -> Result<Box<dyn Layer + 'a>, Failure> {
    let mut head = Vec::new();
    source.rewind()?;
    source.by_ref().take(1024).read_to_end(&mut head)?;
    if !head.starts_with(package::MAGIC) {
        return open_plain(source, length, &head);
    }
    let mut source = package::first(source, length)?;
    head.clear();
    source.by_ref().take(1024).read_to_end(&mut head)?;
    let length = source.length();
    open_plain(source, length, &head)
}

fn open_plain<'a>(
    source: impl Read + Seek + Send + 'a,
    length: u64,
    head: &[u8],
) -> Result<Box<dyn Layer + 'a>, Failure> {
    if head.starts_with(binary::MAGIC) {
        return Ok(Box::new(Binary::open(source, length)?));
    }
    if head.starts_with(text::MAGIC) {
        return Ok(Box::new(Text::open(source)?));
    }
    let other = Signature::other_than("usdc", head);
    let none = "does not begin as a file of USD does; export it again";
    Err(Fault::damaged(other.unwrap_or_else(|| none.to_owned())).into())
}
