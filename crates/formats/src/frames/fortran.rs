//! Arrays in Fortran order, in which each frame is spread over the whole array.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

/// Memory for the frames that are brought together at a time.
const MAX_BYTES: usize = 256 << 20;

/// Such an array, frame after frame: as many as memory has room for are gathered in one pass.
pub(super) struct Transposed<R> {
    source: BufReader<R>,
    start: u64,
    /// Bytes of a value.
    size: usize,
    frames: usize,
    /// A frame is an array of its own, rows × columns.
    rows: usize,
    columns: usize,
    /// Most bytes that are gathered at a time, if not those of a single frame.
    room: usize,
    /// Gathered frames, the first of them and their number.
    block: Vec<u8>,
    first: usize,
    held: usize,
    /// Offset of the next byte to be read.
    at: u64,
}

impl<R: Read + Seek> Transposed<R> {
    pub(super) fn new(source: R, start: u64, size: usize, [frames, rows, columns]: [usize; 3]) -> Self {
        let (source, block) = (BufReader::with_capacity(1 << 17, source), Vec::new());
        Self { source, start, size, frames, rows, columns, room: MAX_BYTES, block, first: 0, held: 0, at: 0 }
    }

    /// Bytes of a frame; the array has as many bytes as its shape says, so that all products fit.
    fn frame_bytes(&self) -> usize {
        self.rows * self.columns * self.size
    }

    /// Gathers the frames from `first` on.
    fn gather(&mut self, first: usize) -> io::Result<()> {
        let (size, stride) = (self.size, self.frame_bytes());
        let count = (self.room / stride).clamp(1, self.frames - first);
        self.held = 0;
        self.block.resize(count * stride, 0);
        let mut run = vec![0; count * size];
        let mut at = self.start + (first * size) as u64;
        self.source.seek(SeekFrom::Start(at))?;
        for k in 0..self.rows * self.columns {
            let wanted = self.start + ((k * self.frames + first) * size) as u64;
            // Forward, and mostly within what is buffered.
            self.source.seek_relative((wanted - at) as i64)?;
            self.source.read_exact(&mut run)?;
            at = wanted + run.len() as u64;
            let place = (k % self.rows * self.columns + k / self.rows) * size;
            for (value, frame) in run.chunks_exact(size).zip(self.block.chunks_exact_mut(stride)) {
                frame[place..place + size].copy_from_slice(value);
            }
        }
        (self.first, self.held) = (first, count);
        Ok(())
    }
}

impl<R: Read + Seek> Read for Transposed<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let stride = self.frame_bytes();
        let frame = usize::try_from(self.at / stride as u64).unwrap_or(usize::MAX);
        if frame >= self.frames {
            return Ok(0);
        }
        if !(self.first..self.first + self.held).contains(&frame) {
            self.gather(frame)?;
        }
        let from = (self.at - (self.first * stride) as u64) as usize;
        let there = &self.block[from..];
        let count = out.len().min(there.len());
        out[..count].copy_from_slice(&there[..count]);
        self.at += count as u64;
        Ok(count)
    }
}

impl<R: Read + Seek> Seek for Transposed<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = super::layout::offset(self.at, (self.frames * self.frame_bytes()) as u64, to)?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Counts the bytes that are read.
    struct Counted(Cursor<Vec<u8>>, usize);

    impl Read for Counted {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let count = self.0.read(out)?;
            self.1 += count;
            Ok(count)
        }
    }

    impl Seek for Counted {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.seek(to)
        }
    }

    #[test]
    fn frames_are_gathered_in_as_many_passes_as_memory_asks_for() {
        let [frames, rows, columns] = [7, 5, 3];
        let value = |t: usize, i: usize, k: usize| (100 * t + 10 * i + k) as u16;
        let mut file = vec![9; 3];
        for (k, i) in (0..columns).flat_map(|k| (0..rows).map(move |i| (k, i))) {
            file.extend((0..frames).flat_map(|t| value(t, i, k).to_le_bytes()));
        }
        let in_order =
            |t: usize| (0..rows).flat_map(move |i| (0..columns).flat_map(move |k| value(t, i, k).to_le_bytes()));
        let length = file.len();
        for (room, passes) in [(0, 7), (60, 4), (90, 3), (1000, 1)] {
            let counted = Counted(Cursor::new(file.clone()), 0);
            let mut source = Transposed::new(counted, 3, 2, [frames, rows, columns]);
            source.room = room;
            let mut found = Vec::new();
            source.read_to_end(&mut found).expect("all frames");
            assert!(found.into_iter().eq((0..frames).flat_map(in_order)), "room of {room}");
            assert!(source.block.len() <= room.max(30), "{} bytes in a room of {room}", source.block.len());
            assert!(source.source.get_ref().1 <= passes * length, "room of {room}");
            source.seek(SeekFrom::Start(5 * 30)).expect("a frame");
            let mut frame = [0; 30];
            source.read_exact(&mut frame).expect("a frame");
            assert!(frame.into_iter().eq(in_order(5)), "room of {room}");
        }
    }
}
