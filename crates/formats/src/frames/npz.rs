//! NumPy's archives: a zip file with one `.npy` file for each array.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
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

/// Opens the array of an archive that can be frames of so many points: the one that `prim` names,
/// or the only one. `is_frame` where the archive is one of many, each of which has a frame.
pub(super) fn open(
    path: &Path,
    expected_points: usize,
    prim: Option<&str>,
    is_frame: bool,
) -> Result<Box<dyn FrameReader>, Error> {
    let (file, Array { entry, layout, .. }) = find(path, expected_points, prim, is_frame)?;
    let layout = layout.map_err(|fault| fault.at(path))?;
    let unpacked = Unpacked::new(&file, &entry).map_err(|cause| Error::read(path, cause))?;
    cache::open_layout(path, unpacked, layout, entry.length, expected_points)
}

/// The name of the array that is read of a file of one frame, where it can be read.
pub(super) fn array_read(path: &Path, expected_points: usize) -> Option<String> {
    let (_, found) = find(path, expected_points, None, true).ok()?;
    found.layout.is_ok().then_some(found.name)
}

/// An array of an archive, and whether frames can be read from it.
struct Array {
    name: String,
    entry: Entry,
    described: String,
    /// Whether it has an axis of frames.
    has_frames: bool,
    layout: Result<Layout, Fault>,
}

fn find(path: &Path, expected_points: usize, prim: Option<&str>, is_frame: bool) -> Result<(File, Array), Error> {
    let read = |cause| Error::read(path, cause);
    let file = File::open(path).map_err(read)?;
    let mut start = Vec::new();
    (&file).take(1024).read_to_end(&mut start).map_err(read)?;
    if let Some(what) = Signature::other_than("npz", &start) {
        return Err(Fault::damaged(what).at(path));
    }
    let mut archive = ZipArchive::new(BufReader::new(&file)).map_err(|cause| failed(path, cause))?;
    let (entries, unreadable) = list(path, &mut archive, file.metadata().map_err(read)?.len())?;
    let (mut found, mut fps) = (Vec::new(), None);
    for (name, entry) in entries {
        let head = Unpacked::new(&file, &entry).and_then(|mut unpacked| beginning(&mut unpacked)).map_err(read)?;
        if RATES.iter().any(|rate| name.eq_ignore_ascii_case(rate)) {
            fps = npy::single_number(&head).filter(|rate| rate.is_finite() && *rate > 0.0).map(nominal);
        }
        let layout = npy::layout(&head, expected_points as u64, Place { name: Some(&name) });
        let (described, has_frames) = (npy::described(&head), npy::axes_count(&head) > 2);
        found.push(Array { name, entry, described, has_frames, layout });
    }
    let count = found.len();
    let unreadable = unreadable.as_ref();
    let mut array =
        chosen(found, unreadable, expected_points as u64, prim, is_frame).map_err(|fault| fault.at(path))?;
    if let Ok(layout) = &mut array.layout {
        layout.times.frame_rate = fps;
        // The only one is taken whatever it is called, as the only mesh is.
        let other = prim.filter(|prim| *prim != array.name && count > 1);
        layout.times.note = other.map(|prim| format!("has no array {prim:?}; {:?} is read", array.name));
    }
    Ok((file, array))
}

/// Whether a file is an archive that has an array of this name.
pub(super) fn holds(path: &Path, name: &str) -> bool {
    let archive = File::open(path).ok().and_then(|file| ZipArchive::new(BufReader::new(file)).ok());
    archive.is_some_and(|archive| archive.index_for_name(&format!("{name}.npy")).is_some())
}

/// An array that is packed in a way that is not read, and which.
type Unreadable = (String, &'static str);

/// The array that is named, or the only one that fits, or the only one of them with several frames.
fn chosen(
    mut found: Vec<Array>,
    unreadable: Option<&Unreadable>,
    points: u64,
    prim: Option<&str>,
    is_frame: bool,
) -> Result<Array, Fault> {
    if let Some(place) = found.iter().position(|array| Some(array.name.as_str()) == prim) {
        return Ok(found.swap_remove(place));
    }
    let frames = |array: &Array| array.layout.as_ref().map_or(0, |layout| layout.frames);
    let fits = |array: &Array| array.layout.as_ref().is_ok_and(|layout| layout.points == points);
    let only = |wanted: &dyn Fn(&Array) -> bool| {
        let mut places = found.iter().enumerate().filter(|(_, array)| wanted(array)).map(|(place, _)| place);
        places.next().filter(|_| places.next().is_none())
    };
    let moving = |array: &Array| fits(array) && frames(array) > 1;
    let framed = |array: &Array| fits(array) && array.has_frames;
    // What is wrong with the only one that could be meant is said by whoever reads it.
    let meant = || {
        let readable = || only(&|array| frames(array) > 0);
        (unreadable.is_none() && !found.iter().any(fits)).then(|| only(&|_| true).or_else(readable)).flatten()
    };
    if let Some(place) = only(&fits).or_else(|| only(&moving)).or_else(|| only(&framed)).or_else(meant) {
        return Ok(found.swap_remove(place));
    }
    let file = "numpy.load(path)";
    let names: Vec<&str> = found.iter().filter(|array| fits(array)).map(|array| array.name.as_str()).collect();
    let what = if let (Some((name, method)), true) = (unreadable, names.is_empty()) {
        format!(
            "{name:?} is packed with {method}, which is not unpacked here; pack it again in Python with \
             numpy.savez_compressed(\"converted.npz\", **{file})"
        )
    } else if found.is_empty() {
        "has no arrays; save the frames with numpy.save".to_owned()
    } else if found.iter().any(moving) {
        let moving: Vec<&str> = found.iter().filter(|array| moving(array)).map(|array| array.name.as_str()).collect();
        format!(
            "has {} arrays that can be the frames ({}); {}",
            moving.len(),
            listed(moving.iter().map(|name| (*name).to_owned())),
            named(moving[0])
        )
    } else if names.len() > 1 {
        // Arrays such as `arr_0`, `arr_1` are frames; a posed body and a canonical one are not.
        let join = if !is_frame && numbers::of_names(&names).is_some() {
            format!(
                ", or join them in Python with a = {file}; numpy.save(\"converted.npy\", [a[k] for k in \
                 sorted(a.files, key=lambda k: (len(k), k)) if a[k].shape == a[{:?}].shape])",
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
            "has {} arrays ({}), and none of them is frames of {points} points as 32- or 64-bit floats; save the \
             frames alone with numpy.save",
            found.len(),
            listed(all)
        )
    };
    let gone = prim.filter(|_| unreadable.is_none()).map(|prim| format!("has no array {prim:?}, and "));
    Err(Fault::unsupported(gone.unwrap_or_default() + &what))
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

/// Readable arrays by name, and the first other one.
type Listed = (Vec<(String, Entry)>, Option<Unreadable>);

/// The arrays of an archive of `length` bytes by name, and the first that is not readable.
fn list<R: Read + Seek>(path: &Path, archive: &mut ZipArchive<R>, length: u64) -> Result<Listed, Error> {
    let (mut readable, mut unreadable) = (Vec::new(), None);
    if archive.len() > MAX_ARRAYS {
        let what = format!("has {} arrays, more than {MAX_ARRAYS}; save the frames as one array", archive.len());
        return Err(Fault::unsupported(what).at(path));
    }
    for index in 0..archive.len() {
        let file = archive.by_index_raw(index).map_err(|cause| failed(path, cause))?;
        let name = file.name().map_err(|cause| failed(path, cause))?.into_owned();
        let Some(name) = name.strip_suffix(".npy") else { continue };
        let method = match file.compression() {
            _ if file.encrypted() => "encryption",
            CompressionMethod::Stored | CompressionMethod::Deflated => "",
            CompressionMethod::LZMA => "LZMA",
            CompressionMethod::BZIP2 => "bzip2",
            CompressionMethod::ZSTD => "Zstandard",
            _ => "a rare method",
        };
        if !method.is_empty() {
            unreadable.get_or_insert((name.to_owned(), method));
            continue;
        }
        let (packed, deflated) = (file.compressed_size(), file.compression() == CompressionMethod::Deflated);
        let most = if deflated { packed.saturating_mul(MAX_DEFLATE_RATIO) } else { packed };
        let start = file.data_start().filter(|start| start.checked_add(packed).is_some_and(|end| end <= length));
        let Some(start) = start.filter(|_| file.size() <= most) else {
            let what = format!(
                "announces {} bytes for {name:?}, more than the {packed} bytes in which it is packed can hold; copy \
                 the file again",
                file.size()
            );
            return Err(Fault::damaged(what).at(path));
        };
        let (path, length, checksum) = (path.to_owned(), file.size(), file.crc32());
        readable.push((name.to_owned(), Entry { path, start, packed, length, checksum, deflated }));
    }
    Ok((readable, unreadable))
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
