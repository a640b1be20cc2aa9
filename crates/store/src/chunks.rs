//! Cages that are stored together, as both engines keep them.

use crate::{CagePlace, CatalogError, FrameEntry, NewFrame, checksums};

/// Most frames whose cages are stored together.
const CHUNK_FRAMES: usize = 64;
/// Bytes of cages from which on they are stored.
const CHUNK_BYTES: usize = 256 << 10;
/// About what a frame takes beside its cage.
const FRAME_BYTES: usize = 96;

/// Cages that are stored together, and the frames that they belong to.
pub(crate) struct Chunk {
    pub(crate) bytes: Vec<u8>,
    pub(crate) entries: Vec<FrameEntry>,
}

impl Chunk {
    fn new(session: &str, frames: &[NewFrame<'_>]) -> Self {
        let mut bytes = Vec::with_capacity(frames.iter().map(|frame| 4 * frame.cage.len()).sum());
        let entries = frames.iter().map(|NewFrame { entry, cage }| {
            let offset = bytes.len();
            bytes.extend(cage.iter().flat_map(|x| x.to_le_bytes()));
            let crc = checksums::of_cage(session, entry.frame, &bytes[offset..]);
            let place = CagePlace { chunk: 0, offset: offset as u32, bytes: 4 * cage.len() as u32, crc };
            FrameEntry { place, ..*entry }
        });
        let entries = entries.collect();
        Self { bytes, entries }
    }

    /// With how many bytes it counts for its session.
    pub(crate) fn counted(&self) -> i64 {
        (self.bytes.len() + FRAME_BYTES * self.entries.len()) as i64
    }
}

/// Frames of a session as they are stored together.
pub(crate) fn chunks(session: &str, mut frames: &[NewFrame<'_>]) -> Vec<Chunk> {
    let next = || {
        let mut bytes = 0;
        let fits = |frame: &&NewFrame<'_>| {
            let fits = bytes < CHUNK_BYTES;
            bytes += 4 * frame.cage.len();
            fits
        };
        let count = frames.iter().take(CHUNK_FRAMES).take_while(fits).count();
        let (now, later) = frames.split_at(count);
        frames = later;
        (count > 0).then(|| Chunk::new(session, now))
    };
    std::iter::from_fn(next).collect()
}

/// Appends the cage of a frame. `stored` is what its chunk holds from `first` on.
pub(crate) fn add_cage(
    session: &str,
    entry: &FrameEntry,
    stored: &[u8],
    first: u32,
    out: &mut Vec<u8>,
) -> Result<(), CatalogError> {
    let CagePlace { offset, bytes, crc, .. } = entry.place;
    let from = offset.checked_sub(first).and_then(|from| stored.get(from as usize..));
    let cage = from.and_then(|rest| rest.get(..bytes as usize));
    let cage = cage.filter(|cage| checksums::of_cage(session, entry.frame, cage) == crc);
    out.extend_from_slice(cage.ok_or_else(|| lost(entry))?);
    Ok(())
}

/// What is said of a frame whose cage is not there as it was written.
pub(crate) fn lost(entry: &FrameEntry) -> CatalogError {
    CatalogError::Damaged(format!("the cage of frame {} is not what was written", entry.frame))
}
