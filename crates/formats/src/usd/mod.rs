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
use std::path::Path;

use cager_geometry::mesh::Model;
use cager_geometry::units::Units;

use crate::dropped::Dropped;
use crate::error::{Error, Fault};
use crate::frames::FrameReader;
use crate::scene::{self, Animation, Failure};
use crate::signature::Signature;
use binary::Binary;
use layer::Layer;
use mesh::MeshFrames;
use text::Text;
pub(crate) use write::{MeshWriter, Scene};

/// Opens the frames of a mesh in a file of `length` bytes; `prim` chooses one of several.
pub(crate) fn open_frames<'a>(
    path: &Path,
    source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
    prim: Option<&str>,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let open = || MeshFrames::open(open_layer(source, length)?, prim, false);
    scene::open(path, open().map_err(|failure: Failure| failure.at(path))?, expected_points)
}

/// The first frame of a mesh, how many of its faces were left out, and its units.
pub(crate) fn read_model(
    path: &Path,
    source: impl Read + Seek + Send,
    length: u64,
    prim: Option<&str>,
    dropped: &mut Dropped,
) -> Result<(Model, usize, Units), Error> {
    let open = || MeshFrames::open(open_layer(source, length)?, prim, true);
    let mut mesh = open().map_err(|failure: Failure| failure.at(path))?;
    // What cannot be named is no reason to refuse a mesh.
    mesh.add_unread(dropped).unwrap_or_default();
    let (points, left_out, units, mut values) = (mesh.points(), mesh.left_out(), mesh.units(), Vec::new());
    let mut reader = scene::open(path, mesh, points)?;
    reader.read_next(&mut values)?;
    let faces = reader.mesh().map(|(_, faces)| faces.clone()).unwrap_or_default();
    Ok((Model { points: values.as_chunks().0.to_vec(), faces, ..Model::default() }, left_out, units))
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
