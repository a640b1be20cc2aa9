//! What a program says of FBX that is built without the feature `fbx`.

use std::io::{Read, Seek};
use std::path::Path;

use cager_geometry::mesh::Model;
use cager_geometry::units::Units;

use crate::dropped::Dropped;
use crate::error::{Error, Fault};
use crate::frames::{FrameReader, FrameSelection};
use crate::scene::Wanted;

fn fault() -> Fault {
    Fault::unsupported(
        "is an FBX scene, which is not read by this program, as it was built without the feature fbx; export the \
         animated mesh as USD or Alembic, or open it in Blender and export it there",
    )
}

pub(crate) fn open_frames<'a>(
    path: &Path,
    _: (impl Read + Seek, u64),
    _: usize,
    _: &FrameSelection,
    _: Option<&Path>,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    Err(fault().at(path))
}

pub(crate) fn read(
    path: &Path,
    _: (impl Read + Seek, u64),
    _: Wanted<'_>,
    _: Option<&Path>,
) -> Result<(Model, usize, Units, Dropped), Error> {
    Err(fault().at(path))
}
