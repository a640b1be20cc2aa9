//! Lossless codecs for arrays of numbers: differences, byte planes and zstd.

use super::Error;
use super::section::{DIFFERENCE, PLANES, RAW, SectionHeader};
use crate::le::{value_at, values};
use std::io::Read;

const ZSTD_LEVEL: i32 = 3;
/// zstd's window at this level is 2 MiB; a file that asks for much more is not ours.
const MAX_WINDOW_LOG: u32 = 24;

/// Encodes by the header's codec where that is smaller; returns header and payload.
pub(crate) fn encode(header: SectionHeader, raw: &[u8], stride: usize) -> Result<(SectionHeader, Vec<u8>), Error> {
    let header = SectionHeader { raw_bytes: raw.len() as u64, ..header };
    let planes = match header.codec {
        RAW => return Ok((header, raw.to_vec())),
        DIFFERENCE => split_planes(&differences(raw, stride), 4),
        _ => split_planes(raw, header.width.into()),
    };
    let packed = zstd::bulk::compress(&planes, ZSTD_LEVEL)?;
    let is_smaller = packed.len() < raw.len();
    Ok(if is_smaller { (header, packed) } else { (SectionHeader { codec: RAW, ..header }, raw.to_vec()) })
}

/// The bytes that a section's header declares. Memory grows with those that are really there.
pub(crate) fn decode(header: &SectionHeader, payload: Vec<u8>, stride: usize, offset: u64) -> Result<Vec<u8>, Error> {
    let (codec, raw_bytes) = (header.codec, header.raw_bytes as usize);
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
    let mut raw = join_planes(&planes, if codec == DIFFERENCE { 4 } else { usize::from(header.width).max(1) });
    drop(planes);
    if codec == DIFFERENCE {
        undo_differences(&mut raw, stride);
    }
    Ok(raw)
}

/// All first bytes of the elements, then all second bytes, …; a remainder stays at the end.
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

fn differences(raw: &[u8], stride: usize) -> Vec<u8> {
    let words: Vec<u32> = values(raw, u32::from_le_bytes).collect();
    let zigzag = |d: i32| ((d << 1) ^ (d >> 31)) as u32;
    let before = |k: usize| if k < stride { 0 } else { words[k - stride] };
    (0..words.len()).flat_map(|k| zigzag(words[k].wrapping_sub(before(k)) as i32).to_le_bytes()).collect()
}

fn undo_differences(bytes: &mut [u8], stride: usize) {
    let word = |bytes: &[u8], k: usize| value_at(bytes, 4 * k, u32::from_le_bytes);
    for k in 0..bytes.len() / 4 {
        let zigzag = word(bytes, k);
        let difference = (zigzag >> 1) ^ (zigzag & 1).wrapping_neg();
        let before = if k < stride { 0 } else { word(bytes, k - stride) };
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
                let header = SectionHeader { codec, width, ..SectionHeader::new(*b"test", (0, 0)) };
                let (header, payload) = encode(header, &raw, stride).unwrap();
                assert_eq!(decode(&header, payload, stride, 0).unwrap(), raw);
            }
        }
    }
}
