//! Attributes: differences of consecutive elements, byte by byte, in blocks of up to 256 elements.

use super::bytes::signed;

/// Elements of a group, whose numbers have one width.
const GROUP: usize = 16;
const BLOCK: usize = 256;

/// Bits that the numbers of a group take, by two bits of the header of its column.
type Widths = [u8; 4];

/// `count` elements of `stride` bytes.
pub(super) fn decode(stream: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    let (&version, body) = stream.split_first()?;
    let (has_controls, least_tail) = match version {
        0xa0 => (false, 32),
        0xa1 => (true, 24),
        _ => return None,
    };
    let channels = stride / 4;
    let tail = stride + if has_controls { channels } else { 0 };
    let (mut body, _) = body.split_at_checked(body.len().checked_sub(tail.max(least_tail))?)?;
    let (first, modes) = stream[stream.len() - tail..].split_at(stride);
    let modes = if has_controls { modes } else { &[0; 64][..channels] };
    let per_block = (8192 / stride / GROUP * GROUP).min(BLOCK);

    let mut out = vec![0; count * stride];
    let mut columns = [[0; BLOCK]; 4];
    let mut last = [0; 256];
    last[..stride].copy_from_slice(first);
    for block in out.chunks_mut(per_block * stride) {
        let elements = block.len() / stride;
        let controls = if has_controls { body.split_off(..channels)? } else { &[][..] };
        for (channel, &mode) in modes.iter().enumerate() {
            for (k, column) in columns.iter_mut().enumerate() {
                let control = controls.get(channel).map(|control| control >> (2 * k) & 3);
                read_column(&mut body, control, &mut column[..elements.next_multiple_of(GROUP)], elements)?;
            }
            let last: &mut [u8; 4] = last[4 * channel..].first_chunk_mut()?;
            for (i, element) in block.chunks_exact_mut(stride).enumerate() {
                *last = next(mode, *last, [0, 1, 2, 3].map(|k| columns[k][i]))?;
                element[4 * channel..][..4].copy_from_slice(last);
            }
        }
    }
    body.is_empty().then_some(out)
}

/// The numbers of one byte of all elements of a block; `column` has whole groups.
fn read_column(body: &mut &[u8], control: Option<u8>, column: &mut [u8], elements: usize) -> Option<()> {
    let widths: Widths = match control {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(1) => [1, 2, 4, 8],
        Some(2) => {
            column.fill(0);
            return Some(());
        }
        Some(_) => {
            column[..elements].copy_from_slice(body.split_off(..elements)?);
            return Some(());
        }
    };
    let groups = column.len() / GROUP;
    let header = body.split_off(..groups.div_ceil(4))?;
    for (g, group) in column.chunks_exact_mut(GROUP).enumerate() {
        read_group(body, widths[usize::from(header[g / 4] >> (2 * (g % 4)) & 3)], group)?;
    }
    Some(())
}

/// Sixteen numbers of `width` bits; one with all bits set stands for a byte that follows them all.
fn read_group(body: &mut &[u8], width: u8, group: &mut [u8]) -> Option<()> {
    match width {
        0 => group.fill(0),
        8 => group.copy_from_slice(body.split_off(..GROUP)?),
        _ => {
            let packed = body.split_off(..GROUP * usize::from(width) / 8)?;
            let (per_byte, all_set) = (8 / width, (1 << width) - 1);
            for (k, value) in (0..).zip(group.iter_mut()) {
                let place = k % per_byte;
                // Single bits come from the lowest on, the others from the highest.
                let shift = if width == 1 { place } else { 8 - width * (place + 1) };
                *value = packed[usize::from(k / per_byte)] >> shift & all_set;
            }
            for value in group.iter_mut().filter(|value| **value == all_set) {
                *value = *body.split_off_first()?;
            }
        }
    }
    Some(())
}

/// The next four bytes of an element, after `last`, from what is stored of them.
fn next(mode: u8, last: [u8; 4], stored: [u8; 4]) -> Option<[u8; 4]> {
    Some(match (mode & 15, mode >> 4) {
        (0, 0) => [0, 1, 2, 3].map(|k| last[k].wrapping_add(signed(stored[k].into()) as u8)),
        (1, 0) => {
            let pair = |bytes: [u8; 4], k| u16::from_le_bytes([bytes[k], bytes[k + 1]]);
            let sum = |k| pair(last, k).wrapping_add(signed(pair(stored, k).into()) as u16).to_le_bytes();
            let ([a, b], [c, d]) = (sum(0), sum(2));
            [a, b, c, d]
        }
        (2, turned) => {
            let changed = u32::from_le_bytes(stored).rotate_right(turned.into());
            (u32::from_le_bytes(last) ^ changed).to_le_bytes()
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_four_bits_are_read_as_the_specification_shows_it() {
        let bytes = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let mut group = [0; GROUP];
        read_group(&mut &bytes[..], 4, &mut group).unwrap();
        let found = group.map(|value| signed(value.into()) as u8 as i8);
        assert_eq!(found, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
    }

    #[test]
    fn differences_wrap_in_every_mode() {
        assert_eq!(next(0, [0, 255, 7, 7], [1, 2, 0, 1]), Some([255, 0, 7, 6]));
        assert_eq!(next(1, [255, 0, 0, 0], [2, 0, 1, 0]), Some([0, 1, 255, 255]));
        assert_eq!(next(0x42, [0, 0, 0, 1], [0x10, 0, 0, 0]), Some([1, 0, 0, 1]));
        assert_eq!([next(3, [0; 4], [0; 4]), next(0x10, [0; 4], [0; 4])], [None, None]);
    }

    #[test]
    fn a_stream_of_the_first_version_is_read_whole_or_not_at_all() {
        // Three elements of four bytes: 1 2 3 4, 2 2 3 4, 3 2 3 4; two bits in the first column.
        let mut stream = vec![0xa0, 0x01, 0b0010_1000, 0, 0, 0, 0, 0, 0];
        stream.extend([0; 28]);
        stream.extend([1, 2, 3, 4]);
        assert_eq!(decode(&stream, 3, 4), Some(vec![1, 2, 3, 4, 2, 2, 3, 4, 3, 2, 3, 4]));
        assert_eq!(decode(&stream[1..], 3, 4), None);
        assert_eq!(decode(&stream[..stream.len() - 1], 3, 4), None);
        stream.insert(9, 0);
        assert_eq!(decode(&stream, 3, 4), None, "a byte too many");
    }
}
