//! Universal Scene Description: polygon meshes that move, read and written frame by frame.
//!
//! A layer is read, binary, as text, or the first in a package, with the files that it names
//! below its folder, where that is plain. Positions are those of the layer, moved by the transforms above a mesh,
//! with the unit and the upward axis that the layer says.

mod binary;
mod choice;
mod clips;
mod compose;
mod layer;
mod materials;
mod mesh;
mod onto;
mod package;
mod reopened;
mod skel;
mod surface;
mod text;
mod timing;
mod transform;
mod unread;
mod write;

use std::io::{Read, Seek};
use std::path::Path;

use cager_geometry::surface::Picture;

use crate::dropped::Dropped;
use crate::error::Fault;
use crate::scene::{MovingScene, Reader, Wanted};
use crate::signature::Signature;
use binary::Binary;
use layer::Layer;
pub(crate) use onto::Onto;
use text::Text;
pub(crate) use write::{MeshWriter, OverWriter, Scene};

/// Opens the meshes that are wanted; of their first frame alone where what is not read is to be told.
pub(crate) fn open<'a>(
    source: impl Read + Seek + Send + 'a,
    length: u64,
    wanted: Wanted<'_>,
    folder: Option<&Path>,
    dropped: Option<&mut Dropped>,
) -> Result<MovingScene<'a>, Fault> {
    let ((layer, pictures), is_package) = open_layer(Box::new(source), length, dropped.is_some())?;
    // Files of a package lie in it.
    let layer = compose::compose(layer, length, folder.filter(|_| !is_package))?;
    mesh::open(layer, wanted, dropped.map(|dropped| (dropped, pictures)))
}

/// The layer that a file is, or the first one in a package, whatever its name, and the other files
/// of a package where they are wanted; also whether it is one.
fn open_layer(
    mut source: Reader<'_>,
    mut length: u64,
    wants_others: bool,
) -> Result<((Layer<'_>, Vec<Picture>), bool), Fault> {
    let (mut head, mut others) = (head(&mut source)?, Vec::new());
    let is_package = head.starts_with(package::MAGIC);
    if is_package {
        if wants_others {
            (source, others) = package::others(source, length)?;
        }
        (source, length) = package::first(source, length)?;
        head = self::head(&mut source)?;
    }
    if head.starts_with(binary::MAGIC) {
        return Ok(((Binary::open(source, length)?, others), is_package));
    }
    if head.starts_with(text::MAGIC) {
        return Ok(((Text::open(source)?, others), is_package));
    }
    let other = Signature::other_than("usdc", &head);
    let none = "does not begin as a file of USD does; export it again";
    Err(Fault::damaged(other.unwrap_or_else(|| none.to_owned())))
}

fn head(source: &mut Reader<'_>) -> Result<Vec<u8>, Fault> {
    let mut head = Vec::new();
    source.rewind()?;
    source.take(1024).read_to_end(&mut head)?;
    Ok(head)
}
