//! Bytes of any origin: never a panic, never a wrong answer, never more memory than the file's length allows.

#[path = "support/memory.rs"]
mod memory;
mod support;

use cager_proto::container::{ContainerReader, Error, Header};
use cager_proto::record::{self, FrameHeader, HEADER_BYTES, Kind, RecordError};
use cager_proto::wire;
use memory::peak_of;
use proptest::prelude::*;
use proptest::test_runner::Config;
use std::io::Cursor;
use support::{FOOTER, LINE, PRELUDE, Part, SECTION, extents, fix_checksums, put_together, read_all, small_container};

/// What `docs/FORMAT.md` allows a reader, and 1 MiB for all that is not the file's.
fn budget(file_bytes: usize) -> usize {
    (64 << 20) + 256 * file_bytes + (1 << 20)
}

#[test]
fn container_cut_anywhere_is_refused() {
    let bytes = small_container();
    assert!(read_all(&bytes).is_ok());
    for length in 0..bytes.len() {
        assert!(read_all(&bytes[..length]).is_err(), "cut to {length} bytes");
    }
}

#[test]
fn container_with_bytes_appended_is_refused() {
    let mut bytes = small_container();
    bytes.push(0);
    assert!(read_all(&bytes).is_err());
}

#[test]
fn container_with_any_bit_flipped_is_refused() {
    let mut bytes = small_container();
    for k in 0..bytes.len() {
        for bit in 0..8 {
            bytes[k] ^= 1 << bit;
            assert!(read_all(&bytes).is_err(), "bit {bit} of byte {k}");
            bytes[k] ^= 1 << bit;
        }
    }
}

#[test]
fn container_with_any_field_set_to_extremes_never_panics_or_takes_much_memory() {
    let intact = small_container();
    let sections = extents(&intact);
    let &(contents, contents_bytes) = sections.last().unwrap();
    let mut fields = vec![vec![(8, 2)], vec![(10, 2)]];
    // Tag, codec, width, reserved, first, count, payload and raw bytes.
    let of_section = [(0, 4), (4, 1), (5, 1), (6, 2), (8, 4), (12, 4), (16, 8), (24, 8)];
    for (k, &(at, length)) in sections.iter().enumerate() {
        for (field, width) in of_section {
            let (in_header, in_contents) = (at + field, contents + SECTION + LINE * k + 8 + field);
            fields.push(vec![(in_header, width)]);
            if at != contents {
                fields.push(vec![(in_contents, width)]);
                fields.push(vec![(in_header, width), (in_contents, width)]);
            }
        }
        if at != contents {
            fields.push(vec![(contents + SECTION + LINE * k, 8)]);
        }
        // Numbers inside the payload may be anywhere.
        for inside in at + SECTION..(at + SECTION + length).saturating_sub(7) {
            fields.push(vec![(inside, 4)]);
            fields.push(vec![(inside, 8)]);
        }
    }
    let footer = contents + SECTION + contents_bytes;
    assert_eq!(footer + FOOTER, intact.len());
    fields.extend([vec![(footer, 8)], vec![(footer + 8, 8)], vec![(footer + 16, 4)]]);

    for places in &fields {
        for value in extremes(intact.len()) {
            let mut bytes = intact.clone();
            for &(at, width) in places {
                bytes[at..at + width].copy_from_slice(&value.to_le_bytes()[..width]);
            }
            fix_checksums(&mut bytes, &sections);
            let (_, peak) = peak_of(|| read_all(&bytes));
            assert!(peak < budget(bytes.len()), "{peak} bytes for {value} at {places:?}");
        }
    }
}

#[test]
fn container_whose_structure_was_changed_with_right_checksums_is_refused() {
    let intact = small_container();
    let sections = extents(&intact);
    let contents = sections.last().unwrap().0;
    for (k, &(at, _)) in sections.iter().enumerate() {
        // Sizes in the header, in the table of contents, or offsets there: whatever no longer fits.
        for places in [vec![at + 16], vec![at + 24], vec![contents + SECTION + LINE * k]] {
            for value in extremes(intact.len()) {
                let mut bytes = intact.clone();
                for &at in &places {
                    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
                }
                fix_checksums(&mut bytes, &sections);
                if bytes != intact {
                    assert!(read_all(&bytes).is_err(), "{value} at {places:?}");
                }
            }
            if at == contents {
                break;
            }
        }
    }
}

#[test]
fn small_payload_that_declares_a_huge_section_takes_no_memory() {
    let payload = zstd::bulk::compress(&vec![0; 12 << 10], 3).unwrap();
    for points in [u64::from(u32::MAX), 1 << 31, 1 << 23] {
        let bytes = with_points(points, Part { raw_bytes: 12 * points, ..planes(*b"RPTS", &payload, 0) });
        let (result, peak) = peak_of(|| read_all(&bytes));
        assert!(result.is_err());
        assert!(peak < 1 << 20, "{peak} bytes for {points} points");
    }
}

#[test]
fn small_file_that_counts_many_frames_takes_no_memory() {
    let frames = 1 << 27;
    let mut parts = support::take_apart(&small_container());
    for part in &mut parts {
        match &part.tag {
            b"FRAM" => (part.frames, part.raw_bytes) = ((0, frames), 12 * 4 * u64::from(frames)),
            b"ERRS" => part.raw_bytes = 8 * u64::from(frames),
            _ => {}
        }
    }
    let (result, peak) = peak_of(|| read_all(&put_together(&parts)));
    assert!(result.unwrap_err().to_string().contains("more frames than it can hold"));
    assert!(peak < 1 << 20, "{peak} bytes");
}

#[test]
fn payload_that_expands_beyond_its_declaration_is_refused_early() {
    let payload = zstd::bulk::compress(&vec![0; 32 << 20], 3).unwrap();
    let bytes = with_points(1, planes(*b"RPTS", &payload, 12));
    let (result, peak) = peak_of(|| read_all(&bytes));
    assert!(matches!(result, Err(Error::Corrupt { .. })));
    assert!(peak < 1 << 20, "{peak} bytes");
}

#[test]
fn section_as_large_as_allowed_stays_within_the_declared_memory() {
    // Every section that decodes to other structures, as large as a file of any length may have it: 12 MiB.
    let zeros = vec![0; 12 << 20];
    let zeros = zstd::bulk::compress(&zeros, 3).unwrap();
    let raw = 12u64 << 20;
    let points = planes(*b"RPTS", &zeros, raw);
    let faces = Part { codec: 2, ..planes(*b"RFAC", &zeros, raw) };
    let header = Header { points: raw / 12, rest_faces: raw / 4, rows_per_frame: 1 << 20, ..support::header(1) };
    let parts = [
        Part::raw(
            *b"HEAD",
            1,
            &wire::encode::<_, 600>(&Header { cage_vertices: raw / 12, cage_faces: raw / 12, ..header }).unwrap(),
        ),
        points.clone(),
        faces.clone(),
        Part { tag: *b"CVTX", ..points.clone() },
        Part { tag: *b"CTRI", ..faces.clone() },
        Part { tag: *b"ELEM", width: 1, ..points.clone() },
        Part { tag: *b"FRAM", frames: (0, 1), ..faces.clone() },
        Part { tag: *b"FRAM", frames: (1, 1), ..faces },
        Part::raw(*b"ERRS", 4, &[0; 16]),
    ];
    let bytes = put_together(&parts);
    let (result, peak) = peak_of(|| read_all(&bytes));
    result.unwrap();
    assert!(peak < budget(bytes.len()), "{peak} bytes");
}

#[test]
fn layers_as_large_as_allowed_stay_within_the_declared_memory() {
    let (rows, zeros) = (1 << 20, zstd::bulk::compress(&vec![0; 12 << 20], 3).unwrap());
    let raw = 12u64 << 20;
    let points = planes(*b"RPTS", &zeros, raw);
    let faces = Part { codec: 2, ..planes(*b"RFAC", &zeros, raw) };
    let counts = Header { points: raw / 12, rest_faces: raw / 4, cage_vertices: raw / 12, ..support::header(rows) };
    let counts = Header { cage_faces: raw / 12, ..counts };
    // One change of as many vertices as there is room for, and as many layers of one.
    let vertices = ((8 << 20) - 8 - 24 * 255) / 28;
    let mut layer: Vec<u8> = [0, vertices].into_iter().chain(0..vertices).flat_map(u32::to_le_bytes).collect();
    layer.resize(layer.len() + 24 * vertices as usize, 0);
    let split: Vec<u8> = (0..4).flat_map(|k| layer.iter().skip(k).step_by(4).copied()).collect();
    let split = zstd::bulk::compress(&split, 19).unwrap();
    let small = [0u32, 1, 7, 0, 0, 0].map(u32::to_le_bytes).concat();
    let mut parts = vec![
        Part::raw(*b"HEAD", 1, &wire::encode::<_, 600>(&counts).unwrap()),
        points.clone(),
        faces.clone(),
        Part { tag: *b"CVTX", ..points },
        Part { tag: *b"CTRI", ..faces.clone() },
        Part { tag: *b"FRAM", frames: (0, 1), ..faces.clone() },
        Part { tag: *b"FRAM", frames: (1, 1), ..faces },
        Part::raw(*b"ERRS", 4, &[0; 16]),
        Part { frames: (0, 2), ..planes(*b"EDIT", &split, layer.len() as u64) },
    ];
    parts.extend(vec![Part { frames: (1, 1), ..Part::raw(*b"EDIT", 4, &small) }; 255]);
    let bytes = put_together(&parts);
    let (result, peak) = peak_of(|| read_all(&bytes));
    result.unwrap();
    assert!(peak < budget(bytes.len()), "{peak} bytes for {}", bytes.len());
    // Twice as much is refused before any of it is read.
    parts.truncate(parts.len() - 254);
    let last = parts[8].clone();
    parts.extend(vec![last; 16]);
    let bytes = put_together(&parts);
    let (result, peak) = peak_of(|| ContainerReader::open(Cursor::new(&bytes)).map(|_| ()));
    assert!(result.unwrap_err().to_string().contains("more layers of edits than it can hold"));
    assert!(peak < 1 << 20, "{peak} bytes");
}

#[test]
fn report_of_many_empty_texts_stays_within_the_declared_memory() {
    let warnings = vec![""; (4 << 20) / 3 - 200];
    let text = serde_json::to_vec(&serde_json::json!({ "warnings": warnings })).unwrap();
    let payload = zstd::bulk::compress(&text, 3).unwrap();
    let mut parts = support::take_apart(&small_container());
    parts.retain(|p| p.tag != *b"summ");
    parts.push(Part { width: 1, ..planes(*b"summ", &payload, text.len() as u64) });
    let bytes = put_together(&parts);
    let (result, peak) = peak_of(|| read_all(&bytes));
    result.unwrap();
    assert!(peak < budget(bytes.len()), "{peak} bytes");
}

#[test]
fn section_that_truly_expands_beyond_the_limit_is_refused() {
    let raw = (12u64 << 20) + 48 * 4096;
    let payload = zstd::bulk::compress(&vec![0; raw as usize], 3).unwrap();
    let bytes = with_points(raw / 12, planes(*b"RPTS", &payload, raw));
    assert!(bytes.len() < 4096);
    let (result, peak) = peak_of(|| read_all(&bytes));
    assert!(matches!(result, Err(Error::Corrupt { .. })));
    assert!(peak < 1 << 20, "{peak} bytes");
}

#[test]
fn structure_that_declares_huge_texts_and_lists_takes_little_memory() {
    for length in [1 << 16, 1 << 31, 1 << 32, 1 << 63, u64::MAX] {
        let bytes = [&length.to_le_bytes()[..], &[0; 100]].concat();
        let (text, peak) = peak_of(|| wire::decode::<String, 65_536>(&bytes));
        assert!(text.is_err() && peak < 65_536, "{peak} bytes for {length}");
        // serde reserves up to 1 MiB for a list before it has seen the elements.
        let (list, peak) = peak_of(|| wire::decode::<Vec<[u64; 4]>, 65_536>(&bytes));
        assert!(list.is_err() && peak <= 1 << 20, "{peak} bytes for {length}");
    }
}

#[test]
fn window_larger_than_the_format_allows_is_refused() {
    let mut encoder = zstd::stream::Encoder::new(Vec::new(), 3).unwrap();
    encoder.window_log(27).unwrap();
    std::io::Write::write_all(&mut encoder, &[7; 12]).unwrap();
    let bytes = with_points(1, planes(*b"RPTS", &encoder.finish().unwrap(), 12));
    assert!(matches!(read_all(&bytes), Err(Error::Corrupt { .. })));
}

#[test]
fn record_cut_anywhere_is_refused() {
    let bytes = small_record();
    for length in 0..bytes.len() {
        let error = read_record(&bytes[..length], Kind::Cage, 4).unwrap_err();
        assert!(
            matches!(error, RecordError::Incomplete { have, .. } if have == length),
            "cut to {length} bytes: {error}"
        );
    }
}

#[test]
fn record_with_any_bit_flipped_never_gives_other_rows() {
    let mut bytes = small_record();
    let (_, rows) = read_record(&bytes, Kind::Cage, 4).unwrap();
    for k in 0..bytes.len() {
        for bit in 0..8 {
            bytes[k] ^= 1 << bit;
            match read_record(&bytes, Kind::Cage, 4) {
                // The frame's number and its errors are outside of the checksum: see `proto/README.md`.
                Ok((_, read)) => assert!((8..12).contains(&k) || (16..24).contains(&k) && read == rows, "byte {k}"),
                Err(_) => assert!(!(8..12).contains(&k) && !(16..24).contains(&k), "byte {k}"),
            }
            bytes[k] ^= 1 << bit;
        }
    }
}

#[test]
fn record_with_any_field_set_to_extremes_never_panics_or_takes_much_memory() {
    let intact = small_record();
    for (at, width) in [(0, 4), (4, 2), (6, 2), (8, 4), (12, 4), (16, 4), (20, 4), (24, 4)] {
        for value in extremes(intact.len()) {
            let mut bytes = intact.clone();
            bytes[at..at + width].copy_from_slice(&value.to_le_bytes()[..width]);
            // Also where the session expects as many rows as the record declares.
            for rows in [4, value as u32] {
                let (result, peak) = peak_of(|| read_record(&bytes, Kind::Cage, rows).map(|_| ()));
                assert!(peak <= bytes.len(), "{peak} bytes for {value} at {at}");
                assert!(result.is_err() || [8, 16, 20].contains(&at) || bytes == intact, "{value} at {at}");
            }
        }
    }
}

proptest! {
    #![proptest_config(Config { cases: 300, failure_persistence: None, ..Config::default() })]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        prop_assert!(read_all(&bytes).is_err());
        let mut with_start = small_container()[..PRELUDE].to_vec();
        with_start.extend_from_slice(&bytes);
        prop_assert!(read_all(&with_start).is_err());
        prop_assert!(read_record(&bytes, Kind::Positions, 3).is_err());
        prop_assert!(wire::decode::<Header, 600>(&bytes).is_err() || bytes.len() > 80);
    }

    #[test]
    fn random_changes_with_right_checksums_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let mut bytes = small_container();
        let sections = extents(&bytes);
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        fix_checksums(&mut bytes, &sections);
        let (_, peak) = peak_of(|| read_all(&bytes));
        prop_assert!(peak < budget(bytes.len()));
    }

    #[test]
    fn random_sections_with_right_checksums_never_panic(
        parts in prop::collection::vec((0usize..9, 0u8..4, 0u8..10, any::<(u8, u8)>(), 0u64..99, prop::collection::vec(0u8..5, 0..99)), 0..6),
    ) {
        let mut all = support::take_apart(&small_container());
        for (k, codec, width, (first, count), raw_bytes, payload) in parts {
            let k = k % all.len();
            let tag = all[k].tag;
            all[k] = Part { tag, codec, width, frames: (first.into(), count.into()), raw_bytes, payload };
        }
        let bytes = put_together(&all);
        if let Ok(mut reader) = ContainerReader::open(Cursor::new(&bytes)) {
            let _ = reader.verify();
            let _ = (reader.rest(), reader.cage(), reader.errors(), reader.report());
        }
    }
}

/// The numbers that lengths go wrong at.
fn extremes(file_bytes: usize) -> [u64; 10] {
    let n = file_bytes as u64;
    [0, 1, n - 1, n, n + 1, 1 << 31, u64::from(u32::MAX), 1 << 32, 1 << 63, u64::MAX]
}

fn read_record(bytes: &[u8], kind: Kind, rows: u32) -> Result<(FrameHeader, Vec<f32>), RecordError> {
    let mut out = Vec::new();
    record::decode(bytes, kind, rows, &mut out).map(|(header, _)| (header, out))
}

fn small_record() -> Vec<u8> {
    let mut bytes = Vec::new();
    record::encode(Kind::Cage, 7, 0.25, 0.5, &support::frame(7, 4), &mut bytes).unwrap();
    assert_eq!(bytes.len(), HEADER_BYTES + 48);
    bytes
}

/// A section of width 4 in byte planes.
fn planes(tag: [u8; 4], payload: &[u8], raw_bytes: u64) -> Part {
    Part { codec: 1, raw_bytes, ..Part::raw(tag, 4, payload) }
}

/// The small container with another rest pose.
fn with_points(points: u64, section: Part) -> Vec<u8> {
    let mut parts = support::take_apart(&small_container());
    let header = wire::decode::<Header, 600>(&parts[0].payload).unwrap();
    parts[0] = Part::raw(*b"HEAD", 1, &wire::encode::<_, 600>(&Header { points, ..header }).unwrap());
    parts[1] = section;
    put_together(&parts)
}
