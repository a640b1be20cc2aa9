//! A capture with all frames in one file.

use std::fs::{self, File};
use std::path::Path;

use super::{CacheFormat, FrameReader, FrameSelection, cache, maya, npz};
use crate::error::{Error, Fault};
use crate::glb;
use crate::mesh::{MeshFormat, extensions};

/// Whether the name is that of a point cache or an archive of arrays.
pub(super) fn is_cache(path: &Path) -> bool {
    CacheFormat::from_path(path).is_some() || is_archive(path)
}

/// Whether the name is that of NumPy's arrays, of which each may be a frame.
pub(super) fn is_array(path: &Path) -> bool {
    CacheFormat::from_path(path) == Some(CacheFormat::Npy) || is_archive(path)
}

fn is_archive(path: &Path) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case("npz"))
}

/// Whether a mesh file has an animation, whose frames are those of a capture; others are one frame.
pub(super) fn is_animated(path: &Path) -> Result<bool, Error> {
    if MeshFormat::guess(path) != Some(MeshFormat::Glb) {
        return Ok(false);
    }
    Ok(glb::is_animated(&fs::read(path).map_err(|cause| Error::read(path, cause))?))
}

/// Opens a capture in one file; `is_frame` where it is one of many files of a frame each.
pub(super) fn open_cache(
    path: &Path,
    expected_points: usize,
    selection: &FrameSelection,
    is_frame: bool,
) -> Result<Box<dyn FrameReader>, Error> {
    if is_archive(path) {
        return npz::open(path, expected_points, selection.prim(), is_frame);
    }
    let Some(format) = CacheFormat::from_path(path) else { return Err(unknown(path)) };
    let read = |cause| Error::read(path, cause);
    let file = File::open(path).map_err(read)?;
    let length = file.metadata().map_err(read)?.len();
    cache::open(format, path, file, length, expected_points, selection, path.parent())
}

/// A file that is not read, and how its contents can come here.
pub(super) fn unknown(path: &Path) -> Error {
    let what = match way_out(path) {
        Some(way_out) => way_out,
        None => format!(
            "is not a capture that is read; give .npy .pc2 .mdd .mcx .abc .usdc .usdz .glb .fbx .npz, or {} files in a \
             folder",
            extensions(&MeshFormat::STILL)
        ),
    };
    Fault::unsupported(what).at(path)
}

/// How to get at the frames of a scene of another program.
pub(super) fn way_out(path: &Path) -> Option<String> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    if extension == "xml" && maya::is_description(path) {
        let pattern = path.with_extension("").display().to_string() + "*.mcx";
        return Some(format!(
            "describes a cache of Maya; give the .mcx or .mc file beside it, or the pattern '{pattern}'"
        ));
    }
    let kind = match extension.as_str() {
        "dae" => "a Collada scene",
        "blend" => "a Blender scene",
        "ma" | "mb" => "a Maya scene",
        "max" => "a 3ds Max scene",
        "c4d" => "a Cinema 4D scene",
        "bgeo" | "geo" | "hip" | "hipnc" | "hiplc" => "Houdini's own format",
        "bvh" => "the motion of a skeleton",
        _ => return None,
    };
    Some(format!(
        "is {kind}, which is not read; export the animated mesh as Alembic, USD or a point cache, .abc, .usdc, .pc2 or \
         .mdd, or open it in Blender and encode it there with the extension of docs/BLENDER.md"
    ))
}
