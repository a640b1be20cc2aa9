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
            // Filter "up": pictures on one colour are mostly what is above.
            rows.push(2);
            for (pixel, up) in row.iter().zip(above) {
                rows.extend((0..4).map(|k| pixel[k].wrapping_sub(up[k])));
            }
            above = row;
        }
        let mut header = Vec::new();
        header.extend((width as u32).to_be_bytes());
        header.extend((height as u32).to_be_bytes());
        // Eight bits, red green blue opacity, deflate, the standard filters, not interlaced.
        header.extend([8, 6, 0, 0, 0]);
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        chunk(&mut bytes, b"IHDR", &header);
        chunk(&mut bytes, b"IDAT", &compress_to_vec_zlib(&rows, 8));
        chunk(&mut bytes, b"IEND", &[]);
        Self { width, height, bytes }
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
        let mut above = vec![0u8; 28];
        let mut found: Vec<[u8; 4]> = Vec::new();
        for row in rows.chunks(29) {
            assert_eq!(row[0], 2);
            above = row[1..].iter().zip(&above).map(|(x, up)| x.wrapping_add(*up)).collect();
            found.extend(above.as_chunks::<4>().0);
        }
        assert_eq!(found, pixels);
    }

    #[test]
    fn addresses_are_base64() {
        let png = |bytes: &[u8]| Png { width: 0, height: 0, bytes: bytes.to_vec() }.data_url();
        let text = |bytes: &[u8]| png(bytes).split_off("data:image/png;base64,".len());
        assert_eq!(["f", "fo", "foo", "foob"].map(|s| text(s.as_bytes())), ["Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]);
        assert_eq!(text(&[0xff, 0xef, 0xbe]), "/+++");
    }
}
