//! Coordinates as they are stored, block by block.

use std::io::{self, Read, Seek, SeekFrom};

use super::widen::{Scalar, widen};

/// Bytes read at once: few calls, and still within the fast caches.
const BLOCK: usize = 1 << 17;

/// Reads as many values as `out` has from an offset on, by way of `block`; gives whether all are finite.
pub(crate) fn read_values(
    source: &mut (impl Read + Seek),
    start: u64,
    scalar: Scalar,
    block: &mut Vec<u8>,
    out: &mut [f64],
) -> io::Result<bool> {
    let size = scalar.size();
    block.resize(BLOCK.min(out.len() * size), 0);
    source.seek(SeekFrom::Start(start))?;
    let mut finite = true;
    for values in out.chunks_mut(BLOCK / size) {
        let bytes = &mut block[..values.len() * size];
        source.read_exact(bytes)?;
        finite &= widen(scalar, bytes, values);
    }
    Ok(finite)
}
