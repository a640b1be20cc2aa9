//! Lossless codecs for arrays of numbers: byte planes and zstd, with a difference along the array before them.

use super::Error;
use crate::le::u32_at;
use std::io::Read;

/// The bytes as they are.
pub(crate) const RAW: u8 = 0;
/// Byte planes of the elements, then zstd.
pub(crate) const PLANES: u8 = 1;
/// Differences of 32-bit words one stride apart, zigzag-coded, then byte planes and zstd.
pub(crate) const DIFFERENCE: u8 = 2;
/// Whole numbers of the `cager-codec` crate: cages of a group of frames, or what they leave of the positions.
pub(crate) const CODED: u8 = 3;
/// Whole numbers of a mesh at rest or of the errors of frames.
pub(crate) const CODED_STATIC: u8 = 4;

/// Whether a section is whole numbers.
pub(crate) fn is_coded(codec: u8) -> bool {
    [CODED, CODED_STATIC].contains(&codec)
}

const ZSTD_LEVEL: i32 = 3;
/// zstd's window at this level is 2 MiB; a file that asks for much more is not ours.
const MAX_WINDOW_LOG: u32 = 24;

/// Encodes by `codec` where that is smaller than the raw bytes; returns the codec used and the payload.
pub(crate) fn encode(codec: u8, raw: &[u8], width: usize, stride: usize) -> Result<(u8, Vec<u8>), Error> {
    let planes = match codec {
        RAW => return Ok((RAW, raw.to_vec())),
        DIFFERENCE => split_planes(&differences(raw, stride), 4),
        _ => split_planes(raw, width),
    };
    let packed = zstd::bulk::compress(&planes, ZSTD_LEVEL)?;
    Ok(if packed.len() < raw.len() { (codec, packed) } else { (RAW, raw.to_vec()) })
}

/// Decodes to exactly `raw_bytes` bytes; memory grows with what is really there, not with what is declared.
pub(crate) fn decode(
    codec: u8,
    payload: Vec<u8>,
    raw_bytes: usize,
    width: usize,
    stride: usize,
    offset: u64,
) -> Result<Vec<u8>, Error> {
    let wrong_size = || Error::corrupt(offset, "a section does not have the size it declares");
    if codec == RAW {
        return if payload.len() == raw_bytes { Ok(payload) } else { Err(wrong_size()) };
    }
    if codec != PLANES && codec != DIFFERENCE {
        return Err(Error::UnknownSection(format!("codec {codec}")));
    }
    if codec == DIFFERENCE && !raw_bytes.is_multiple_of(4) {
        return Err(wrong_size());
    }
    let mut decoder = zstd::stream::Decoder::with_buffer(&payload[..])?;
    decoder.window_log_max(MAX_WINDOW_LOG)?;
    let mut planes = Vec::new();
    decoder
        .take(raw_bytes as u64 + 1)
        .read_to_end(&mut planes)
        .map_err(|e| Error::corrupt(offset, format!("a section cannot be decompressed ({e})")))?;
    if planes.len() != raw_bytes {
        return Err(wrong_size());
    }
    // Each step lets go of the one before: a reader's memory is a known multiple of a section.
    drop(payload);
    let mut raw = join_planes(&planes, if codec == DIFFERENCE { 4 } else { width });
    drop(planes);
    if codec == DIFFERENCE {
        undo_differences(&mut raw, stride);
    }
    Ok(raw)
}

/// All first bytes of the elements, then all second bytes, and so on; bytes beyond the last whole element stay at the end.
fn split_planes(raw: &[u8], width: usize) -> Vec<u8> {
    let count = raw.len() / width;
    let mut out = Vec::with_capacity(raw.len());
    for plane in 0..width {
        out.extend(raw.chunks_exact(width).map(|element| element[plane]));
    }
    out.extend_from_slice(&raw[count * width..]);
    out
}

fn join_planes(planes: &[u8], width: usize) -> Vec<u8> {
    let count = planes.len() / width;
    let mut out = vec![0; planes.len()];
    for plane in 0..width {
        for (element, &byte) in out.chunks_exact_mut(width).zip(&planes[plane * count..]) {
            element[plane] = byte;
        }
    }
    out[count * width..].copy_from_slice(&planes[count * width..]);
    out
}

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

fn differences(raw: &[u8], stride: usize) -> Vec<u8> {
    let words = words(raw);
    let zigzag = |d: i32| ((d << 1) ^ (d >> 31)) as u32;
    let before = |k: usize| if k < stride { 0 } else { words[k - stride] };
    (0..words.len()).flat_map(|k| zigzag(words[k].wrapping_sub(before(k)) as i32).to_le_bytes()).collect()
}

fn undo_differences(bytes: &mut [u8], stride: usize) {
    for k in 0..bytes.len() / 4 {
        let zigzag = u32_at(bytes, 4 * k);
        let difference = (zigzag >> 1) ^ (zigzag & 1).wrapping_neg();
        let before = if k < stride { 0 } else { u32_at(bytes, 4 * (k - stride)) };
        bytes[4 * k..4 * k + 4].copy_from_slice(&difference.wrapping_add(before).to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_codec_gives_back_every_bit() {
        let raw: Vec<u8> = (0..4_800u32).map(|k| (k.wrapping_mul(2_654_435_761) >> (k % 24)) as u8).collect();
        for codec in [RAW, PLANES, DIFFERENCE] {
            for (width, stride) in [(4, 1), (4, 300), (8, 7), (8, 2_000)] {
                let (used, payload) = encode(codec, &raw, width, stride).unwrap();
                assert_eq!(decode(used, payload, raw.len(), width, stride, 0).unwrap(), raw);
            }
        }
    }
}
