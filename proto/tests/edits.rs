//! Layers of edits: the same bytes of the same cages everywhere, frames that follow them, and files whose other bytes stay.

mod support;

use cager_proto::container::{
    ContainerReader, ContainerWriter, EditLayer, Error, LayerBuilder, LayerSource, MAX_LAYERS, SectionInfo,
};
use cager_proto::report::Report;
use serde::Deserialize;
use std::io::Cursor;
use support::{Part, frame, header, put_together, small_container, small_model, take_apart, tetrahedron};

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    what: String,
    name: String,
    old: Vec<Vec<f32>>,
    new: Vec<Vec<f32>>,
    first: Option<u32>,
    count: Option<usize>,
    raw: Option<String>,
}

/// As many frames as fill one chunk and begin another.
const FRAMES: usize = 20;

fn container() -> Vec<u8> {
    let mut writer = ContainerWriter::new(Vec::new(), &header(4), &small_model(), &tetrahedron()).unwrap();
    for k in 0..FRAMES {
        writer.write_frame(&frame(k, 4), 0.5, 1.5).unwrap();
    }
    let error = cager_proto::report::Errors { l2_mean: 0.5, ..Default::default() };
    writer.finish(Some(&Report { generator: "test".to_owned(), error, ..Report::default() })).unwrap()
}

fn open(bytes: &[u8]) -> ContainerReader<Cursor<&[u8]>> {
    ContainerReader::open(Cursor::new(bytes)).unwrap()
}

fn with(bytes: &[u8], layers: &[LayerSource]) -> Vec<u8> {
    ContainerWriter::copy_with_layers(&mut open(bytes), layers, Vec::new()).unwrap()
}

fn frames(bytes: &[u8]) -> Vec<Vec<f32>> {
    let mut reader = open(bytes);
    reader.verify().unwrap();
    let mut out = vec![Vec::new(); reader.frames()];
    out.iter_mut().enumerate().for_each(|(k, out)| reader.read_frame(k, out).unwrap());
    out
}

fn layer(first: u32, vertices: &[u32], count: usize, by: f32) -> EditLayer {
    let changes = (0..3 * vertices.len() * count).map(|k| by + k as f32 / 8.0).collect();
    EditLayer { name: "smile".to_owned(), is_on: true, first, vertices: vertices.to_vec(), changes }
}

fn edits(bytes: &[u8]) -> Vec<SectionInfo> {
    open(bytes).sections().into_iter().filter(|section| section.tag == "EDIT").collect()
}

#[test]
fn the_same_cages_give_the_same_layer_as_in_the_golden_file() {
    let golden: Golden = serde_json::from_str(include_str!("../../tests/golden/edit-layer.json")).unwrap();
    assert!(golden.cases.len() > 5);
    for Case { what, name, old, new, first, count, raw } in golden.cases {
        let mut builder = LayerBuilder::default();
        for (frame, (old, new)) in old.iter().zip(&new).enumerate() {
            builder.add(frame, old, new);
        }
        let made = builder.finish(&name);
        let hex = |layer: &EditLayer| layer.to_bytes().iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        assert_eq!(made.as_ref().map(hex), raw, "{what}");
        assert_eq!(made.as_ref().map(|made| made.first), first, "{what}");
        assert_eq!(made.map(|made| made.frames().count()), count, "{what}");
    }
}

#[test]
fn frames_follow_layers_that_are_on_and_others_keep_every_bit() {
    let bytes = container();
    let (a, b) = (layer(2, &[1, 3], 3, 1.0), layer(4, &[3], 14, -2.0));
    let off = EditLayer { is_on: false, ..layer(0, &[0], FRAMES, 9.0) };
    let edited = with(&bytes, &[a.clone(), off, b.clone()].map(LayerSource::New));
    let (before, after) = (frames(&bytes), frames(&edited));
    for k in 0..FRAMES {
        let mut right: Vec<f64> = before[k].iter().map(|&x| x.into()).collect();
        for layer in [&a, &b].into_iter().filter(|layer| layer.frames().contains(&k)) {
            for (j, &vertex) in layer.vertices.iter().enumerate() {
                let at = 3 * ((k - layer.first as usize) * layer.vertices.len() + j);
                (0..3).for_each(|c| right[3 * vertex as usize + c] += f64::from(layer.changes[at + c]));
            }
        }
        let right: Vec<f32> = right.iter().map(|&x| x as f32).collect();
        assert_eq!(after[k], right, "frame {k}");
    }
    let mut reader = open(&edited);
    let mut unedited = Vec::new();
    reader.read_frame_unedited(4, &mut unedited).unwrap();
    assert_eq!(unedited, before[4]);
    assert_eq!(reader.layers().unwrap()[2], b);
    // What was measured stays in the file, and is not told of frames that are others now.
    let report = reader.report().unwrap();
    let known: Vec<usize> = (0..FRAMES).filter(|&k| report.error.per_frame[k].l2 == 0.5).collect();
    assert_eq!(known, [0, 1, 18, 19]);
    assert!(report.error.l2_mean.is_nan());
    assert!(reader.errors().unwrap().iter().all(|error| error.l2 == 0.5));
    assert_eq!(open(&bytes).report().unwrap().error.l2_mean, 0.5);
}

#[test]
fn layers_are_added_taken_back_and_switched_without_touching_other_bytes() {
    let bytes = container();
    let one = with(&bytes, &[LayerSource::New(layer(3, &[2], 14, 0.5))]);
    assert!(one.len() < bytes.len() + 400, "{} bytes more", one.len() - bytes.len());
    let two = with(&one, &[LayerSource::Kept(0), LayerSource::New(layer(0, &[0, 1, 2, 3], FRAMES, 1.0))]);
    assert_eq!(with(&two, &[LayerSource::Kept(0)]), one);
    assert_eq!(with(&two, &[]), bytes);
    let mut second = open(&two).layers().unwrap()[1].clone();
    assert_eq!(with(&bytes, &[0, 1].map(|k| LayerSource::New(open(&two).layers().unwrap()[k].clone()))), two);
    second.is_on = false;
    let off = with(&two, &[LayerSource::Kept(0), LayerSource::New(second.clone())]);
    assert_eq!(frames(&off), frames(&one));
    second.is_on = true;
    assert_eq!(with(&off, &[LayerSource::Kept(0), LayerSource::New(second)]), two);
    for (k, part) in take_apart(&bytes).into_iter().enumerate() {
        assert_eq!(take_apart(&two)[k].payload, part.payload);
    }
}

#[test]
fn flattened_files_have_the_edited_frames_and_keep_chunks_without_any() {
    let bytes = container();
    let edited = with(&bytes, &[LayerSource::New(layer(17, &[2], 2, 0.5))]);
    let flat = ContainerWriter::copy_flattened(&mut open(&edited), None, Vec::new()).unwrap();
    assert_eq!(frames(&flat), frames(&edited));
    assert!(edits(&flat).is_empty());
    let chunk = |bytes: &[u8], first| {
        take_apart(bytes).into_iter().find(|part| part.tag == *b"FRAM" && part.frames.0 == first).unwrap().payload
    };
    assert_eq!(chunk(&flat, 0), chunk(&bytes, 0));
    let errors = open(&flat).errors().unwrap();
    assert!(errors.iter().enumerate().all(|(k, error)| error.l2.is_nan() == (17..19).contains(&k)));
}

#[test]
fn layers_that_do_not_fit_are_refused_as_they_are_written() {
    let bytes = container();
    let good = layer(0, &[0, 1], 2, 1.0);
    for bad in [
        EditLayer { vertices: vec![1, 1], ..good.clone() },
        EditLayer { vertices: vec![0, 4], ..good.clone() },
        EditLayer { vertices: vec![], ..good.clone() },
        EditLayer { changes: vec![], ..good.clone() },
        EditLayer { changes: vec![f32::NAN; 12], ..good.clone() },
        EditLayer { name: "x".repeat(257), ..good.clone() },
        EditLayer { first: FRAMES as u32 - 1, ..good.clone() },
    ] {
        let error = ContainerWriter::copy_with_layers(&mut open(&bytes), &[LayerSource::New(bad)], Vec::new());
        assert!(matches!(error, Err(Error::Invalid(_))));
    }
    let many = vec![LayerSource::New(good); MAX_LAYERS + 1];
    assert!(ContainerWriter::copy_with_layers(&mut open(&bytes), &many, Vec::new()).is_err());
    assert_eq!(open(&with(&bytes, &many[1..])).layers().unwrap().len(), MAX_LAYERS);
    assert!(ContainerWriter::copy_with_layers(&mut open(&bytes), &[LayerSource::Kept(0)], Vec::new()).is_err());
}

#[test]
fn layers_of_nothing_but_zeros_are_written_so_that_they_can_be_read() {
    let mut writer = ContainerWriter::new(Vec::new(), &header(4), &small_model(), &tetrahedron()).unwrap();
    let count = 100_000;
    (0..count).for_each(|_| writer.write_frame(&[0.0; 12], 0.0, 0.0).unwrap());
    let bytes = writer.finish(None).unwrap();
    let vertices = vec![0, 1, 2, 3];
    let zeros = EditLayer { is_on: true, vertices, changes: vec![0.0; 12 * count], ..EditLayer::default() };
    let file = with(&bytes, &[zeros.clone(), zeros.clone(), zeros].map(LayerSource::New));
    assert_eq!(open(&file).layers().unwrap().len(), 3);
    assert_eq!(edits(&file).iter().map(|section| section.codec).collect::<Vec<_>>(), [1, 0, 0]);
    assert_eq!(with(&file, &[]), bytes);
}

#[test]
fn of_cut_files_layers_that_are_whole_are_applied_and_frames_never_lost_for_them() {
    let edited = with(&container(), &[layer(3, &[2], 2, 0.5), layer(3, &[1], 2, 0.5)].map(LayerSource::New));
    let parts = take_apart(&edited);
    let whole = put_together(&parts);
    assert_eq!(whole, edited);
    let mut damaged = edited.clone();
    let at = support::extents(&edited)[parts.len() - 2].0 + support::SECTION + 9;
    damaged[at] ^= 1;
    let error = open(&damaged).read_frame(0, &mut Vec::new()).unwrap_err();
    assert!(matches!(error, Error::Corrupt { .. }), "{error}");
    let mut reader = ContainerReader::open_cut(Cursor::new(&damaged)).unwrap();
    assert!((0..FRAMES).all(|k| reader.is_intact(k, true)));
    assert_eq!((reader.lost_layers(), reader.layers().unwrap().len()), (1, 1));
    let cut = &edited[..support::extents(&edited)[parts.len() - 1].0 + 10];
    let mut reader = ContainerReader::open_cut(Cursor::new(cut)).unwrap();
    assert_eq!(reader.layers().unwrap().len(), 1);
    assert!(!reader.lacks_end() && reader.was_cut());
    assert!(!ContainerReader::open_cut(Cursor::new(&edited)).unwrap().was_cut());
}

#[test]
fn sections_of_layers_that_lie_are_refused() {
    let intact = take_apart(&small_container());
    let words = |words: &[u32], floats: usize, name: &[u8]| -> Vec<u8> {
        let words = words.iter().flat_map(|x| x.to_le_bytes());
        words.chain((0..floats).flat_map(|_| 1_f32.to_le_bytes())).chain(name.iter().copied()).collect()
    };
    let nan = [words(&[0, 1, 0], 2, b""), f32::NAN.to_le_bytes().to_vec()].concat();
    let infinite = [words(&[0, 1, 0], 2, b""), f32::MAX.to_le_bytes().to_vec()].concat();
    let long = [b'a'; 257];
    let part = |frames: (u32, u32), raw: Vec<u8>| Part { frames, ..Part::raw(*b"EDIT", 4, &raw) };
    let read = |more: &[Part]| {
        let bytes = put_together(&[&intact[..], more].concat());
        support::read_all(&bytes)
    };
    assert!(read(&[part((0, 1), words(&[0, 1, 3], 3, b"name"))]).is_ok());
    assert!(read(&[part((1, 2), words(&[1, 1, 3], 6, b""))]).is_ok());
    for (what, frames, raw) in [
        ("no frame", (0, 0), words(&[0, 1, 0], 0, b"")),
        ("frames that are not there", (2, 2), words(&[0, 1, 0], 6, b"")),
        ("more frames than can be counted", (u32::MAX, u32::MAX), words(&[0, 1, 0], 6, b"")),
        ("nothing", (0, 1), Vec::new()),
        ("no vertices", (0, 1), words(&[0, 0], 0, b"")),
        ("more vertices than there is room for", (0, 1), words(&[0, u32::MAX, 0], 3, b"")),
        ("a product that overflows", (0, 3), words(&[0, 0x5555_5556, 0], 3, b"")),
        ("too few changes", (0, 2), words(&[0, 1, 0], 3, b"")),
        ("a name that is too long", (0, 1), words(&[0, 1, 0], 3, &long)),
        ("a name that is no text", (0, 1), words(&[0, 1, 0], 3, b"\xff")),
        ("flags", (0, 1), words(&[2, 1, 0], 3, b"")),
        ("vertices that descend", (0, 1), words(&[0, 2, 1, 0], 6, b"")),
        ("a vertex twice", (0, 1), words(&[0, 2, 1, 1], 6, b"")),
        ("a vertex that is not there", (0, 1), words(&[0, 1, 4], 3, b"")),
        ("changes that are not finite", (0, 1), nan),
    ] {
        let error = read(&[part(frames, raw)]).unwrap_err();
        assert!(matches!(error, Error::Corrupt { .. }), "{what}: {error}");
    }
    let far = part((0, 1), infinite);
    let error = read(&[far.clone(), far]).unwrap_err();
    assert!(error.to_string().contains("the edited cage of frame 0 is not finite"), "{error}");
    let one = part((0, 1), words(&[0, 1, 3], 3, b""));
    assert!(read(&vec![one.clone(); MAX_LAYERS]).is_ok());
    assert!(read(&vec![one.clone(); MAX_LAYERS + 1]).is_err());
    assert!(read(&[Part { width: 1, ..one.clone() }]).is_err());
    assert!(read(&[Part { codec: 3, ..one }]).is_err());
}
