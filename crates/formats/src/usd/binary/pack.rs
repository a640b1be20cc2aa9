//! How tables are packed: by LZ4, whole numbers before that by their differences.

use lz4_flex::block::decompress_into;

use crate::error::Fault;
use crate::scene::{Allowance, Fields, damaged};

fn sized<'a>(fields: &mut Fields<'a>) -> Result<&'a [u8], Fault> {
    let length = fields.number()?;
    fields.take(usize::try_from(length).unwrap_or(usize::MAX))
}

/// Bytes of LZ4 behind how many they are, which become at most `most` bytes.
pub(super) fn unpacked(fields: &mut Fields<'_>, most: u64, allowance: &mut Allowance) -> Result<Vec<u8>, Fault> {
    let packed = sized(fields)?;
    unpack(packed, allowance.take(most, 1)?)
}

/// So many whole numbers behind their bytes.
pub(super) fn unpacked_integers(
    fields: &mut Fields<'_>,
    count: u64,
    allowance: &mut Allowance,
) -> Result<Vec<i32>, Fault> {
    let packed = sized(fields)?;
    integers(packed, allowance.take(count, 9)?)
}

/// Unpacks LZ4, which may be in several pieces.
fn unpack(packed: &[u8], most: usize) -> Result<Vec<u8>, Fault> {
    let mut fields = Fields(packed);
    let [pieces] = fields.array()?;
    // No byte of LZ4 becomes more than 255.
    let (mut out, mut length) = (vec![0; most.min(packed.len().saturating_mul(255))], 0);
    for _ in 0..pieces.max(1) {
        let piece = match pieces {
            0 => std::mem::take(&mut fields.0),
            _ => {
                let size = u32::from_le_bytes(fields.array()?);
                fields.take(size as usize)?
            }
        };
        length += decompress_into(piece, &mut out[length..]).map_err(|_| damaged("a table cannot be unpacked"))?;
    }
    out.truncate(length);
    Ok(out)
}

/// So many whole numbers of eight bytes from their differences.
pub(super) fn long_integers(packed: &[u8], count: usize) -> Result<Vec<i64>, Fault> {
    whole(packed, count, 8, |number| number)
}

/// The same of four bytes.
pub(super) fn integers(packed: &[u8], count: usize) -> Result<Vec<i32>, Fault> {
    // What lies beyond four bytes is lost as they are added up.
    whole(packed, count, 4, |number| number as i32)
}

fn whole<T>(packed: &[u8], count: usize, size: usize, of: impl Fn(i64) -> T) -> Result<Vec<T>, Fault> {
    if count == 0 {
        return Ok(Vec::new());
    }
    // The usual difference, two bits for each number, and the differences that are others.
    let bytes = unpack(packed, size + count.div_ceil(4) + size * count)?;
    let mut fields = Fields(&bytes);
    let usual = signed(fields.take(size)?);
    let codes = fields.take(count.div_ceil(4))?;
    let (mut number, mut out) = (0_i64, Vec::with_capacity(count));
    for k in 0..count {
        let difference = match codes[k / 4] >> (2 * (k % 4)) & 3 {
            0 => usual,
            code => signed(fields.take(size >> (3 - code))?),
        };
        number = number.wrapping_add(difference);
        out.push(of(number));
    }
    Ok(out)
}

/// A number of as many bytes as there are.
fn signed(bytes: &[u8]) -> i64 {
    let sign = if bytes.last().is_some_and(|&byte| byte >= 0x80) { -1 } else { 0 };
    bytes.iter().rev().fold(sign, |number, &byte| number << 8 | i64::from(byte))
}
