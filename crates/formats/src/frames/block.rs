//! Coordinates as they are stored, block by block.

use std::io::{self, Read, Seek, SeekFrom};

use super::layout::{Layout, Order};
use super::widen::{Scalar, widen};
use crate::error::Fault;
use crate::scene::{Animation, MeshInfo};

/// Bytes read at once: few calls, and still within the fast caches.
const BLOCK: usize = 1 << 17;

/// Reads as many values as `out` has, by way of `block`; gives whether all are finite.
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

/// The frames of a file with a known layout.
pub(super) struct Blocks<R> {
    source: R,
    layout: Layout,
    info: MeshInfo,
    block: Vec<u8>,
}

impl<R> Blocks<R> {
    pub(super) fn new(source: R, mut layout: Layout) -> Self {
        // Points and frames are no more than the bytes of the file, which fit.
        let (points, frames) = (layout.points as usize, layout.frames as usize);
        let info = MeshInfo { points, frames, times: std::mem::take(&mut layout.times), ..MeshInfo::default() };
        Self { source, layout, info, block: Vec::new() }
    }
}

impl<R: Read + Seek + Send> Animation for Blocks<R> {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Fault> {
        let order = self.layout.order;
        // Every value is overwritten below.
        out.resize(order.values() * self.info.points, 0.0);
        let (offset, scalar) = self.layout.block(frame);
        let is_finite = read_values(&mut self.source, offset, scalar, &mut self.block, out)?;
        match order {
            Order::Points => {}
            Order::Axes => {
                let (stored, n) = (std::mem::take(out), self.info.points);
                out.extend((0..n).flat_map(|i| [0, 1, 2].map(|k| stored[k * n + i])));
            }
            Order::Homogeneous => {
                let stored = std::mem::take(out);
                for (point, &[x, y, z, w]) in stored.as_chunks().0.iter().enumerate() {
                    if w != 1.0 {
                        return Err(Fault::unsupported(format!(
                            "point {point} has the fourth coordinate {w} where only 1 has a meaning; save the first \
                             three of them"
                        )));
                    }
                    out.extend([x, y, z]);
                }
            }
        }
        Ok(is_finite)
    }
}
