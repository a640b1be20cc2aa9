//! PNG: eight bits a channel with opacity (ISO/IEC 15948), compressed by miniz_oxide.

use miniz_oxide::deflate::compress_to_vec_zlib;
use std::fmt::Write;

/// A picture.
#[derive(Clone, Debug)]
pub(crate) struct Png {
    /// Width in pixels.
    pub(crate) width: usize,
    /// Height in pixels.
    pub(crate) height: usize,
    bytes: Vec<u8>,
}

impl Png {
    /// Compresses `pixels`, rows from above, red, green, blue and opacity.
    ///
    /// # Panics
    /// Where there are not as many pixels as the size says.
    pub(crate) fn new(width: usize, height: usize, pixels: &[[u8; 4]]) -> Self {
        assert_eq!(pixels.len(), width * height, "one colour per pixel");
        let mut rows = Vec::with_capacity(height * (4 * width + 1));
        let blank = vec![[0u8; 4]; width];
        let mut above = blank.as_slice();
        for row in pixels.chunks_exact(width) {
            rows.extend(filtered(row, above));
            above = row;
        }
        let mut header = Vec::new();
        header.extend((width as u32).to_be_bytes());
        header.extend((height as u32).to_be_bytes());
        // Eight bits, red green blue opacity, deflate, the standard filters, not interlaced.
        header.extend([8, 6, 0, 0, 0]);
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        chunk(&mut bytes, b"IHDR", &header);
        chunk(&mut bytes, b"IDAT", &compress_to_vec_zlib(&rows, 6));
        chunk(&mut bytes, b"IEND", &[]);
        Self { width, height, bytes }
    }

    /// The bytes of a file.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// As the address of an `img` element, which then needs no other file.
    pub(crate) fn data_url(&self) -> String {
        const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let mut url = String::with_capacity(self.bytes.len() * 4 / 3 + 40);
        let _ = write!(url, "data:image/png;base64,");
        for three in self.bytes.chunks(3) {
            let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
            let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
            for k in 0..4 {
                let digit = DIGITS[(bits >> (18 - 6 * k) & 63) as usize];
                url.push(if k <= three.len() { char::from(digit) } else { '=' });
            }
        }
        url
    }
}

/// A row less what is expected of it, by whichever of the standard's filters leaves the least; the filter's number first.
fn filtered(row: &[[u8; 4]], above: &[[u8; 4]]) -> Vec<u8> {
    let mut best = (u64::MAX, Vec::new());
    for filter in 0..=4u8 {
        let mut bytes = vec![filter];
        for (x, pixel) in row.iter().enumerate() {
            let [left, corner] = if x > 0 { [row[x - 1], above[x - 1]] } else { [[0; 4]; 2] };
            bytes.extend((0..4).map(|k| pixel[k].wrapping_sub(expected(filter, left[k], above[x][k], corner[k]))));
        }
        // The usual measure: what is near zero compresses.
        let size = bytes[1..].iter().map(|&b| u64::from((b as i8).unsigned_abs())).sum();
        if size < best.0 {
            best = (size, bytes);
        }
    }
    best.1
}

/// What a filter of the standard expects of a byte, from those to its left, above it and to the left of that.
fn expected(filter: u8, left: u8, up: u8, corner: u8) -> u8 {
    match filter {
        0 => 0,
        1 => left,
        2 => up,
        3 => ((u16::from(left) + u16::from(up)) / 2) as u8,
        _ => {
            let near = |x: u8| (i16::from(left) + i16::from(up) - i16::from(corner) - i16::from(x)).abs();
            [left, up, corner].into_iter().min_by_key(|&x| near(x)).unwrap_or(0)
        }
    }
}

fn chunk(out: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    out.extend((data.len() as u32).to_be_bytes());
    let start = out.len();
    out.extend(kind);
    out.extend(data);
    let sum = crc32(&out[start..]);
    out.extend(sum.to_be_bytes());
}

/// The checksum of PNG and zip, bit by bit: pictures are small.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_the_standard() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
        assert_eq!(crc32(b"IEND"), 0xae42_6082);
    }

    #[test]
    fn pictures_hold_their_pixels() {
        let pixels: Vec<[u8; 4]> = (0..35u8).map(|i| [i, 7 * i, 255 - i, 200]).collect();
        let png = Png::new(7, 5, &pixels);
        let bytes = &png.bytes;
        assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
        assert_eq!(&bytes[16..29], [0, 0, 0, 7, 0, 0, 0, 5, 8, 6, 0, 0, 0]);
        let length = u32::from_be_bytes([bytes[33], bytes[34], bytes[35], bytes[36]]) as usize;
        let rows = miniz_oxide::inflate::decompress_to_vec_zlib(&bytes[41..41 + length]).expect("compressed rows");
        let mut found = vec![0u8; 28];
        for row in rows.chunks(29) {
            for (x, byte) in row[1..].iter().enumerate() {
                let start = found.len() - 28;
                let [left, corner] = if x >= 4 { [found[start + 24], found[start - 4]] } else { [0; 2] };
                found.push(byte.wrapping_add(expected(row[0], left, found[start], corner)));
            }
        }
        assert_eq!(found[28..].as_chunks::<4>().0, pixels);
    }

    #[test]
    fn addresses_are_base64() {
        let png = |bytes: &[u8]| Png { width: 0, height: 0, bytes: bytes.to_vec() }.data_url();
        let text = |bytes: &[u8]| png(bytes).split_off("data:image/png;base64,".len());
        assert_eq!(["f", "fo", "foo", "foob"].map(|s| text(s.as_bytes())), ["Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]);
        assert_eq!(text(&[0xff, 0xef, 0xbe]), "/+++");
    }
}
