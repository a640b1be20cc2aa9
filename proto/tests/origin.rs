//! Containers of captures far away: the section `ORIG`.

mod support;

use cager_geometry::units::Units;
use cager_proto::container::{ContainerReader, ContainerWriter, Header};
use std::io::Cursor;
use support::{Part, header, put_together, small_container, small_model, take_apart, tetrahedron};

const ORIGIN: [f64; 3] = [450_000.0, -5_400_000.0, 0.5];

fn part(origin: [f64; 3]) -> Part {
    Part::raw(*b"ORIG", 8, &origin.map(f64::to_le_bytes).concat())
}

#[test]
fn an_origin_comes_back_and_moves_no_position_in_the_file() {
    let header = Header { origin: Some(ORIGIN), ..header(4) };
    let mut writer = ContainerWriter::new(Vec::new(), &header, &small_model(), &tetrahedron()).unwrap();
    writer.write_frame(&support::frame(0, 4), 0.5, 1.5).unwrap();
    let bytes = writer.finish(None).unwrap();
    let mut reader = ContainerReader::open(Cursor::new(&bytes)).unwrap();
    reader.verify().unwrap();
    assert_eq!(reader.header().origin, Some(ORIGIN));
    assert_eq!(reader.rest().unwrap().points, small_model().points);
    assert_eq!(reader.report().unwrap().origin, Some(ORIGIN));
    assert_eq!(ContainerReader::open_cut(Cursor::new(&bytes)).unwrap().header().origin, Some(ORIGIN));
    let tags: Vec<String> = reader.sections().into_iter().map(|section| section.tag).collect();
    assert_eq!(tags[..3], ["HEAD", "ORIG", "RPTS"]);
}

#[test]
fn an_origin_is_put_into_a_file_that_otherwise_keeps_its_bytes() {
    let bytes = small_container();
    let mut reader = ContainerReader::open(Cursor::new(&bytes)).unwrap();
    let moved = ContainerWriter::copy_placed(&mut reader, (Some(ORIGIN), Units::UNKNOWN), &[], Vec::new()).unwrap();
    let mut parts = take_apart(&bytes);
    parts.insert(1, part(ORIGIN));
    assert_eq!(moved, put_together(&parts));
    let mut reader = ContainerReader::open(Cursor::new(&moved)).unwrap();
    reader.verify().unwrap();
    assert_eq!(reader.header().origin, Some(ORIGIN));
}

#[test]
fn origins_that_are_no_place_are_refused() {
    let refused = |parts: &[Part]| {
        let mut all = take_apart(&small_container());
        all.splice(1..1, parts.iter().cloned());
        support::read_all(&put_together(&all)).expect_err("no origin").to_string()
    };
    assert!(refused(&[part([0.0, f64::NAN, 0.0])]).contains("the origin is not finite"));
    assert!(refused(&[part(ORIGIN), part(ORIGIN)]).contains("ORIG is there 2 times"));
    for wrong in [Part::raw(*b"ORIG", 8, &[0; 16]), Part::raw(*b"ORIG", 4, &[0; 24])] {
        assert!(refused(&[wrong]).contains("does not have the size"));
    }
    let endless = Header { origin: Some([f64::INFINITY; 3]), ..header(4) };
    assert!(ContainerWriter::new(Vec::new(), &endless, &small_model(), &tetrahedron()).is_err());
}
