//! NumPy's archives: a zip file with one `.npy` file for each array.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::FrameReader;
use super::cache;
use super::layout::Layout;
use super::npy::{self, Place};
use super::numbers;
use super::packed::{Entry, Unpacked};
use super::times::nominal;
use crate::error::{Error, Fault};
use crate::signature::Signature;

/// What the arrays are called that tell how many frames a second has.
const RATES: [&str; 6] = ["fps", "framerate", "frame_rate", "frames_per_second", "mocap_framerate", "mocap_frame_rate"];

/// Arrays that are looked at; no archive of frames has more beside them.
const MAX_ARRAYS: usize = 4096;

/// Deflate packs no more bytes than these into one; what announces more is no archive.
const MAX_DEFLATE_RATIO: u64 = 1032;

/// Opens the array of an archive that can be frames of so many points, as it is packed: the one that `prim` names, or the only one. `is_frame` where
/// the archive is one of many, each of which has a frame.
pub(super) fn open<'a>(
    path: &Path,
    source: impl Read + Seek + Send + 'a,
    expected_points: usize,
    prim: Option<&str>,
    is_frame: bool,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let (source, found) = find(path, source, expected_points, prim, is_frame)?;
    let unpacked = Unpacked::new(source, &found.entry).map_err(|cause| Error::read(path, cause))?;
    cache::open_layout(path, unpacked, found.layout, found.entry.length, expected_points)
}

/// What the array of a file of one frame is called that is read where none is named; none of what is no archive, or cannot be read.
pub(super) fn array_read(path: &Path, expected_points: usize) -> Option<String> {
    let source = BufReader::new(File::open(path).ok()?);
    find(path, source, expected_points, None, true).ok().map(|(_, found)| found.name)
}

/// The array that is read.
struct Found {
    name: String,
    entry: Entry,
    layout: Layout,
}

fn find<R: Read + Seek>(
    path: &Path,
    mut source: R,
    expected_points: usize,
    prim: Option<&str>,
    is_frame: bool,
) -> Result<(R, Found), Error> {
    let length = source.seek(SeekFrom::End(0)).map_err(|cause| Error::read(path, cause))?;
    let mut start = Vec::new();
    source
        .rewind()
        .and_then(|()| source.by_ref().take(1024).read_to_end(&mut start))
        .map_err(|cause| Error::read(path, cause))?;
    if let Some(what) = Signature::other_than("npz", &start) {
        return Err(Fault::damaged(what).at(path));
    }
    let mut archive = ZipArchive::new(source).map_err(|cause| failed(path, cause))?;
    let arrays = Arrays::list(path, &mut archive, length)?;
    let mut source = archive.into_inner();
    let (mut found, mut fps) = (Vec::new(), None);
    for (name, entry) in &arrays.readable {
        let read = |cause| Error::read(path, cause);
        let mut unpacked = Unpacked::new(source, entry).map_err(read)?;
        let head = beginning(&mut unpacked).map_err(read)?;
        if RATES.iter().any(|rate| name.eq_ignore_ascii_case(rate)) {
            fps = npy::single_number(&head).filter(|rate| rate.is_finite() && *rate > 0.0).map(nominal);
        }
        let layout = npy::layout(&head, expected_points as u64, Place { name: Some(name) });
        found.push(Array {
            name,
            entry,
            described: npy::described(&head),
            has_frames: npy::axes_count(&head) > 2,
            layout,
        });
        let Some(back) = unpacked.into_inner() else { return Err(Fault::damaged("cannot be read").at(path)) };
        source = back;
    }
    let wanted = Wanted { points: expected_points as u64, prim, is_frame };
    let count = found.len();
    let Array { name, entry, layout, .. } = chosen(found, &arrays, &wanted, path)?;
    let mut layout = layout.map_err(|fault| fault.at(path))?;
    layout.times.frame_rate = fps;
    // The only one is taken whatever it is called, as the only mesh is.
    if let Some(prim) = prim.filter(|prim| *prim != name && count > 1) {
        layout.times.note = Some(format!("has no array {prim:?}; {name:?} is read"));
    }
    Ok((source, Found { name: name.to_owned(), entry: entry.clone(), layout }))
}

/// Whether a file is an archive that has an array of this name.
pub(super) fn holds(path: &Path, name: &str) -> bool {
    let archive = File::open(path).ok().and_then(|file| ZipArchive::new(BufReader::new(file)).ok());
    archive.is_some_and(|archive| archive.index_for_name(&format!("{name}.npy")).is_some())
}

/// An array of an archive, and whether frames can be read from it.
struct Array<'a> {
    name: &'a str,
    entry: &'a Entry,
    described: String,
    /// Whether it has an axis of frames.
    has_frames: bool,
    layout: Result<Layout, Fault>,
}

/// What an archive is opened for.
struct Wanted<'a> {
    points: u64,
    prim: Option<&'a str>,
    is_frame: bool,
}

/// The array that is named, or the only one that fits, or the only one of several frames among those that do.
fn chosen<'a>(
    mut found: Vec<Array<'a>>,
    arrays: &Arrays,
    wanted: &Wanted<'_>,
    path: &Path,
) -> Result<Array<'a>, Error> {
    let points = wanted.points;
    if let Some(place) = found.iter().position(|array| Some(array.name) == wanted.prim) {
        return Ok(found.swap_remove(place));
    }
    let frames = |array: &Array<'_>| array.layout.as_ref().map_or(0, |layout| layout.frames);
    let fits = |array: &Array<'_>| array.layout.as_ref().is_ok_and(|layout| layout.points == points);
    let only = |wanted: &dyn Fn(&Array<'_>) -> bool| {
        let mut places = found.iter().enumerate().filter(|(_, array)| wanted(array)).map(|(place, _)| place);
        places.next().filter(|_| places.next().is_none())
    };
    let moving = |array: &Array<'_>| fits(array) && frames(array) > 1;
    let framed = |array: &Array<'_>| fits(array) && array.has_frames;
    // What is wrong with the only one that could be meant is said by whoever reads it.
    let meant = || {
        let readable = || only(&|array| frames(array) > 0);
        (arrays.unreadable.is_none() && !found.iter().any(fits)).then(|| only(&|_| true).or_else(readable)).flatten()
    };
    if let Some(place) = only(&fits).or_else(|| only(&moving)).or_else(|| only(&framed)).or_else(meant) {
        return Ok(found.swap_remove(place));
    }
    let file = "numpy.load(path)";
    let names: Vec<&str> = found.iter().filter(|array| fits(array)).map(|array| array.name).collect();
    let what = if let (Some((name, method)), true) = (&arrays.unreadable, names.is_empty()) {
        format!(
            "{name:?} is packed with {method}, which is not unpacked here; pack it again in Python with numpy.savez_compressed(\"converted.npz\", **{file})"
        )
    } else if found.is_empty() {
        "has no arrays; save the frames with numpy.save".to_owned()
    } else if found.iter().any(moving) {
        let moving: Vec<&str> = found.iter().filter(|array| moving(array)).map(|array| array.name).collect();
        format!(
            "has {} arrays that can be the frames ({}); {}",
            moving.len(),
            listed(moving.iter().map(|name| (*name).to_owned())),
            named(moving[0])
        )
    } else if names.len() > 1 {
        // Arrays such as `arr_0`, `arr_1` are the frames of one capture; a posed body and a canonical one are not.
        let join = if !wanted.is_frame && numbers::of_names(&names).is_some() {
            format!(
                ", or join them in Python with a = {file}; numpy.save(\"converted.npy\", [a[k] for k in sorted(a.files, key=lambda k: (len(k), k)) if a[k].shape == a[{:?}].shape])",
                names[0]
            )
        } else {
            String::new()
        };
        format!(
            "has {} arrays of one frame each ({}); {}{join}",
            names.len(),
            listed(names.iter().map(|name| (*name).to_owned())),
            named(names[0])
        )
    } else {
        let all = found.iter().map(|array| format!("{}: {}", array.name, array.described));
        format!(
            "has {} arrays ({}), and none of them is frames of {points} points as 32- or 64-bit floats; save the frames alone with numpy.save",
            found.len(),
            listed(all)
        )
    };
    let gone = wanted
        .prim
        .filter(|_| arrays.unreadable.is_none())
        .map_or_else(String::new, |prim| format!("has no array {prim:?}, and "));
    Err(Fault::unsupported(gone + &what).at(path))
}

/// How one of several arrays is taken.
fn named(name: &str) -> String {
    // Names of arrays are any text.
    let is_plain = name.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-./".contains(&b));
    let shown = if is_plain { name.to_owned() } else { format!("{name:?}") };
    format!("name the one that is meant, as with --prim {shown}, where the command has it")
}

fn listed(names: impl ExactSizeIterator<Item = String>) -> String {
    const LISTED: usize = 6;
    let more = names.len() > LISTED;
    let mut list: Vec<String> = names.take(LISTED).collect();
    if more {
        list.push("…".to_owned());
    }
    list.join(", ")
}

/// The arrays of an archive by name.
struct Arrays {
    readable: Vec<(String, Entry)>,
    /// The first that is packed in a way that is not read, and which.
    unreadable: Option<(String, &'static str)>,
}

impl Arrays {
    /// The arrays of an archive of `length` bytes.
    fn list<R: Read + Seek>(path: &Path, archive: &mut ZipArchive<R>, length: u64) -> Result<Self, Error> {
        let mut arrays = Self { readable: Vec::new(), unreadable: None };
        if archive.len() > MAX_ARRAYS {
            let what = format!("has {} arrays, more than {MAX_ARRAYS}; save the frames as one array", archive.len());
            return Err(Fault::unsupported(what).at(path));
        }
        for index in 0..archive.len() {
            let file = archive.by_index_raw(index).map_err(|cause| failed(path, cause))?;
            let name = file.name().map_err(|cause| failed(path, cause))?.into_owned();
            let Some(name) = name.strip_suffix(".npy") else { continue };
            let deflated = match file.compression() {
                _ if file.encrypted() => Err("encryption"),
                CompressionMethod::Stored => Ok(false),
                CompressionMethod::Deflated => Ok(true),
                CompressionMethod::LZMA => Err("LZMA"),
                CompressionMethod::BZIP2 => Err("bzip2"),
                CompressionMethod::ZSTD => Err("Zstandard"),
                _ => Err("a rare method"),
            };
            let deflated = match deflated {
                Ok(deflated) => deflated,
                Err(method) => {
                    arrays.unreadable.get_or_insert((name.to_owned(), method));
                    continue;
                }
            };
            let packed = file.compressed_size();
            let most = if deflated { packed.saturating_mul(MAX_DEFLATE_RATIO) } else { packed };
            let start = file.data_start().filter(|start| start.checked_add(packed).is_some_and(|end| end <= length));
            let Some(start) = start.filter(|_| file.size() <= most) else {
                let what = format!(
                    "announces {} bytes for {name:?}, more than the {packed} bytes in which it is packed can hold; copy the file again",
                    file.size()
                );
                return Err(Fault::damaged(what).at(path));
            };
            let (path, length, checksum) = (path.to_owned(), file.size(), file.crc32());
            arrays.readable.push((name.to_owned(), Entry { path, start, packed, length, checksum, deflated }));
        }
        Ok(arrays)
    }
}

/// As much of an array's file as says what it is; all of it where that is a single number.
fn beginning(file: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    file.take(12).read_to_end(&mut head)?;
    if let Ok((start, length)) = npy::header_bounds(&head) {
        // Eight bytes are the longest number.
        let wanted = (start + length + 8).saturating_sub(head.len());
        file.take(wanted as u64).read_to_end(&mut head)?;
    }
    Ok(head)
}

fn failed(path: &Path, cause: ZipError) -> Error {
    match cause {
        ZipError::Io(cause) if cause.kind() != io::ErrorKind::UnexpectedEof => Error::read(path, cause),
        cause => {
            let what =
                format!("cannot be unpacked ({cause}); copy the file again, or save its arrays again with numpy.savez");
            Fault::damaged(what).at(path)
        }
    }
}
