//! What positions of a container mean: the section `unit`.

mod support;

use cager_geometry::units::{Units, Up};
use cager_proto::container::{ContainerReader, ContainerWriter, Header};
use std::io::Cursor;
use support::{Part, header, put_together, small_container, small_model, take_apart, tetrahedron};

const CENTIMETRES: Units = Units::new(Up::Z, 0.01);

fn part(metres: f64, up: u8) -> Part {
    Part::raw(*b"unit", 1, &[&metres.to_le_bytes()[..], &[up]].concat())
}

fn written(units: Units) -> Vec<u8> {
    let header = Header { units, ..header(4) };
    let mut writer = ContainerWriter::new(Vec::new(), &header, &small_model(), &tetrahedron()).unwrap();
    writer.write_frame(&support::frame(0, 4), 0.5, 1.5).unwrap();
    writer.finish(None).unwrap()
}

#[test]
fn units_come_back_as_far_as_they_are_known() {
    let known = [
        CENTIMETRES,
        Units::METRES,
        Units { up: Some(Up::Z), metres_per_unit: None },
        Units { up: None, metres_per_unit: Some(0.0254) },
        Units::UNKNOWN,
    ];
    for units in known {
        let bytes = written(units);
        let mut reader = ContainerReader::open(Cursor::new(&bytes)).unwrap();
        reader.verify().unwrap();
        assert_eq!(reader.header().units, units);
        assert_eq!(reader.rest().unwrap().points, small_model().points, "positions are as they were");
        let report = reader.report().unwrap();
        assert_eq!((report.metres_per_unit, report.up.as_deref()), (units.metres_per_unit, units.up.map(Up::name)));
        assert_eq!(ContainerReader::open_cut(Cursor::new(&bytes)).unwrap().header().units, units);
    }
}

#[test]
fn a_file_without_units_is_what_it_was_and_others_have_one_more_section() {
    let (without, with) = (take_apart(&written(Units::UNKNOWN)), take_apart(&written(CENTIMETRES)));
    assert!(without.iter().all(|part| part.tag != *b"unit"));
    let mut parts = without;
    parts.insert(1, part(0.01, 2));
    assert_eq!(put_together(&parts), put_together(&with));
}

#[test]
fn units_are_put_into_a_file_that_otherwise_keeps_its_bytes() {
    let bytes = small_container();
    let copied = |from: &[u8], place| {
        ContainerWriter::copy_placed(&mut ContainerReader::open(Cursor::new(from)).unwrap(), place, &[], Vec::new())
            .unwrap()
    };
    let origin = [450_000.0, 0.0, 0.5];
    let placed = copied(&bytes, (Some(origin), CENTIMETRES));
    let mut parts = take_apart(&bytes);
    parts.splice(1..1, [Part::raw(*b"ORIG", 8, &origin.map(f64::to_le_bytes).concat()), part(0.01, 2)]);
    assert_eq!(placed, put_together(&parts));
    assert_eq!(copied(&placed, (None, Units::UNKNOWN)), bytes, "and taken out of it");
}

#[test]
fn numbers_of_frames_are_put_where_the_writer_has_them() {
    let numbers: Vec<f64> = (0..).map(|k| 1001.0 + 0.5 * f64::from(k)).take(3).collect();
    let written = |numbers: &[f64]| {
        let mut writer = ContainerWriter::new(Vec::new(), &header(4), &small_model(), &tetrahedron()).unwrap();
        (0..3).for_each(|k| writer.write_frame(&support::frame(k, 4), 0.5, 1.5).unwrap());
        writer.add_frame_numbers(numbers).unwrap();
        writer.finish(None).unwrap()
    };
    let copied = |from: &[u8], numbers: &[f64]| {
        let mut reader = ContainerReader::open(Cursor::new(from)).unwrap();
        ContainerWriter::copy_placed(&mut reader, (None, Units::UNKNOWN), numbers, Vec::new())
    };
    let (without, with) = (written(&[0.0, 1.0, 2.0]), written(&numbers));
    assert_eq!(copied(&without, &numbers).unwrap(), with);
    assert_eq!(copied(&with, &[]).unwrap(), with);
    assert_eq!(copied(&with, &numbers).unwrap(), with, "in the place of those that are there");
    assert!(copied(&without, &numbers[..2]).is_err() && copied(&without, &[2.0, 1.0, 3.0]).is_err());
}

#[test]
fn units_that_are_none_are_refused_and_passed_over_in_files_that_are_saved() {
    let with = |parts: &[Part]| {
        let mut all = take_apart(&small_container());
        all.splice(1..1, parts.iter().cloned());
        put_together(&all)
    };
    let refused = |parts: &[Part]| support::read_all(&with(parts)).expect_err("no units").to_string();
    for metres in [-1.0, f64::NAN, f64::INFINITY, 1e-300] {
        assert!(refused(&[part(metres, 1)]).contains("a unit of"), "{metres}");
        let cut = with(&[part(metres, 1)]);
        assert_eq!(ContainerReader::open_cut(Cursor::new(&cut)).unwrap().header().units, Units::UNKNOWN);
        let header = Header { units: Units { up: None, metres_per_unit: Some(metres) }, ..header(4) };
        assert!(ContainerWriter::new(Vec::new(), &header, &small_model(), &tetrahedron()).is_err());
    }
    assert!(refused(&[part(1.0, 3)]).contains("no axis has the number 3"));
    assert!(refused(&[part(1.0, 1), part(1.0, 1)]).contains("unit is there 2 times"));
    assert!(refused(&[Part::raw(*b"unit", 1, &[0; 8])]).contains("does not have the size"));
}
