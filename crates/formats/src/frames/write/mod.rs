//! Frames to files.

mod cache;
mod maya;
mod mesh;
mod morphs;
mod output;
mod scene;
mod sequence;
mod single;
mod textures;

use std::path::{MAIN_SEPARATOR, Path};

use cager_geometry::mesh::Polygons;

use super::CacheFormat;
use super::numbered::NumberedNames;
use super::times::nominal;
use crate::atomic::Target;
use crate::error::{Error, Fault};
use crate::mesh::MeshFormat;
use cache::CacheWriter;
use mesh::FrameMesh;
use morphs::MorphWriter;
use output::Announced;
pub use output::{CageMesh, FrameOptions, FrameWriter, MorphOptions};
use scene::SceneWriter;
use sequence::SequenceWriter;
use single::SingleWriter;
use textures::TextureWriter;

/// The file or folder that [`create_frames`] makes for this path: of a pattern, the folder.
pub fn frames_path(path: &Path) -> &Path {
    let pattern = mesh_pattern(path).is_some() || NumberedNames::of(path).is_some();
    path.parent().filter(|_| pattern).unwrap_or(path)
}

/// Of a name with a place for a number (`FOLDER/NAME.####.obj`) whose files [`create_frames`] puts beside others, whether a file of this path is one of
/// them; `None` of all other outputs.
pub fn names_beside_others(path: &Path) -> Option<impl Fn(&Path) -> bool> {
    let names = NumberedNames::of(path).filter(|_| sequence::shares_folder(path))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().ok();
    Some(move |file: &Path| {
        let is_named = file.file_name().and_then(|name| name.to_str()).is_some_and(|name| names.number(name).is_some());
        is_named && file.parent().and_then(|parent| parent.canonicalize().ok()) == folder
    })
}

/// Whether a name has a place for the number of a frame, and a format that holds all frames in one file, which then has just this name.
pub fn is_numbered_in_vain(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    CacheFormat::from_path(path).is_some()
        && NumberedNames::of(path).is_none()
        && name.and_then(NumberedNames::parse).is_some()
}

fn mesh_pattern(path: &Path) -> Option<&str> {
    path.file_name()?.to_str().filter(|name| matches!(*name, "*.ply" | "*.obj"))
}

/// Begins an output of `frames` frames of `points` points each.
///
/// The extension of `path` says what: `.npy` (frames × points × 3, `<f4`, or `<f8` with an origin), `.pc2`, `.mdd`, `.mcx` and `.mc` with an `.xml` file beside them, or `.abc`, `.usdc`, `.usdz`, `.usd`, `.glb` with `faces`; `.gltf`, which gets its numbers in a `.bin` file beside it. `.vat` becomes a folder of a mesh and the
/// images that move it, as OpenVAT has them. Without an extension, with
/// a `/` at the end, or as an existing folder it becomes a folder of files `frame_0000.obj`, …, each with `faces` and its number;
/// `FOLDER/*.ply` makes them `.ply` files, and `FOLDER/NAME.%04d.obj` or `FOLDER/NAME.####.ply` gives their names.
/// A folder with nothing but such files is replaced as a whole where the target may be; of a `NAME` of one's own, only the files that are written are, and
/// others of such a name are refused. Of one frame, `.obj`, `.ply`, `.off` or `.stl` becomes
/// a mesh file. Standard output gets `.npy`.
///
/// # Errors
/// [`Error::Unsupported`] for other extensions and for more points or frames than a format can count,
/// [`Error::Invalid`] for no points, no frames, faces without their points and a frame rate that is not positive,
/// [`Error::Target`] and [`Error::Io`] where the output cannot be created.
pub fn create_frames(
    target: impl Into<Target>,
    points: usize,
    frames: usize,
    faces: &Polygons,
    options: &FrameOptions,
) -> Result<Box<dyn FrameWriter>, Error> {
    let options = &FrameOptions { fps: nominal(options.fps), ..options.clone() };
    let target = target.into();
    let given = target.path();
    let (path, pattern) = (frames_path(given), mesh_pattern(given));
    let announced = Announced { path: path.to_owned(), points, frames, written: 0 };
    announced.check(options).map_err(|fault| fault.at(path))?;
    let keeps_cages =
        matches!(CacheFormat::from_path(path), Some(CacheFormat::Usdc | CacheFormat::Usdz | CacheFormat::Usd));
    if options.cage.is_some() && (pattern.is_some() || !keeps_cages) {
        return Err(Fault::unsupported("is not written with a cage; write .usdc or .usdz").at(path));
    }
    if target == Target::StandardOutput {
        return Ok(Box::new(CacheWriter::create(announced, &target, CacheFormat::Npy, options)?));
    }
    if let Some(names) = NumberedNames::of(given) {
        check_numbered(&names).map_err(|fault| fault.at(given))?;
        return Ok(Box::new(SequenceWriter::create(announced, &target, faces, names, options)?));
    }
    if pattern.is_none() && path.extension().is_some_and(|found| found.eq_ignore_ascii_case("vat")) {
        return Ok(Box::new(TextureWriter::create(announced, &target, faces, options)?));
    }
    if pattern.is_some() || is_folder(path) {
        let whole = |frame: usize| options.number(frame).abs().trunc().to_string().len();
        let digits = whole(0).max(whole(frames - 1)).max(4);
        let extension = if pattern == Some("*.ply") { ".ply" } else { ".obj" };
        let names = NumberedNames::new("frame_", digits, extension);
        return Ok(Box::new(SequenceWriter::create(announced, &target, faces, names, options)?));
    }
    if let Some(format) = MeshFormat::guess(path).filter(|format| FrameMesh::FORMATS.contains(format)) {
        return Ok(Box::new(SingleWriter::create(announced, &target, format, faces, options)?));
    }
    match CacheFormat::from_path(path) {
        Some(CacheFormat::Glb | CacheFormat::Gltf) => {
            Ok(Box::new(MorphWriter::create(announced, &target, faces, options)?))
        }
        Some(CacheFormat::Usda) => Err(Fault::unsupported("is written in binary alone; end the name in .usdc").at(path)),
        Some(format) if format.is_scene() => {
            Ok(Box::new(SceneWriter::create(announced, &target, format, faces, options)?))
        }
        Some(format) => Ok(Box::new(CacheWriter::create(announced, &target, format, options)?)),
        None => Err(Fault::unsupported(
            "is not a format of frames that is written; end the name in one of .npy .pc2 .mdd .mcx .abc .usdc .usdz .glb .gltf, in / for a folder of .obj files, or of one frame in .obj .ply .off .stl",
        )
        .at(path)),
    }
}

fn check_numbered(names: &NumberedNames) -> Result<(), Fault> {
    if !(names.extension_is("obj") || names.extension_is("ply")) {
        return Err(Fault::unsupported(
            "is not of a mesh format that is written for frames; end the name in .obj or .ply",
        ));
    }
    Ok(())
}

fn is_folder(path: &Path) -> bool {
    let text = path.as_os_str().as_encoded_bytes();
    let separated = text.last().is_some_and(|&end| end == b'/' || char::from(end) == MAIN_SEPARATOR);
    separated || path.extension().is_none() || path.is_dir()
}
