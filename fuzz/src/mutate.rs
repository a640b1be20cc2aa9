//! Bytes that are almost right.

use fastrand::Rng;

/// The numbers that lengths go wrong at.
pub const EXTREMES: [u64; 12] =
    [0, 1, 0x7f, 0xff, 0xffff, 0x7fff_ffff, 1 << 31, 0xffff_ffff, 1 << 32, i64::MAX as u64, 1 << 63, u64::MAX];

/// Longer ones are cut.
const MAX_BYTES: usize = 1 << 16;

/// Changes one of `seeds` in one to eight places.
pub fn mutated(rng: &mut Rng, seeds: &[Vec<u8>], words: &[&str]) -> Vec<u8> {
    let mut bytes = pick(rng, seeds).cloned().unwrap_or_default();
    for _ in 0..1 << rng.u8(0..4) {
        change(rng, &mut bytes, seeds, words);
    }
    bytes.truncate(MAX_BYTES);
    bytes
}

fn pick<'a, T>(rng: &mut Rng, all: &'a [T]) -> Option<&'a T> {
    if all.is_empty() { None } else { all.get(rng.usize(..all.len())) }
}

fn change(rng: &mut Rng, bytes: &mut Vec<u8>, seeds: &[Vec<u8>], words: &[&str]) {
    let at = rng.usize(..=bytes.len());
    let other = rng.usize(..=bytes.len());
    let (from, to) = (at.min(other), at.max(other).min(at.min(other) + 64));
    match rng.u8(..10) {
        0 if at < bytes.len() => bytes[at] ^= 1 << rng.u8(..8),
        1 if at < bytes.len() => bytes[at] = rng.u8(..),
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(from..to)),
        4 => {
            let copy = bytes[from..to].to_vec();
            bytes.splice(other..other, copy);
        }
        5 => overwrite(bytes, at, &field(rng)),
        6 => number(rng, bytes, at),
        7 => {
            let word = pick(rng, words).copied().unwrap_or_default();
            let end = if rng.bool() { at } else { (at + word.len()).min(bytes.len()) };
            bytes.splice(at..end, word.bytes());
        }
        8 => {
            // The end of another.
            let seed = pick(rng, seeds).cloned().unwrap_or_default();
            let start = rng.usize(..=seed.len());
            bytes.splice(at.., seed[start..].iter().copied());
        }
        _ => drop(bytes.splice(at..at, std::iter::repeat_n(rng.u8(..), rng.usize(..16)))),
    }
}

/// A length of some width and order.
fn field(rng: &mut Rng) -> Vec<u8> {
    let value = EXTREMES[rng.usize(..EXTREMES.len())].wrapping_add(rng.u64(..3)).wrapping_sub(1);
    let width = 1 << rng.usize(..4);
    if rng.bool() { value.to_le_bytes()[..width].to_vec() } else { value.to_be_bytes()[8 - width..].to_vec() }
}

fn overwrite(bytes: &mut [u8], at: usize, with: &[u8]) {
    let length = with.len().min(bytes.len() - at);
    bytes[at..at + length].copy_from_slice(&with[..length]);
}

/// Another number where one is written in digits.
fn number(rng: &mut Rng, bytes: &mut Vec<u8>, at: usize) {
    let Some(start) = (at..bytes.len()).find(|&k| bytes[k].is_ascii_digit()) else { return };
    let end = (start..bytes.len()).find(|&k| !bytes[k].is_ascii_digit()).unwrap_or(bytes.len());
    let value = match rng.u8(..6) {
        0 => "-1".to_owned(),
        1 => "1e309".to_owned(),
        2 => "nan".to_owned(),
        _ => EXTREMES[rng.usize(..EXTREMES.len())].to_string(),
    };
    bytes.splice(start..end, value.into_bytes());
}
