//! The layout of encoded structures: fixed bytes, which another crate reads too.

mod support;

use cager_proto::container::Header;
use cager_proto::wire::{self, WireError};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_wincode::SerdeCompat;
use serde_wincode::wincode::Deserialize;

const LIMIT: usize = 64 << 10;

fn encode<T: Serialize + ?Sized>(value: &T) -> Result<Vec<u8>, WireError> {
    wire::encode::<_, LIMIT>(value)
}

fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, WireError> {
    wire::decode::<_, LIMIT>(bytes)
}

/// Each line a field of the header, in the order of `docs/FORMAT.md`.
const GOLDEN: &str = "
    03000000
    0300000000000000 6d7663
    0600000000000000 6d6178766f6c
    0900000000000000 6c61706c616369616e
    14000000
    000000000000f03f
    4200000000000000
    4000000000000000
    0201000000000000
    0c00000000000000
    1400000000000000
    0c000000
    01 0000000000003e40
";

fn header() -> Header {
    Header {
        points: 66,
        rest_faces: 64,
        rest_corners: 258,
        cage_vertices: 12,
        cage_faces: 20,
        frame_rate: Some(30.0),
        ..support::header(12)
    }
}

fn golden() -> Vec<u8> {
    let digits: Vec<u8> = GOLDEN.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
    digits.chunks(2).map(|d| u8::from_str_radix(str::from_utf8(d).unwrap(), 16).unwrap()).collect()
}

#[test]
fn header_has_exactly_these_bytes() {
    assert_eq!(encode(&header()).unwrap(), golden());
    assert_eq!(decode::<Header>(&golden()).unwrap(), header());
    let unknown_rate = Header { frame_rate: None, ..header() };
    let bytes = encode(&unknown_rate).unwrap();
    assert_eq!(bytes, [&golden()[..golden().len() - 9], &[0]].concat());
}

#[test]
fn another_crate_reads_the_same_header() {
    assert_eq!(SerdeCompat::<Header>::deserialize(&golden()).unwrap(), header());
}

#[test]
fn cut_or_left_over_bytes_are_refused() {
    let bytes = golden();
    for length in 0..bytes.len() {
        assert!(decode::<Header>(&bytes[..length]).is_err(), "cut to {length} bytes");
    }
    let error = decode::<Header>(&[&bytes[..], &[0]].concat()).unwrap_err();
    assert!(matches!(error, WireError::Trailing { bytes: 1 }), "{error}");
}

#[test]
fn huge_lengths_are_refused() {
    // `hostile.rs` counts what this allocates.
    for length in [1 << 16, 1 << 32, 1 << 63, u64::MAX] {
        let mut bytes = golden();
        bytes[4..12].copy_from_slice(&u64::to_le_bytes(length));
        assert!(decode::<Header>(&bytes).is_err());
        assert!(decode::<String>(&length.to_le_bytes()).is_err());
        assert!(decode::<Vec<u64>>(&length.to_le_bytes()).is_err());
    }
}

#[test]
fn structures_beyond_the_limit_are_neither_encoded_nor_decoded() {
    let text = "x".repeat(LIMIT - 8);
    let bytes = encode(&text).unwrap();
    assert_eq!(bytes.len(), LIMIT);
    assert_eq!(decode::<String>(&bytes).unwrap(), text);
    assert!(encode(&"x".repeat(LIMIT - 7)).is_err());
    assert!(decode::<String>(&vec![0; LIMIT + 1]).is_err());
}
