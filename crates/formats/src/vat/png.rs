//! Images of 16 bits a channel as PNG: filtered and packed rows, and nothing else of the format.

use std::io::{self, BufWriter, Write};

use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};

/// Bytes of packed rows that are put into one chunk.
const CHUNK: usize = 1 << 18;
/// A row has the differences from the one above, which are small as the next frame is near.
const FROM_ABOVE: u8 = 2;

/// Rows of an image, from the top down.
pub(super) struct Png<W: Write> {
    packed: ZlibEncoder<BufWriter<Chunks<W>>>,
    above: Vec<u8>,
    row: Vec<u8>,
}

impl<W: Write> Png<W> {
    pub(super) fn new(mut out: W, width: u32, height: u32) -> io::Result<Self> {
        out.write_all(b"\x89PNG\r\n\x1a\n")?;
        let mut chunks = Chunks(out);
        let depth_colours_and_ways = [16, 2, 0, 0, 0];
        chunks.put(b"IHDR", &[&width.to_be_bytes()[..], &height.to_be_bytes(), &depth_colours_and_ways].concat())?;
        let packed = ZlibEncoder::new(BufWriter::with_capacity(CHUNK, chunks), Compression::default());
        Ok(Self { packed, above: vec![0; 6 * width as usize], row: Vec::new() })
    }

    /// Texels of a row; black where there are fewer than the image is wide.
    pub(super) fn row(&mut self, texels: impl Iterator<Item = [u16; 3]>) -> io::Result<()> {
        self.row.clear();
        self.row.extend(texels.take(self.above.len() / 6).flat_map(|texel| texel.map(u16::to_be_bytes)).flatten());
        self.row.resize(self.above.len(), 0);
        self.above.iter_mut().zip(&self.row).for_each(|(above, byte)| *above = byte.wrapping_sub(*above));
        self.packed.write_all(&[FROM_ABOVE])?;
        self.packed.write_all(&self.above)?;
        std::mem::swap(&mut self.above, &mut self.row);
        Ok(())
    }

    /// Ends the image, once as many rows are written as it is high.
    pub(super) fn finish(self) -> io::Result<()> {
        let mut chunks = self.packed.finish()?.into_inner().map_err(io::IntoInnerError::into_error)?;
        chunks.put(b"IEND", &[])?;
        chunks.0.flush()
    }
}

/// Chunks of a file; what is written is each time one of packed rows.
struct Chunks<W>(W);

impl<W: Write> Chunks<W> {
    fn put(&mut self, name: &[u8; 4], bytes: &[u8]) -> io::Result<()> {
        let length = u32::try_from(bytes.len()).map_err(|_| io::ErrorKind::FileTooLarge)?;
        let mut sum = Crc::new();
        sum.update(name);
        sum.update(bytes);
        for part in [&length.to_be_bytes()[..], name, bytes, &sum.sum().to_be_bytes()] {
            self.0.write_all(part)?;
        }
        Ok(())
    }
}

impl<W: Write> Write for Chunks<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.put(b"IDAT", bytes).map(|()| bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
