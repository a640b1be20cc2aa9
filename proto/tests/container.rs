//! What is written into a container comes back, and other containers are refused for the right reason.

mod support;

use cager_core::coordinates::Refinement;
use cager_geometry::mesh::{Model, Polygons, TriMesh};
use cager_proto::container::{CHUNK_FRAMES, ContainerReader, ContainerWriter, Error};
use cager_proto::report::{FrameError, Report};
use proptest::prelude::*;
use proptest::test_runner::Config;
use std::io::Cursor;
use support::{PRELUDE, Part, SECTION, header, put_together, small_container, small_model, take_apart, tetrahedron};

type Reader<'a> = ContainerReader<Cursor<&'a [u8]>>;

fn open(bytes: &[u8]) -> Result<Reader<'_>, Error> {
    ContainerReader::open(Cursor::new(bytes))
}

fn frames(reader: &mut Reader<'_>, order: impl IntoIterator<Item = usize>) -> Vec<Vec<f32>> {
    let read = |k| {
        let mut out = vec![f32::NAN; 3];
        reader.read_frame(k, &mut out).unwrap();
        out
    };
    order.into_iter().map(read).collect()
}

/// The width in which a section's numbers are stored.
fn width(bytes: &[u8], tag: &[u8; 4]) -> u8 {
    take_apart(bytes).iter().find(|p| p.tag == *tag).unwrap().width
}

proptest! {
    #![proptest_config(Config { cases: 48, failure_persistence: None, ..Config::default() })]

    #[test]
    fn every_mesh_and_frame_comes_back_bit_for_bit((rest, cage, frames) in meshes_and_frames()) {
        let rows = cage.vertices.len();
        let mut writer = ContainerWriter::new(Vec::new(), &header(rows as u32), &rest, &cage).unwrap();
        for frame in &frames {
            writer.write_frame(frame, 0.0, 0.0).unwrap();
        }
        let bytes = writer.finish(None).unwrap();
        let mut reader = open(&bytes).unwrap();
        reader.verify().unwrap();
        // Equality of numbers would take -0 for 0.
        let bits = |points: &[[f64; 3]]| points.iter().map(|p| p.map(f64::to_bits)).collect::<Vec<_>>();
        let (found_rest, found_cage) = (reader.rest().unwrap(), reader.cage().unwrap());
        prop_assert_eq!(bits(&found_rest.points), bits(&rest.points));
        prop_assert_eq!(found_rest.faces, rest.faces);
        prop_assert_eq!(bits(&found_cage.vertices), bits(&cage.vertices));
        prop_assert_eq!(found_cage.triangles, cage.triangles);
        prop_assert_eq!(reader.frames(), frames.len());
        let mut out = Vec::new();
        for (k, frame) in frames.iter().enumerate() {
            reader.read_frame(k, &mut out).unwrap();
            prop_assert!(out.iter().map(|x| x.to_bits()).eq(frame.iter().map(|x| x.to_bits())));
        }
    }
}

fn meshes_and_frames() -> impl Strategy<Value = (Model, TriMesh, Vec<Vec<f32>>)> {
    let double = any::<f64>().prop_filter("stored numbers are finite", |x| x.is_finite());
    let single = any::<f32>().prop_filter("stored numbers are finite", |x| x.is_finite());
    let points = |number: BoxedStrategy<f64>| prop::collection::vec(prop::array::uniform3(number), 1..40);
    let either = prop_oneof![points(double.boxed()), points(single.clone().prop_map(f64::from).boxed())];
    (either.clone(), either).prop_flat_map(move |(rest, cage)| {
        let (n, m) = (rest.len() as u32, cage.len() as u32);
        let faces = prop::collection::vec(prop::collection::vec(0..n, 3..7), 0..30);
        let triangles = prop::collection::vec(prop::array::uniform3(0..m), 0..30);
        let frames = prop::collection::vec(prop::collection::vec(single.clone(), 3 * cage.len()), 0..20);
        (faces, triangles, frames).prop_map(move |(faces, triangles, frames)| {
            let mut polygons = Polygons::new();
            faces.iter().for_each(|f| polygons.push(f));
            (
                Model { points: rest.clone(), faces: polygons, ..Model::default() },
                TriMesh { vertices: cage.clone(), triangles },
                frames,
            )
        })
    })
}

#[test]
fn point_cloud_comes_back_without_faces() {
    let rest = Model { points: small_model().points, ..Model::default() };
    let bytes = support::write(&rest, &tetrahedron(), 2, None);
    let mut reader = open(&bytes).unwrap();
    reader.verify().unwrap();
    assert_eq!(reader.rest().unwrap(), rest);
    assert!(reader.sections().iter().all(|s| s.tag != "RFAC"));
}

#[test]
fn any_number_of_frames_comes_back_across_chunks() {
    for count in [0, 1, 15, 16, 17, 33] {
        let bytes = support::write(&small_model(), &tetrahedron(), count, None);
        let mut reader = open(&bytes).unwrap();
        reader.verify().unwrap();
        assert_eq!(reader.frames(), count);
        let expected: Vec<Vec<f32>> = (0..count).map(|k| support::frame(k, 4)).collect();
        assert_eq!(frames(&mut reader, 0..count), expected);
        let chunks = reader.sections().iter().filter(|s| s.tag == "FRAM").count();
        assert_eq!(chunks, count.div_ceil(CHUNK_FRAMES));
        let error = reader.read_frame(count, &mut Vec::new()).unwrap_err();
        assert!(matches!(error, Error::NoSuchFrame { frame, frames } if (frame, frames) == (count, count)), "{error}");
    }
}

#[test]
fn frames_are_read_in_any_order() {
    let bytes = support::write(&small_model(), &tetrahedron(), 50, None);
    let mut reader = open(&bytes).unwrap();
    let order: Vec<usize> = (0..200).map(|k| (k * 37 + k / 7) % 50).collect();
    let expected: Vec<Vec<f32>> = order.iter().map(|&k| support::frame(k, 4)).collect();
    assert_eq!(frames(&mut reader, order), expected);
}

#[test]
fn positions_take_single_precision_only_where_it_is_exact() {
    let mut rest = small_model();
    assert_eq!(width(&support::write(&rest, &tetrahedron(), 0, None), b"RPTS"), 8);
    rest.points.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
    let bytes = support::write(&rest, &tetrahedron(), 0, None);
    assert_eq!((width(&bytes, b"RPTS"), width(&bytes, b"CVTX")), (4, 4));
    assert_eq!(open(&bytes).unwrap().rest().unwrap(), rest);
    rest.points[2][1] = 1e-300;
    assert_eq!(width(&support::write(&rest, &tetrahedron(), 0, None), b"RPTS"), 8);
}

#[test]
fn errors_and_header_come_back_with_the_counts_of_the_meshes() {
    let bytes = support::write(&small_model(), &tetrahedron(), 20, None);
    let mut reader = open(&bytes).unwrap();
    let expected: Vec<FrameError> = (0..20).map(|k| FrameError { l2: f64::from(k), linf: f64::from(2 * k) }).collect();
    assert_eq!(reader.errors().unwrap(), expected);
    let found = reader.header();
    assert_eq!((found.points, found.rest_faces, found.rest_corners), (4, 4, 12));
    assert_eq!((found.cage_vertices, found.cage_faces, found.rows_per_frame), (4, 4, 4));
    assert_eq!((found.coordinates.as_str(), found.lambda, found.frame_rate), ("mvc", 1.0, None));
}

#[test]
fn colours_come_back_or_are_absent_and_are_there_once_for_every_point() {
    let rest = Model { colors: vec![[255, 0, 7], [1, 2, 3], [0; 3], [9, 8, 200]], ..small_model() };
    let bytes = support::write(&rest, &tetrahedron(), 2, None);
    let mut reader = open(&bytes).unwrap();
    reader.verify().unwrap();
    assert_eq!((reader.rest().unwrap(), reader.colors().unwrap()), (small_model(), rest.colors));
    let parts = take_apart(&bytes);
    let place = parts.iter().position(|p| p.tag == *b"rcol").unwrap();
    // Damaged ones do not keep the positions from being decoded.
    let mut damaged = bytes.clone();
    let header = bytes.windows(4).position(|window| window == b"rcol").unwrap();
    damaged[header + 40] ^= 1;
    let mut reader = open(&damaged).unwrap();
    assert!(reader.colors().is_err() && reader.rest().is_ok() && reader.verify().is_err());
    let twice = [parts[place].clone(), parts[place].clone()].to_vec();
    let wider = vec![Part { width: 3, ..parts[place].clone() }];
    for wrong in [twice, wider, vec![Part::raw(*b"rcol", 1, &[1; 11])]] {
        let mut parts = parts.clone();
        parts.splice(place..=place, wrong);
        assert!(matches!(open(&put_together(&parts)), Err(Error::Corrupt { .. })));
    }
}

#[test]
fn boundary_elements_come_back_or_are_absent_and_are_there_once() {
    let bytes = small_container();
    assert_eq!(open(&bytes).unwrap().elements().unwrap().as_deref(), Some(&support::ELEMENTS[..]));
    let without = support::write(&small_model(), &tetrahedron(), 2, None);
    assert_eq!(open(&without).unwrap().elements().unwrap(), None);
    let mut parts = take_apart(&bytes);
    let place = parts.iter().position(|p| p.tag == *b"ELEM").unwrap();
    parts.insert(place, parts[place].clone());
    assert!(matches!(open(&put_together(&parts)), Err(Error::Corrupt { .. })));
    parts.remove(place);
    parts[place].width = 4;
    assert!(matches!(open(&put_together(&parts)), Err(Error::Corrupt { .. })));
}

#[test]
fn report_comes_back_with_what_the_other_sections_say() {
    let mut written = Report {
        generator: "cager 9".to_owned(),
        triangles: 4,
        refinement: Some(Refinement { elements: 100, refinements: 2, change: 1e-4 }),
        singular_values: vec![1.0, 0.1, 1e-17],
        handle_indices: vec![3, 0, u32::MAX],
        warnings: vec!["ünïcode".to_owned()],
        ..Report::default()
    };
    // Times differ from run to run, and the file would with them.
    written.seconds.total = 5.0;
    let bytes = support::write(&small_model(), &tetrahedron(), 2, Some(&written));
    let mut reader = open(&bytes).unwrap();
    let found = reader.report().unwrap();
    let told = [(0.0, 0.0), (1.0, 2.0)].map(|(l2, linf)| FrameError { l2, linf });
    assert_eq!(found.error.per_frame, told);
    assert_eq!(found.error.worst.map(|worst| (worst.frame, worst.distance)), Some((1, 2.0 * found.diagonal)));
    assert_eq!((found.points, found.cage_faces, found.frames), (4, 4, 2));
    // 12 corners of 4 bytes; two frames of four points.
    assert_eq!((found.bytes.capture, found.bytes.output), (48 + 2 * 4 * 12, bytes.len() as u64));
    let expected = Report {
        generator: written.generator,
        triangles: written.triangles,
        refinement: written.refinement,
        singular_values: written.singular_values,
        handle_indices: written.handle_indices,
        warnings: written.warnings,
        frames: 2,
        diagonal: found.diagonal,
        error: found.error.clone(),
        bytes: found.bytes,
        ..Report::new(reader.header())
    };
    assert_eq!(found, expected);
}

#[test]
fn report_of_a_file_without_one_is_what_the_other_sections_say() {
    let bytes = support::write(&small_model(), &tetrahedron(), 1, None);
    let found = open(&bytes).unwrap().report().unwrap();
    assert_eq!((found.points, found.frames, found.rank, found.generator.as_str()), (4, 1, 0, ""));
}

#[test]
fn report_with_figures_that_are_not_finite_can_be_read() {
    // A capture that stands still has no spread to divide by, and a cage may have an infinite condition number.
    let mut report = Report::default();
    report.error.kg_percent = f64::NAN;
    report.condition_number.full = f64::INFINITY;
    let bytes = support::write(&small_model(), &tetrahedron(), 1, Some(&report));
    let mut reader = open(&bytes).unwrap();
    reader.verify().unwrap();
    let found = reader.report().unwrap();
    assert!(found.error.kg_percent.is_nan() && found.condition_number.full.is_nan());
    assert_eq!(found.error.l2_max, 0.0);
    // Earlier programs read numbers alone: where some were not computed, files have none.
    report.singular_values = vec![2.0, f64::NAN, 0.5];
    let bytes = support::write(&small_model(), &tetrahedron(), 1, Some(&report));
    assert!(open(&bytes).unwrap().report().unwrap().singular_values.is_empty());
    let json = serde_json::to_vec(&report).unwrap();
    let found: Report = serde_json::from_slice(&json).unwrap();
    assert!(matches!(found.singular_values[..], [2.0, unknown, 0.5] if unknown.is_nan()));
}

#[test]
fn report_of_another_version_can_be_read() {
    let mut parts = take_apart(&small_container());
    parts.retain(|p| p.tag != *b"summ");
    let text = br#"{"generator":"another","new":[1],"capture_bytes":7,"error":{"l2_max":0.5}}"#;
    parts.push(Part::raw(*b"summ", 1, text));
    let report = open(&put_together(&parts)).unwrap().report().unwrap();
    assert_eq!((report.generator.as_str(), report.error.l2_max, report.rank), ("another", 0.5, 0));
}

#[test]
fn same_input_gives_the_same_bytes() {
    let report = Report { singular_values: vec![0.1; 30], ..Report::default() };
    let write = || support::write(&small_model(), &tetrahedron(), 40, Some(&report));
    assert_eq!(write(), write());
}

#[test]
fn frame_of_another_length_or_with_nan_is_refused_by_number_and_leaves_the_rest_intact() {
    let mut writer = ContainerWriter::new(Vec::new(), &header(4), &small_model(), &tetrahedron()).unwrap();
    writer.write_frame(&support::frame(0, 4), 0.0, 0.0).unwrap();
    let mut bad = support::frame(1, 4);
    let error = writer.write_frame(&bad[..11], 0.0, 0.0).unwrap_err();
    assert_eq!(error.to_string(), "frame 1 cannot be stored: it has 11 numbers, not 3 × 4");
    bad[7] = f32::NAN;
    let error = writer.write_frame(&bad, 0.0, 0.0).unwrap_err();
    assert_eq!(error.to_string(), "frame 1 cannot be stored: cage vertex 2 is not finite");
    bad[7] = f32::NEG_INFINITY;
    writer.write_frame(&bad, 0.0, 0.0).unwrap_err();
    writer.write_frame(&support::frame(1, 4), 0.0, 0.0).unwrap();
    let bytes = writer.finish(None).unwrap();
    let mut reader = open(&bytes).unwrap();
    assert_eq!(frames(&mut reader, 0..2), [support::frame(0, 4), support::frame(1, 4)]);
}

#[test]
fn meshes_that_no_reader_would_take_are_not_written() {
    let refused = |rows, rest: &Model, cage: &TriMesh| match ContainerWriter::new(Vec::new(), &header(rows), rest, cage)
    {
        Err(error @ Error::Invalid(_)) => error.to_string(),
        other => panic!("{:?}", other.err()),
    };
    let (rest, cage) = (small_model(), tetrahedron());
    assert_eq!(refused(0, &rest, &cage), "cannot be stored: a frame without rows");
    let mut bad = rest.clone();
    bad.points[3][0] = f64::NAN;
    assert_eq!(refused(4, &bad, &cage), "cannot be stored: point 3 of the model is not finite");
    let mut bad = cage.clone();
    bad.triangles[0][1] = 4;
    assert_eq!(refused(4, &rest, &bad), "cannot be stored: a face of the cage names point 4 of 4");
    let mut long = header(4);
    long.regularizer = "x".repeat(70_000);
    assert!(matches!(ContainerWriter::new(Vec::new(), &long, &rest, &cage), Err(Error::TooLarge(_))));
}

#[test]
fn what_readers_would_refuse_is_not_called_too_large() {
    let mut writer = ContainerWriter::new(Vec::new(), &header(4), &small_model(), &tetrahedron()).unwrap();
    writer.write_frame(&support::frame(0, 4), 0.0, 0.0).unwrap();
    let error = writer.write_group(&[0], None, &[(0.0, 0.0)]).unwrap_err();
    assert!(matches!(&error, Error::Invalid(what) if what.contains("after single ones")), "{error}");
    let error = writer.add_frame_numbers(&[2.0, 1.0]).unwrap_err();
    assert!(matches!(&error, Error::Invalid(what) if what.contains("ascending")), "{error}");
}

#[test]
fn data_that_compresses_beyond_what_readers_expand_can_be_read() {
    // A flat point cloud: two kilobytes once compressed, more than readers expand so small a file to.
    let rest = Model { points: vec![[0.5; 3]; 2 << 20], ..Model::default() };
    let bytes = support::write(&rest, &tetrahedron(), 1, None);
    let mut reader = open(&bytes).unwrap();
    reader.verify().unwrap();
    assert_eq!(reader.rest().unwrap(), rest);
}

#[test]
fn unknown_optional_section_is_skipped() {
    let bytes = small_container();
    let mut reader = open(&bytes).unwrap();
    reader.verify().unwrap();
    assert!(reader.sections().iter().any(|s| s.tag == "note" && s.raw_bytes == 16));
    // Its codec may be unknown too.
    let mut parts = take_apart(&bytes);
    parts.iter_mut().find(|p| p.tag == *b"note").unwrap().codec = 99;
    open(&put_together(&parts)).unwrap().verify().unwrap();
}

#[test]
fn unknown_required_section_is_refused_by_name() {
    let mut parts = take_apart(&small_container());
    parts.push(Part::raw(*b"UVST", 4, &[0; 8]));
    let Err(error) = open(&put_together(&parts)) else { panic!("opened") };
    assert_eq!(
        error.to_string(),
        r#"needs the feature "UVST", which this program does not have; use a newer cager, or encode the capture again where one before 0.2.0 wrote it"#
    );
}

#[test]
fn unknown_codec_of_a_known_section_is_refused_by_number() {
    let mut parts = take_apart(&small_container());
    parts.iter_mut().find(|p| p.tag == *b"FRAM").unwrap().codec = 7;
    let bytes = put_together(&parts);
    let error = open(&bytes).unwrap().read_frame(0, &mut Vec::new()).unwrap_err();
    assert!(matches!(&error, Error::UnknownSection(name) if name == "codec 7"), "{error}");
}

#[test]
fn later_version_is_refused_by_number() {
    let mut bytes = small_container();
    bytes[8] = 2;
    support::fix_checksums(&mut bytes, &[]);
    let Err(error) = open(&bytes) else { panic!("opened") };
    assert!(matches!(error, Error::NewerVersion(2)), "{error}");
}

#[test]
fn flags_that_this_version_does_not_know_are_refused() {
    let mut bytes = small_container();
    bytes[10] = 1;
    support::fix_checksums(&mut bytes, &[]);
    assert!(matches!(open(&bytes), Err(Error::UnknownSection(name)) if name == "flags"));
}

#[test]
fn reserved_bytes_of_a_section_must_be_zero() {
    let mut bytes = small_container();
    let sections = support::extents(&bytes);
    bytes[PRELUDE + 6] = 1;
    support::fix_checksums(&mut bytes, &sections);
    assert!(matches!(open(&bytes), Err(Error::Corrupt { offset: 22, .. })));
}

#[test]
fn required_sections_must_be_there_exactly_once() {
    let parts = take_apart(&small_container());
    for k in 0..parts.len() {
        let tag = String::from_utf8_lossy(&parts[k].tag).into_owned();
        let mut without = parts.clone();
        without.remove(k);
        let optional = ["ELEM", "summ", "note"].contains(&tag.as_str());
        assert_eq!(support::read_all(&put_together(&without)).is_ok(), optional, "without {tag}");
        let mut twice = parts.clone();
        twice.push(parts[k].clone());
        assert_eq!(support::read_all(&put_together(&twice)).is_ok(), tag == "note", "{tag} twice");
    }
}

#[test]
fn other_files_are_told_from_cut_ones() {
    for other in [&b""[..], b"v 0 0 0\nv 1 0 0\n", b"glTF", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", &[0; 500]] {
        assert!(matches!(open(other), Err(Error::NotAContainer)));
    }
    let bytes = small_container();
    for length in [1, 7, 8, 15, 16, 50, 79, bytes.len() - 1] {
        let Err(error) = open(&bytes[..length]) else { panic!("opened") };
        assert!(matches!(error, Error::Corrupt { .. }), "{length} bytes: {error}");
    }
    // What a transfer in text mode does to line ends.
    let text: Vec<u8> = bytes.iter().copied().filter(|&b| b != b'\r').collect();
    assert!(matches!(open(&text), Err(Error::NotAContainer)));
}

#[test]
fn first_bytes_are_those_of_the_worked_example() {
    let document = include_str!("../../docs/FORMAT.md");
    let example = document.split("<!-- example -->").nth(1).expect("an example between two marks");
    // Lines of `offset  hex bytes  | meaning`.
    let hex = example.lines().filter(|l| l.starts_with("00")).flat_map(|l| {
        let bytes = l[4..].split('|').next().unwrap_or_default();
        bytes.split_whitespace().map(|b| u8::from_str_radix(b, 16).unwrap()).collect::<Vec<_>>()
    });
    let expected: Vec<u8> = hex.collect();
    assert_eq!(expected.len(), PRELUDE + SECTION);
    assert_eq!(small_container()[..PRELUDE + SECTION], expected);
}

#[test]
fn frame_numbers_come_back_and_are_0_1_2_where_there_are_none() {
    let (rest, cage) = (small_model(), tetrahedron());
    let written = |numbers: Option<&[f64]>| {
        let mut writer = ContainerWriter::new(Vec::new(), &header(4), &rest, &cage)?;
        for _ in 0..3 {
            writer.write_frame(&[0.5; 12], 0.0, 0.0)?;
        }
        numbers.map_or(Ok(()), |numbers| writer.add_frame_numbers(numbers))?;
        writer.finish(None)
    };
    for (numbers, expected) in [(None, [0.0, 1.0, 2.0]), (Some(&[-2.0, 1.5, 100.0][..]), [-2.0, 1.5, 100.0])] {
        let bytes = written(numbers).unwrap();
        let mut reader = open(&bytes).unwrap();
        reader.verify().unwrap();
        assert_eq!(reader.frame_numbers().unwrap(), expected);
    }
    for wrong in
        [&[1.0, 2.0][..], &[1.0, 1.0, 2.0], &[2.0, 1.0, 3.0], &[0.0, f64::NAN, 1.0], &[0.0, 1.0, f64::INFINITY]]
    {
        assert!(written(Some(wrong)).is_err(), "{wrong:?}");
    }
}
