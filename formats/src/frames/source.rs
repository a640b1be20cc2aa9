//! Opening the frames of a capture from a path, folder or pattern.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use super::cache;
use super::numbered::NumberedNames;
use super::sequence::SequenceReader;
use super::{CacheFormat, FrameReader, npz, unknown_extension};
use crate::error::{Error, Fault};
use crate::mesh::{MeshFormat, extensions};
use crate::natural;

/// Opens the frames of a capture whose rest pose has `expected_points` points.
///
/// `source` is a `.npy`, `.pc2` or `.mdd` file, a `.npz` file with one array, one mesh file, a folder of mesh files or a pattern for such
/// files. Folder and glob pattern give the files of one mesh format in natural order, `2.obj` before `10.obj`; other files, and in
/// a folder hidden ones, are passed over. A name with `%04d` or `####` gives the files with a number in its place, in the
/// order of the numbers.
///
/// # Errors
/// [`Error::PointCount`] where a cache has another number of points, [`Error::Damaged`] where its size is not what its
/// header promises, [`Error::Unsupported`] for formats that are not read, and mesh formats mixed in one folder,
/// [`Error::Invalid`] where there is no frame, [`Error::Io`].
pub fn open_frames(source: impl AsRef<Path>, expected_points: usize) -> Result<Box<dyn FrameReader>, Error> {
    let path = source.as_ref();
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => {
            let (files, _) = sort(list(path)?);
            open_sequence(path, files, expected_points)
        }
        Ok(found) if !found.is_file() => Err(Fault::unsupported("is not a regular file; copy it to one").at(path)),
        Ok(found) => open_file(path, found.len(), expected_points),
        Err(cause) => match path.to_str() {
            _ if NumberedNames::of(path).is_some() => open_numbered(path, expected_points),
            Some(pattern) if pattern.contains(['*', '?', '[']) => open_pattern(path, pattern, expected_points),
            _ => Err(Error::read(path, cause)),
        },
    }
}

/// The files that [`open_frames`] reads for `source`; none where it finds none.
pub fn frame_files(source: impl AsRef<Path>) -> Vec<PathBuf> {
    let path = source.as_ref();
    match path.to_str() {
        _ if path.is_dir() => sort(list(path).unwrap_or_default()).0,
        _ if path.exists() => vec![path.to_owned()],
        Some(pattern) if NumberedNames::of(path).is_none() => {
            glob::glob(pattern).into_iter().flatten().flatten().collect()
        }
        _ => numbered_files(path).unwrap_or_default(),
    }
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

/// Opens the frames of a cache file of `length` bytes wherever it lies; `name` is the path in error messages.
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
    cache::open(format, name, source, length, expected_points)
}

fn open_file(path: &Path, length: u64, expected_points: usize) -> Result<Box<dyn FrameReader>, Error> {
    if let Some(format) = CacheFormat::from_path(path) {
        let file = File::open(path).map_err(|cause| Error::read(path, cause))?;
        return cache::open(format, path, file, length, expected_points);
    }
    if path.extension().is_some_and(|found| found.eq_ignore_ascii_case("npz")) {
        let (file, length) = npz::only_array(path)?;
        return cache::open(CacheFormat::Npy, path, file, length, expected_points);
    }
    if MeshFormat::guess(path).is_some() {
        return Ok(Box::new(SequenceReader::new(vec![path.to_owned()], expected_points)));
    }
    Err(unknown_extension(path, true))
}

fn open_pattern(path: &Path, pattern: &str, expected_points: usize) -> Result<Box<dyn FrameReader>, Error> {
    let options = glob::MatchOptions { require_literal_leading_dot: true, ..Default::default() };
    let matches = glob::glob_with(pattern, options)
        .map_err(|cause| Fault::invalid(format!("is not a pattern ({}); correct it", cause.msg)).at(path))?;
    let mut found = Vec::new();
    for path in matches {
        let path = path.map_err(|cause| {
            let path = cause.path().to_owned();
            Error::read(&path, cause.into())
        })?;
        if path.is_file() {
            found.push(path);
        }
    }
    let (files, caches) = sort(found);
    match caches.as_slice() {
        [cache] if files.is_empty() => open_frames(cache, expected_points),
        [_, _, ..] if files.is_empty() => {
            Err(Fault::invalid(format!("matches {} captures; name one of them", caches.len())).at(path))
        }
        _ => open_sequence(path, files, expected_points),
    }
}

fn open_numbered(path: &Path, expected_points: usize) -> Result<Box<dyn FrameReader>, Error> {
    let files = numbered_files(path)?;
    if files.is_empty() {
        let what = "matches no file; the place of the number stands for as many digits or more, filled up with zeros";
        return Err(Fault::invalid(what).at(path));
    }
    open_sequence(path, files, expected_points)
}

/// The files with a number in the place for it, in the order of the numbers.
fn numbered_files(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let number = |file: &PathBuf| NumberedNames::of(path)?.number(file.file_name()?.to_str()?);
    let mut files: Vec<_> = list(folder)?.into_iter().filter_map(|file| Some((number(&file)?, file))).collect();
    files.sort();
    Ok(files.into_iter().map(|(_, file)| file).collect())
}

fn list(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let read = || -> io::Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            let hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
            if !hidden && path.is_file() {
                files.push(path);
            }
        }
        Ok(files)
    };
    read().map_err(|cause| Error::read(folder, cause))
}

/// Mesh files and cache files in natural order.
fn sort(mut files: Vec<PathBuf>) -> (Vec<PathBuf>, Vec<PathBuf>) {
    files.sort_by(|a, b| natural::compare(a.as_os_str().as_encoded_bytes(), b.as_os_str().as_encoded_bytes()));
    files.retain(|path| MeshFormat::guess(path).is_some() || CacheFormat::from_path(path).is_some());
    files.into_iter().partition(|path| MeshFormat::guess(path).is_some())
}

fn open_sequence(source: &Path, files: Vec<PathBuf>, expected_points: usize) -> Result<Box<dyn FrameReader>, Error> {
    let mut counts = BTreeMap::new();
    for format in files.iter().filter_map(|path| MeshFormat::guess(path)) {
        *counts.entry(format.extension()).or_insert(0_usize) += 1;
    }
    match counts.len() {
        0 => Err(Fault::invalid(format!(
            "holds no mesh files; give a folder or pattern of {} files",
            extensions(&MeshFormat::ALL)
        ))
        .at(source)),
        1 => Ok(Box::new(SequenceReader::new(files, expected_points))),
        _ => {
            let list: Vec<_> = counts.iter().map(|(extension, count)| format!("{count} .{extension}")).collect();
            Err(Fault::unsupported(format!(
                "mixes mesh formats ({}); keep one, or pick it with a pattern such as \"*.obj\"",
                list.join(", ")
            ))
            .at(source))
        }
    }
}
