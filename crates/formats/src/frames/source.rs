//! Opening the frames of a capture from a path, folder or pattern.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use super::layout::Layout;
use super::names::{Sequence, is_one_of};
use super::range::RangeReader;
use super::sequence::SequenceReader;
use super::widen::Scalar;
use super::{CacheFormat, FrameReader, FrameSelection, cache, files, single};
use crate::error::{Error, Fault};
use crate::mesh::{MeshFormat, extensions};

/// Opens the frames of a capture whose rest pose has `expected_points` points.
///
/// `source` is a capture in one file, an `.npz` file in which one array fits, one mesh file, or a
/// folder or pattern of mesh files or of any other of these with one frame each. Files are taken in
/// the order of the numbers in their names, `2.obj` before `10.obj` and `1.5.obj` before `2.obj`;
/// other files, and in a folder hidden ones, are passed over. In a pattern every part of the path
/// may be a glob or have `%04d` or `####` in place of a number; what is there by that name is no
/// pattern.
///
/// # Errors
/// [`Error::PointCount`] where a cache has another number of points, [`Error::Damaged`] where its
/// size is not what its header promises, [`Error::Unsupported`] for formats that are not read, and
/// mesh formats mixed in one folder, [`Error::Invalid`] where there is no frame,
/// [`Error::SeveralSequences`], [`Error::Io`].
pub fn open_frames(source: impl AsRef<Path>, expected_points: usize) -> Result<Box<dyn FrameReader>, Error> {
    open_selected_frames(source, expected_points, &FrameSelection::default())
}

/// [`open_frames`], and of what is there only what is selected.
///
/// # Errors
/// Those of [`open_frames`]; a range that goes beyond the frames there.
pub fn open_selected_frames(
    source: impl AsRef<Path>,
    expected_points: usize,
    selection: &FrameSelection,
) -> Result<Box<dyn FrameReader>, Error> {
    let path = source.as_ref();
    let reader = match files::several(path)? {
        Some(found) => open_files(path, found, expected_points, selection)?,
        None => open_file(path, expected_points, selection)?,
    };
    RangeReader::open(reader, selection.range, path)
}

/// The files that [`open_frames`] reads for `source`; none where it finds none.
pub fn frame_files(source: impl AsRef<Path>) -> Vec<PathBuf> {
    let path = source.as_ref();
    let found = match files::several(path) {
        Ok(Some(found)) => found,
        _ if path.exists() => return vec![path.to_owned()],
        _ => Vec::new(),
    };
    let (meshes, others) = by_mesh(found);
    if meshes.is_empty() { captures(&others) } else { meshes }
}

/// Mesh files that are frames of a sequence, in its order.
#[derive(Debug)]
pub struct MeshSequence {
    /// The files.
    pub files: Vec<PathBuf>,
    /// The number of each, where the names tell one.
    pub numbers: Option<Vec<f64>>,
    /// What the user should know of the choice of these files.
    pub notes: Vec<String>,
}

/// The mesh files of a folder or pattern in the order of their numbers, or one file; `no_frames`
/// are left out as in a [`FrameSelection`].
///
/// # Errors
/// As [`open_frames`], where there is no mesh file, or several sequences or formats.
pub fn mesh_sequence(source: impl AsRef<Path>, no_frames: &[PathBuf]) -> Result<MeshSequence, Error> {
    let path = source.as_ref();
    let (meshes, others) = by_mesh(files::several(path)?.unwrap_or_else(|| vec![path.to_owned()]));
    let (files, notes) = without(meshes, no_frames, true);
    if files.is_empty() {
        return Err(no_frames_in(path, &others));
    }
    one_format(&files).map_err(|fault| fault.at(path))?;
    let Sequence { files, numbers } =
        Sequence::of(files).map_err(|what| Error::SeveralSequences { path: path.to_owned(), what })?;
    Ok(MeshSequence { files, numbers, notes })
}

/// The numbers in the names of files, where they tell this order.
pub fn frame_numbers(files: &[PathBuf]) -> Option<Vec<f64>> {
    let sequence = Sequence::of(files.to_vec()).ok()?;
    sequence.numbers.filter(|_| sequence.files == files)
}

/// Opens the frames in the bytes of a cache file; `name` is the path in error messages.
///
/// # Errors
/// As [`open_frames`].
pub fn open_frames_bytes<'a>(
    format: CacheFormat,
    name: &Path,
    bytes: &'a [u8],
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    open_frames_in(format, name, Cursor::new(bytes), bytes.len() as u64, expected_points)
}

/// Opens the frames of a cache file of `length` bytes; `name` is the path in error messages.
///
/// # Errors
/// As [`open_frames`].
pub fn open_frames_in<'a>(
    format: CacheFormat,
    name: &Path,
    source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    cache::open(format, name, source, length, expected_points, &FrameSelection::default(), None)
}

/// Opens `length` bytes of x y z of every point of every frame as little-endian `f32`, with nothing
/// before; `name` is the path in error messages.
///
/// # Errors
/// Another length; no points or frames.
pub fn open_raw_frames<'a>(
    name: &Path,
    source: impl Read + Seek + Send + 'a,
    length: u64,
    points: usize,
    frames: u32,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let layout = Layout::new(points as u64, frames.into(), 0, Scalar::F32Little);
    cache::open_layout(name, source, layout, length, points)
}

fn open_file(path: &Path, expected_points: usize, selection: &FrameSelection) -> Result<Box<dyn FrameReader>, Error> {
    if MeshFormat::guess(path).is_some() && !single::is_animated(path)? {
        let sequence = Sequence::of_all(vec![path.to_owned()]);
        return Ok(Box::new(SequenceReader::new(sequence, expected_points, Vec::new(), selection)));
    }
    single::open_cache(path, expected_points, selection, false)
}

/// Opens what a folder holds or a pattern matches: meshes where there are any, else caches.
fn open_files(
    source: &Path,
    found: Vec<PathBuf>,
    expected_points: usize,
    selection: &FrameSelection,
) -> Result<Box<dyn FrameReader>, Error> {
    let (meshes, others) = by_mesh(found);
    let caches = captures(&others);
    let (frames, notes) = without(meshes, &selection.no_frames, caches.is_empty());
    if let [only] = frames.as_slice()
        && single::is_animated(only)?
    {
        return single::open_cache(only, expected_points, selection, false);
    }
    if !frames.is_empty() {
        one_format(&frames).map_err(|fault| fault.at(source))?;
        return open_sequence(source, frames, notes, expected_points, selection);
    }
    let (caches, notes) = without(caches, &selection.no_frames, true);
    match caches.as_slice() {
        [] => Err(no_frames_in(source, &others)),
        [cache] => single::open_cache(cache, expected_points, selection, false),
        several => {
            if !several.iter().all(|path| single::is_array(path)) {
                check_frames(several, expected_points, selection).map_err(|fault| fault.at(source))?;
            }
            open_sequence(source, caches, notes, expected_points, selection)
        }
    }
}

/// Refuses files that are several captures instead of the frames of one, or may be.
fn check_frames(files: &[PathBuf], points: usize, selection: &FrameSelection) -> Result<(), Fault> {
    let mut files = files.to_vec();
    files.sort();
    let count = files.len();
    if let Some((kinds, most)) = kinds(&files) {
        return Err(Fault::invalid(format!(
            "has {count} captures of several kinds ({kinds}); name one of them, or where each is one frame, pick these \
             with a pattern such as '*.{most}'"
        )));
    }
    let frames = |path: &PathBuf| single::open_cache(path, points, selection, true).ok().map(|found| found.frames());
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    // Files of frames are alike, and there may be thousands.
    if let Some((path, many)) = files.iter().take(2).find_map(|path| Some((path, frames(path).filter(|&n| n > 1)?))) {
        let path = name(path);
        return Err(Fault::invalid(format!(
            "has {count} captures, such as {path} of {many} frames; name one of them, or export one frame to each file"
        )));
    }
    let has_numbers = Sequence::of(files.clone()).map_or(true, |sequence| sequence.numbers.is_some());
    if !has_numbers && !selection.join_sequences {
        return Err(Fault::invalid(format!(
            "has {count} captures of one frame each, such as {} and {}, whose names have no numbers that tell the \
             order; name one of them, number them as the frames of one capture, or take them by name with --all-files",
            name(&files[0]),
            name(&files[1])
        )));
    }
    Ok(())
}

/// Captures among files; scenes, from which others are often exported, where there is nothing else.
fn captures(files: &[PathBuf]) -> Vec<PathBuf> {
    let all = files.iter().filter(|path| single::is_cache(path)).cloned();
    let (scenes, others): (Vec<_>, Vec<_>) =
        all.partition(|path| CacheFormat::from_path(path).is_some_and(CacheFormat::is_scene));
    if others.is_empty() { scenes } else { others }
}

fn open_sequence(
    source: &Path,
    files: Vec<PathBuf>,
    notes: Vec<String>,
    expected_points: usize,
    selection: &FrameSelection,
) -> Result<Box<dyn FrameReader>, Error> {
    let sequence = if selection.join_sequences {
        Sequence::of(files.clone()).unwrap_or_else(|_| Sequence::of_all(files))
    } else {
        Sequence::of(files).map_err(|what| Error::SeveralSequences { path: source.to_owned(), what })?
    };
    Ok(Box::new(SequenceReader::new(sequence, expected_points, notes, selection)))
}

/// Files without the rest pose and the cage, however they are spelled, and what to say of it. One
/// that is called as the others stays, as the first frame often is the rest pose; so does one where
/// there is nothing else.
fn without(files: Vec<PathBuf>, no_frames: &[PathBuf], nothing_else: bool) -> (Vec<PathBuf>, Vec<String>) {
    let excluded: Vec<PathBuf> = no_frames.iter().filter_map(|path| path.canonicalize().ok()).collect();
    let is_excluded = |path: &PathBuf| path.canonicalize().is_ok_and(|found| excluded.contains(&found));
    if excluded.is_empty() {
        return (files, Vec::new());
    }
    let (found, mut frames): (Vec<_>, Vec<_>) = files.into_iter().partition(is_excluded);
    let mut notes = Vec::new();
    let there = frames.clone();
    for file in found {
        if there.is_empty() && nothing_else || is_one_of(&file, &there) {
            frames.push(file);
        } else {
            notes.push(format!(
                "{}: is given as the rest pose or the cage, and is not called as the frames are, so it is no frame",
                file.display()
            ));
        }
    }
    (frames, notes)
}

fn one_format(files: &[PathBuf]) -> Result<(), Fault> {
    let Some((kinds, _)) = kinds(files) else { return Ok(()) };
    Err(Fault::unsupported(format!(
        "mixes mesh formats ({kinds}); keep one, or pick it with a pattern such as \"*.obj\""
    )))
}

/// How many files there are of each extension, and the most frequent, where there are several.
fn kinds(files: &[PathBuf]) -> Option<(String, String)> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for extension in files.iter().filter_map(|path| path.extension()) {
        *counts.entry(extension.to_string_lossy().to_lowercase()).or_default() += 1;
    }
    let list: Vec<_> = counts.iter().map(|(extension, count)| format!("{count} .{extension}")).collect();
    let (most, _) = counts.into_iter().max_by_key(|(_, count)| *count)?;
    (list.len() > 1).then(|| (list.join(", "), most))
}

/// Mesh files, and others.
fn by_mesh(files: Vec<PathBuf>) -> (Vec<PathBuf>, Vec<PathBuf>) {
    files.into_iter().partition(|path| MeshFormat::guess(path).is_some())
}

/// The error of a source without frames, with what may have been meant.
fn no_frames_in(source: &Path, others: &[PathBuf]) -> Error {
    if let Some((file, way_out)) = others.iter().find_map(|file| Some((file, single::way_out(file)?))) {
        return Fault::unsupported(way_out).at(file);
    }
    if let Some(capture) = others.iter().find(|path| single::is_cache(path)) {
        let what = "is a capture whose points correspond already, so encode it with cager encode; for surfaces give a \
                    folder or pattern of mesh files";
        return Fault::unsupported(what).at(capture);
    }
    let folders = fs::read_dir(source).into_iter().flatten().flatten().map(|entry| entry.path());
    let inner = folders.filter(|path| path.is_dir()).take(32).find_map(|folder| {
        let files = files::in_folder(&folder).ok()?;
        files.into_iter().find(|file| MeshFormat::guess(file).is_some())
    });
    let cure = match inner.as_ref().and_then(|file| file.extension()) {
        Some(extension) => format!(
            "for one file in each of its folders give the pattern '{}'",
            source.join("*").join(format!("*.{}", extension.display())).display()
        ),
        None => format!("give a folder or pattern of {} files", extensions(&MeshFormat::STILL)),
    };
    Fault::invalid(format!("holds no mesh files; {cure}")).at(source)
}
