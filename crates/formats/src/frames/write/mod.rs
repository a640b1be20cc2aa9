//! Frames to files.

mod cache;
mod collected;
mod maya;
mod mesh;
mod morphs;
mod output;
mod scene;
mod sequence;
mod single;
mod textures;

use std::ffi::OsStr;
use std::path::{MAIN_SEPARATOR, Path};

use cager_geometry::mesh::Polygons;

use super::CacheFormat;
use super::numbered::NumberedNames;
use super::times::nominal;
use crate::atomic::Target;
use crate::dropped::sequences_phrase;
use crate::error::{Error, Fault};
use crate::mesh::MeshFormat;
use crate::pictures::Beside;
use cache::CacheWriter;
use mesh::FrameMesh;
use morphs::MorphWriter;
use output::{Announced, Output};
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

/// Of a numbered name (`FOLDER/NAME.####.obj`) whose files [`create_frames`] puts beside others,
/// which files those are; `None` of all other outputs.
pub fn names_beside_others(path: &Path) -> Option<impl Fn(&Path) -> bool> {
    let names = NumberedNames::of(path).filter(|_| sequence::shares_folder(path))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().ok();
    Some(move |file: &Path| {
        let is_named = file.file_name().and_then(|name| name.to_str()).is_some_and(|name| names.number(name).is_some());
        is_named && file.parent().and_then(|parent| parent.canonicalize().ok()) == folder
    })
}

/// Whether a numbered name is of a format that holds all frames in one file of just this name.
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
/// The extension of the path says what: a file of all frames, where scenes (`.abc`, `.usdc`,
/// `.glb`, …) get the `faces`, `.mcx`, `.mc` and `.gltf` a second file beside them, and `.npy`
/// double precision with an origin; `.vat` a folder of a mesh and the images that move it, as
/// OpenVAT has them. Without an extension, with a `/` at the end, or as an existing folder it
/// becomes a folder of files `frame_0000.obj`, …; `FOLDER/*.ply` makes them `.ply` files, and
/// `FOLDER/NAME.%04d.obj` or `FOLDER/NAME.####.ply` names them. A folder with nothing but such
/// files is replaced as a whole where the target may be; beside other files only those that are
/// written are. Of one frame, `.obj`, `.ply`, `.off` or `.stl` becomes a mesh file. Standard output
/// gets `.npy`.
///
/// # Errors
/// [`Error::Unsupported`] for other extensions and for more points or frames than a format can
/// count, [`Error::Invalid`] for no points, no frames, faces without their points and a frame rate
/// that is not positive, [`Error::Target`] and [`Error::Io`] where the output cannot be created.
pub fn create_frames(
    target: impl Into<Target>,
    points: usize,
    frames: usize,
    faces: &Polygons,
    options: &FrameOptions,
) -> Result<FrameWriter, Error> {
    let options = &FrameOptions { fps: nominal(options.fps), ..options.clone() };
    let target = &target.into();
    let given = target.path();
    let (path, pattern) = (frames_path(given), mesh_pattern(given));
    let all = Announced { path: path.to_owned(), points, frames, written: 0 };
    all.check(options).map_err(|fault| fault.at(path))?;
    let keeps_cages =
        matches!(CacheFormat::from_path(path), Some(CacheFormat::Usdc | CacheFormat::Usdz | CacheFormat::Usd));
    if options.cage.is_some() && (pattern.is_some() || !keeps_cages) {
        return Err(Fault::unsupported("is not written with a cage; write .usdc or .usdz").at(path));
    }
    let is_layer = matches!(CacheFormat::from_path(path), Some(CacheFormat::Usdc | CacheFormat::Usd));
    if let Some(source) = options.onto.as_ref().filter(|_| !is_layer || options.cage.is_some()) {
        let what = format!(
            "is not written onto {}; end the name in .usdc, without a cage (.abc and others have the paths of the \
             source as they are)",
            source.display()
        );
        return Err(Fault::unsupported(what).at(path));
    }
    let (mut surface, mut lost) = (options.surface.clone(), None);
    if !keeps_sequences(given) {
        lost = sequences_phrase(&surface).filter(|_| names_pictures(target));
        surface.keep_first_pictures();
    }
    let beside =
        (names_pictures(target) && options.onto.is_none()).then(|| Beside::of(&mut surface, target, is_folder(path)));
    beside.as_ref().map_or(Ok(()), Beside::check)?;
    let output = begin(&all, target, faces, &FrameOptions { surface, ..options.clone() })?;
    Ok(FrameWriter::new(all, output, (&options.surface, lost), beside))
}

/// Whether an output has a place for other pictures in other frames.
fn keeps_sequences(path: &Path) -> bool {
    let ends_in = |other: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(other));
    match CacheFormat::from_path(path) {
        Some(format) => matches!(format, CacheFormat::Usdc | CacheFormat::Usdz | CacheFormat::Usd),
        None => !ends_in("ply") && !ends_in("vat"),
    }
}

/// Whether the files of an output name pictures, and do not hold them.
fn names_pictures(target: &Target) -> bool {
    let path = target.path();
    let is_named = match CacheFormat::from_path(path) {
        Some(format) => matches!(format, CacheFormat::Usdc | CacheFormat::Usd | CacheFormat::Gltf | CacheFormat::Glb),
        None => {
            let extension = path.extension().map(OsStr::to_ascii_lowercase).filter(|_| !is_folder(path));
            extension.is_none_or(|found| found == "obj" || found == "ply")
        }
    };
    is_named && *target != Target::StandardOutput
}

fn begin(all: &Announced, target: &Target, faces: &Polygons, options: &FrameOptions) -> Result<Box<dyn Output>, Error> {
    let given = target.path();
    // FBX is read alone.
    let cache = CacheFormat::from_path(&all.path).filter(|&format| format != CacheFormat::Fbx);
    let (path, pattern) = (&all.path, mesh_pattern(given));
    if *target == Target::StandardOutput {
        return Ok(Box::new(CacheWriter::create(all, target, CacheFormat::Npy, options)?));
    }
    if let Some(names) = NumberedNames::of(given) {
        if !(names.extension_is("obj") || names.extension_is("ply")) {
            let what = "is not of a mesh format that is written for frames; end the name in .obj or .ply";
            return Err(Fault::unsupported(what).at(given));
        }
        return Ok(Box::new(SequenceWriter::create(all, target, faces, names, options)?));
    }
    if pattern.is_none() && path.extension().is_some_and(|found| found.eq_ignore_ascii_case("vat")) {
        return Ok(Box::new(TextureWriter::create(all, target, faces, options)?));
    }
    if pattern.is_some() || is_folder(path) {
        let whole = |frame: usize| options.number(frame).abs().trunc().to_string().len();
        let digits = whole(0).max(whole(all.frames - 1)).max(4);
        let extension = if pattern == Some("*.ply") { ".ply" } else { ".obj" };
        let names = NumberedNames::new("frame_", digits, extension);
        return Ok(Box::new(SequenceWriter::create(all, target, faces, names, options)?));
    }
    if let Some(format) = MeshFormat::guess(path).filter(|format| FrameMesh::FORMATS.contains(format)) {
        return Ok(Box::new(SingleWriter::create(all, target, format, faces, options)?));
    }
    Ok(match cache {
        Some(CacheFormat::Glb | CacheFormat::Gltf) => Box::new(MorphWriter::create(all, target, faces, options)?),
        Some(CacheFormat::Usda) => {
            return Err(Fault::unsupported("is written in binary alone; end the name in .usdc").at(path));
        }
        Some(format) if format.is_scene() => Box::new(SceneWriter::create(all, target, format, faces, options)?),
        Some(format) => Box::new(CacheWriter::create(all, target, format, options)?),
        None => return Err(Fault::unsupported(
            "is not a format of frames that is written; end the name in one of .npy .pc2 .mdd .mcx .abc .usdc .usdz \
             .glb .gltf, in / for a folder of .obj files, or of one frame in .obj .ply .off .stl",
        )
        .at(path)),
    })
}

fn is_folder(path: &Path) -> bool {
    let text = path.as_os_str().as_encoded_bytes();
    let separated = text.last().is_some_and(|&end| end == b'/' || char::from(end) == MAIN_SEPARATOR);
    separated || path.extension().is_none() || path.is_dir()
}
