//! Point caches: a header, then the coordinates of all frames as one array.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::block::Blocks;
use super::fortran::Transposed;
use super::layout::{LONGEST_HEADER, Layout};
use super::{CacheFormat, FrameReader, FrameSelection, maya, mdd, npy, pc2};
use crate::alembic;
use crate::error::{Error, Fault};
use crate::fbx;
use crate::glb;
use crate::scene::{self, MovingScene, Wanted};
use crate::signature::Signature;
use crate::usd;

/// Opens a cache: reads the header and compares its promise with the bytes and points there are. Of
/// a scene what is selected is read, and from `folder` what it has in other files.
pub(super) fn open<'a>(
    format: CacheFormat,
    path: &Path,
    mut source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
    selection: &FrameSelection,
    folder: Option<&Path>,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let prim = selection.prim();
    let parts = selection.rest.as_ref().map_or(&[][..], |rest| &rest.surface.parts);
    let wanted = Wanted { prims: &selection.prims, points: Some(expected_points), parts };
    let read = |cause| Error::read(path, cause);
    let mut head = Vec::new();
    source.by_ref().take(LONGEST_HEADER as u64).read_to_end(&mut head).map_err(read)?;
    if let Some(what) = Signature::other_than(format.extension(), &head) {
        return Err(Fault::damaged(what).at(path));
    }
    let place = npy::Place { name: None };
    let layout = match format {
        CacheFormat::Npy => npy::layout(&head, expected_points as u64, place),
        CacheFormat::Pc2 => pc2::layout(&head),
        CacheFormat::Mdd => mdd::layout(&head),
        CacheFormat::Mcx | CacheFormat::Mc => return maya::open(path, source, length, expected_points, (prim, folder)),
        CacheFormat::Usdc | CacheFormat::Usdz | CacheFormat::Usda | CacheFormat::Usd => {
            return open_scene(path, usd::open(source, length, wanted, folder, None), expected_points);
        }
        CacheFormat::Glb | CacheFormat::Gltf => {
            let kind = glb::Source { is_text: format == CacheFormat::Gltf, folder, is_split: false };
            return glb::open_frames(path, (source, length), &kind, expected_points, selection);
        }
        CacheFormat::Fbx => return fbx::open_frames(path, (source, length), expected_points, selection, folder),
        CacheFormat::Abc => return open_scene(path, alembic::open(source, length, wanted, None), expected_points),
    };
    let mut layout = layout.map_err(|fault| fault.at(path))?;
    if format == CacheFormat::Mdd && layout.check(length, expected_points, path).is_ok() {
        // No more than the file holds, as its length is right.
        let mut times = vec![0; 4 * layout.frames as usize];
        source.seek(SeekFrom::Start(mdd::HEADER)).and_then(|_| source.read_exact(&mut times)).map_err(read)?;
        layout.times = mdd::times(&times).map_err(|fault| fault.at(path))?;
    }
    open_layout(path, source, layout, length, expected_points)
}

fn open_scene<'a>(
    path: &Path,
    opened: Result<MovingScene<'a>, Fault>,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    scene::open(path, opened.map_err(|failure| failure.at(path))?, expected_points)
}

/// Opens a cache of `length` bytes whose header was read.
pub(super) fn open_layout<'a>(
    path: &Path,
    source: impl Read + Seek + Send + 'a,
    mut layout: Layout,
    length: u64,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    layout.check(length, expected_points, path)?;
    let Some(rows) = layout.fortran.take() else {
        return scene::open(path, Blocks::new(source, layout), expected_points);
    };
    // All of these are factors of the file's length.
    let (size, frames, rows) = (layout.scalar.size(), layout.frames as usize, rows as usize);
    let columns = layout.order.values() * expected_points / rows;
    let gathered = Transposed::new(source, layout.start, size, [frames, rows, columns]);
    layout.start = 0;
    scene::open(path, Blocks::new(gathered, layout), expected_points)
}
