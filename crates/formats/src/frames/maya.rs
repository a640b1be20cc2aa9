//! Maya's geometry cache in one file, `.mcx` or the older `.mc`: a header, then a block for each
//! frame with its time in ticks and the arrays of its channels, all big-endian. Chunks of `.mcx`
//! count their bytes in 64 bits and end at multiples of eight. The text beside it says how long a
//! frame is. Maya's default is a file for each frame, `walkFrame12.mcx`, whose header has the time.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::FrameReader;
use super::block::Blocks;
use super::layout::Layout;
use super::numbers;
use super::times::{Times, near_whole};
use super::widen::Scalar;
use crate::error::{Error, Fault};
use crate::scene::{self, shown};

/// Ticks of a second.
pub(super) const TICKS: f64 = 6000.0;
/// Before the exact frame rate, in the text beside a cache of this library.
pub(super) const EXACT_RATE: &str = "<extra>frames per second ";
/// Frames per second where no text says them.
const USUAL: f64 = 24.0;
/// Bytes of the text beside a cache that are looked at, and of the name of a channel.
const MOST_TEXT: u64 = 1 << 16;
const MOST_NAME: u64 = 1 << 10;
/// Most channels of a block.
const MOST_CHANNELS: usize = 1 << 12;
/// Channels that a message lists.
const LISTED: usize = 4;

/// Opens the frames of a channel in a file of `length` bytes; `prim` names one of several.
pub(super) fn open<'a>(
    path: &Path,
    source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
    (prim, folder): (Option<&str>, Option<&Path>),
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let told = folder.and_then(|_| frame_rate(path));
    let found = Chunks::open(source, length)
        .and_then(|mut chunks| Ok((layout(&mut chunks, length, prim, told)?, chunks.source)));
    let ((mut layout, is_one_frame), source) = found.map_err(|failure| failure.at(path))?;
    if let Some((base, _)) = FrameName::of(path).filter(|_| is_one_frame) {
        let all = path.with_file_name(base + "Frame*").with_extension(path.extension().unwrap_or_default());
        let what = format!(
            "it is one frame of a cache with a file for each; for all of them give the pattern '{}'",
            all.display()
        );
        layout.times.note = Some(what);
    }
    scene::open(path, Blocks::new(source, layout), expected_points)
}

/// The numbers of the files of one cache that has a file for each frame, by their names.
pub(super) fn numbers_of(files: &[PathBuf]) -> Option<Vec<f64>> {
    let ticks = TICKS / files.first().and_then(|file| frame_rate(file)).unwrap_or(USUAL);
    let names: Vec<_> = files.iter().map(|file| FrameName::of(file)).collect::<Option<_>>()?;
    let (base, _) = names.first()?;
    let folder = files.first()?.parent();
    let is_one = names.iter().zip(files).all(|((other, _), file)| other == base && file.parent() == folder);
    let numbers = names.iter().map(|(_, name)| name.frame + name.tick / ticks).collect::<Vec<f64>>();
    (is_one && numbers::distinct(&numbers)).then_some(numbers)
}

/// What the name of a file says of its frame, as in `walkFrame12.mcx` and `walkFrame12Tick125.mcx`.
struct FrameName {
    frame: f64,
    /// Behind the frame, where a cache has several samples of each.
    tick: f64,
}

impl FrameName {
    /// The name without it, and what it says.
    fn of(path: &Path) -> Option<(String, Self)> {
        let (base, numbers) = path.file_stem()?.to_str()?.rsplit_once("Frame")?;
        let whole = |digits: &str| digits.parse().ok().map(|number: i32| f64::from(number));
        let (frame, tick) = numbers.split_once("Tick").unwrap_or((numbers, "0"));
        Some((base.to_owned(), Self { frame: whole(frame)?, tick: whole(tick)? }))
    }
}

/// Whether a text is what Maya writes beside a cache.
pub(super) fn is_description(path: &Path) -> bool {
    text(path).is_some_and(|text| text.contains("<Autodesk_Cache_File>"))
}

/// The beginning of a text.
fn text(path: &Path) -> Option<String> {
    let mut text = Vec::new();
    File::open(path).ok()?.take(MOST_TEXT).read_to_end(&mut text).ok()?;
    Some(String::from_utf8_lossy(&text).into_owned())
}

/// The frame rate that the text beside a cache says, where there is one that does.
fn frame_rate(path: &Path) -> Option<f64> {
    let beside = || text(&path.with_extension("xml"));
    let text = beside().or_else(|| text(&path.with_file_name(FrameName::of(path)?.0 + ".xml")))?;
    let number =
        |before: &str, behind: char| -> Option<f64> { text.split_once(before)?.1.split(behind).next()?.parse().ok() };
    // Ticks are whole, which television's rates are not.
    let exact = number(EXACT_RATE, '<').filter(|rate| super::RATES.contains(rate));
    let ticks = || number("TimePerFrame=\"", '"').filter(|ticks| (1.0..=1e6).contains(ticks));
    exact.or_else(|| ticks().map(|ticks| TICKS / ticks))
}

/// The rate at which these ticks are whole frames: the one that is told, or television's near it.
fn fitting(ticks: &[i32], told: f64) -> f64 {
    let is_off = |rate: f64| {
        let off = |&tick: &i32| ((f64::from(tick) * rate / TICKS).round() * TICKS / rate - f64::from(tick)).abs();
        ticks.iter().map(off).fold(0.0, f64::max)
    };
    let television = told * 1000.0 / 1001.0;
    if ticks.len() > 2 && is_off(told) > 1e-3 && is_off(television) < 1.0 { television } else { told }
}

/// Where the positions of a frame are.
struct Array {
    start: u64,
    scalar: Scalar,
    points: u32,
}

/// The name of a channel and what it has in a frame.
type Channel = (Vec<u8>, Array);

/// Where the frames of the channel are that is read, and whether others are in files of their own.
fn layout<R: Read + Seek>(
    chunks: &mut Chunks<R>,
    length: u64,
    prim: Option<&str>,
    told: Option<f64>,
) -> Result<(Layout, bool), Fault> {
    let header = chunks.chunk(0, length)?;
    let start = chunks.start_time(header)?;
    let mut at = header.end;
    let (mut blocks, mut points, mut ticks) = (Vec::new(), None, Vec::new());
    let (mut name, mut is_one_frame) = (None, false);
    while at < length {
        let group = chunks.chunk(at, length)?;
        at = group.end;
        let (time, channels) = chunks.frame(group)?;
        let frame = blocks.len();
        // The only block of a file may have its time in the header.
        is_one_frame = time.is_none() && frame == 0 && at >= length;
        let Some(time) = time.or(start.filter(|_| is_one_frame)) else {
            return Err(damaged(&format!("frame {frame} has no time")));
        };
        let found = match &name {
            None => Some(choose(channels, prim)?),
            Some(name) => channels.into_iter().find(|(found, _)| found == name),
        };
        let Some((chosen, array)) = found else {
            return Err(damaged(&format!("frame {frame} lacks the channel that is read")));
        };
        let (found, points) = (array.points, *points.get_or_insert(array.points));
        if found != points || points == 0 {
            let what = format!(
                "has {found} points in frame {frame}, and {points} in frame 0; export a mesh with all its points in \
                 every frame"
            );
            return Err(Fault::invalid(what));
        }
        name = Some(chosen);
        blocks.push((array.start, array.scalar));
        ticks.push(time);
    }
    let Some(points) = points else {
        return Err(Fault::invalid("holds no frames; export the cache again"));
    };
    let told = told.map(|told| fitting(&ticks, told));
    let seconds: Vec<f64> = ticks.iter().map(|&tick| f64::from(tick) / TICKS).collect();
    let mut times = Times::of(&seconds, told)?;
    if let (true, Some(rate)) = (is_one_frame, told) {
        (times.frame_rate, times.first) = (told, near_whole(rate * seconds[0]));
    }
    let layout = Layout::new(points.into(), blocks.len() as u64, 0, Scalar::F32Big);
    Ok((Layout { blocks, times, ..layout }, is_one_frame))
}

/// The channel that is meant, of those that are no normals.
fn choose(channels: Vec<Channel>, prim: Option<&str>) -> Result<Channel, Fault> {
    let mut meant: Vec<Channel> = channels.into_iter().filter(|(name, _)| !name.ends_with(b"_normals")).collect();
    if let Some(prim) = prim.filter(|_| meant.len() > 1) {
        let at = meant.iter().position(|(name, _)| name == prim.as_bytes());
        meant = at.map(|at| vec![meant.swap_remove(at)]).unwrap_or(meant);
    }
    if meant.len() == 1 {
        return Ok(meant.swap_remove(0));
    }
    let told = |(name, array): &Channel| format!("{} ({} points)", shown(&String::from_utf8_lossy(name)), array.points);
    let names: Vec<String> = meant.iter().take(LISTED).map(told).collect();
    Err(Fault::invalid(format!(
        "holds {} channels of positions{}; export the one mesh alone, or name its channel with --prim, where the \
         command has it",
        meant.len(),
        if names.is_empty() { String::new() } else { format!(", among them {}", names.join(", ")) }
    )))
}

/// A file as chunks: four letters, a number of bytes, and as many bytes.
struct Chunks<R> {
    source: R,
    /// Whether they are those of `.mcx`, which have four bytes of any value behind the letters.
    is_wide: bool,
}

#[derive(Clone, Copy)]
struct Chunk {
    tag: [u8; 4],
    start: u64,
    end: u64,
}

impl<R: Read + Seek> Chunks<R> {
    fn open(source: R, length: u64) -> Result<Self, Fault> {
        let mut chunks = Self { source, is_wide: false };
        let tag = chunks.bytes(0, length)?;
        chunks.is_wide = tag == *b"FOR8";
        let kind = chunks.bytes(if chunks.is_wide { 16 } else { 8 }, length)?;
        if ![*b"FOR4", *b"FOR8"].contains(&tag) || kind != *b"CACH" {
            return Err(damaged("it does not begin as one"));
        }
        Ok(chunks)
    }

    /// The bytes at an offset of what ends there.
    fn bytes<const N: usize>(&mut self, at: u64, end: u64) -> Result<[u8; N], Fault> {
        if at + N as u64 > end {
            return Err(damaged("it ends within a chunk"));
        }
        let mut bytes = [0; N];
        self.source.seek(SeekFrom::Start(at))?;
        self.source.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// The chunk at an offset of what ends there.
    fn chunk(&mut self, at: u64, end: u64) -> Result<Chunk, Fault> {
        let tag = self.bytes(at, end)?;
        let (start, size) = if self.is_wide {
            (at + 16, u64::from_be_bytes(self.bytes(at + 8, end)?))
        } else {
            (at + 8, u32::from_be_bytes(self.bytes(at + 4, end)?).into())
        };
        match start.checked_add(size).filter(|&to| to <= end) {
            Some(to) => Ok(Chunk { tag, start, end: to }),
            None => Err(damaged("a chunk is larger than what it is in")),
        }
    }

    /// The time of the first frame in ticks, where the header says it.
    fn start_time(&mut self, header: Chunk) -> Result<Option<i32>, Fault> {
        let mut at = header.start + 4;
        while at < header.end {
            let Chunk { tag, start, end } = self.chunk(at, header.end)?;
            if tag == *b"STIM" {
                return Ok(Some(i32::from_be_bytes(self.bytes(start, end)?)));
            }
            at = self.behind(start, end);
        }
        Ok(None)
    }

    /// Where the chunk after one begins.
    fn behind(&self, start: u64, end: u64) -> u64 {
        start + (end - start).next_multiple_of(if self.is_wide { 8 } else { 4 })
    }

    /// The time of a block in ticks, where it says one, and its channels of vectors.
    fn frame(&mut self, group: Chunk) -> Result<(Option<i32>, Vec<Channel>), Fault> {
        if self.bytes::<4>(group.start, group.end)? != *b"MYCH" {
            return Err(damaged("a block does not begin where the one before ends"));
        }
        let (mut at, mut channels) = (group.start + 4, Vec::new());
        let (mut time, mut name, mut points) = (None, Vec::new(), 0);
        while at < group.end {
            let Chunk { tag, start, end } = self.chunk(at, group.end)?;
            let size = end - start;
            match &tag {
                b"TIME" => time = Some(i32::from_be_bytes(self.bytes(start, end)?)),
                b"SIZE" => points = u32::from_be_bytes(self.bytes(start, end)?),
                b"CHNM" => {
                    name = vec![0; size.min(MOST_NAME) as usize];
                    self.source.seek(SeekFrom::Start(start))?;
                    self.source.read_exact(&mut name)?;
                    name.truncate(name.iter().position(|&byte| byte == 0).unwrap_or(name.len()));
                }
                b"FVCA" | b"DVCA" => {
                    let scalar = if tag == *b"FVCA" { Scalar::F32Big } else { Scalar::F64Big };
                    if channels.len() == MOST_CHANNELS {
                        return Err(damaged(&format!("a block has more than {MOST_CHANNELS} channels")));
                    }
                    if size != 3 * scalar.size() as u64 * u64::from(points) {
                        return Err(damaged("an array has another size than its channel says"));
                    }
                    channels.push((std::mem::take(&mut name), Array { start, scalar, points }));
                }
                _ => {}
            }
            at = self.behind(start, end);
        }
        Ok((time, channels))
    }
}

fn damaged(what: &str) -> Fault {
    Fault::damaged(format!("is not a whole cache of Maya: {what}; copy or export it again"))
}
