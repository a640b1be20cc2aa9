//! The frame record as `proto/README.md` lays it out.

use cager_proto::record::{FrameHeader, HEADER_BYTES, Kind, RecordError, decode, decode_header, decode_rows, encode};

const ROWS: [f32; 6] = [1.0, -2.0, 0.5, 0.0, 1e-3, 3.25];

/// The worked example of the README.
fn example() -> Vec<u8> {
    let document = include_str!("../README.md");
    let block = document.split("<!-- example -->").nth(1).expect("an example between two marks");
    block
        .lines()
        .filter(|line| line.starts_with("00"))
        .flat_map(|line| {
            let bytes = line[4..].split('|').next().unwrap_or_default();
            bytes.split_whitespace().map(|b| u8::from_str_radix(b, 16).unwrap()).collect::<Vec<_>>()
        })
        .collect()
}

fn read(bytes: &[u8], kind: Kind, rows: u32) -> Result<(FrameHeader, Vec<f32>, usize), RecordError> {
    let mut out = vec![9.0];
    decode(bytes, kind, rows, &mut out).map(|(header, used)| (header, out, used))
}

#[test]
fn record_of_the_readme_is_what_is_written() {
    let mut out = Vec::new();
    encode(Kind::Cage, 258, 0.25, f32::NAN, &ROWS, &mut out).unwrap();
    assert_eq!(out, example(), "{out:02x?}");
}

#[test]
fn record_of_the_readme_is_read() {
    let bytes = example();
    let (header, rows, used) = read(&bytes, Kind::Cage, 2).unwrap();
    assert_eq!((header.kind, header.frame, header.rows, header.l2), (Kind::Cage, 258, 2, 0.25));
    assert!(header.linf.is_nan());
    assert_eq!((rows.as_slice(), used), (&ROWS[..], bytes.len()));
    assert_eq!(header.to_bytes(), bytes[..HEADER_BYTES]);
}

#[test]
fn record_is_read_in_two_steps_as_it_arrives() {
    let bytes = example();
    let header = decode_header(&bytes[..HEADER_BYTES], Kind::Cage, 2).unwrap();
    assert_eq!(header.row_bytes(), 24);
    let mut rows = Vec::new();
    decode_rows(&header, &bytes[HEADER_BYTES..], &mut rows).unwrap();
    assert_eq!(rows, ROWS);
    // Other formats are told from records that have only begun to arrive.
    for length in 0..HEADER_BYTES {
        let error = decode_header(&bytes[..length], Kind::Cage, 2).unwrap_err();
        assert_eq!(error, RecordError::Incomplete { needed: HEADER_BYTES, have: length });
    }
    assert_eq!(decode_header(b"CX", Kind::Cage, 2), Err(RecordError::NotARecord));
}

#[test]
fn records_follow_each_other_without_gaps() {
    let mut stream = Vec::new();
    for frame in 0..5 {
        encode(Kind::Positions, frame, 0.0, 0.0, &[frame as f32; 9], &mut stream).unwrap();
    }
    let mut rest = stream.as_slice();
    for frame in 0..5 {
        let (header, rows, used) = read(rest, Kind::Positions, 3).unwrap();
        assert_eq!((header.frame, rows), (frame, vec![frame as f32; 9]));
        rest = &rest[used..];
    }
    assert!(rest.is_empty());
}

#[test]
fn every_bit_of_the_rows_survives() {
    let bits = [0x7fc0_1234, 0xff80_0000, 0x8000_0000, 0x0000_0001, 0xffff_ffff, 0x7f7f_ffff];
    let mut out = Vec::new();
    encode(Kind::HandleRows, 0, 0.0, 0.0, &bits.map(f32::from_bits), &mut out).unwrap();
    let (_, rows, _) = read(&out, Kind::HandleRows, 2).unwrap();
    assert!(rows.iter().map(|x| x.to_bits()).eq(bits));
}

#[test]
fn values_that_are_no_rows_of_three_leave_the_output_as_it_was() {
    let mut out = vec![1, 2, 3];
    let error = encode(Kind::Cage, 0, 0.0, 0.0, &[0.0; 4], &mut out).unwrap_err();
    assert_eq!((error, out), (RecordError::Shape { values: 4 }, vec![1, 2, 3]));
}

#[test]
fn record_for_another_purpose_is_refused_for_its_reason() {
    let bytes = example();
    let changed = |at: usize, value: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = value;
        read(&bytes, Kind::Cage, 2).unwrap_err()
    };
    assert_eq!(changed(0, b'X'), RecordError::NotARecord);
    assert_eq!(changed(4, 2), RecordError::Version { found: 2 });
    assert_eq!(changed(6, 1), RecordError::Kind { expected: Kind::Cage, found: 1 });
    assert_eq!(changed(6, 9), RecordError::Kind { expected: Kind::Cage, found: 9 });
    assert_eq!(changed(12, 3), RecordError::Rows { frame: 258, expected: 2, found: 3 });
    assert_eq!(changed(30, 1), RecordError::Checksum { frame: 258 });
}
