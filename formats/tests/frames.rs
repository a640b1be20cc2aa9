//! What users rely on when frames are read and written.

mod support;

use std::fs;
use std::path::Path;

use cager_core::mesh::Polygons;
use cager_formats::{
    CacheFormat, Error, FrameOptions, FrameReader, create_frames, open_frames, open_frames_bytes, read_model,
};
use support::*;
use tempfile::tempdir;

fn format(name: &str) -> CacheFormat {
    CacheFormat::ALL.into_iter().find(|format| name.ends_with(format.extension())).unwrap()
}

fn open<'a>(name: &str, bytes: &'a [u8], points: usize) -> Result<Box<dyn FrameReader + 'a>, Error> {
    open_frames_bytes(format(name), Path::new(name), bytes, points)
}

fn all(reader: &mut dyn FrameReader) -> Vec<Vec<f64>> {
    let (mut frames, mut frame) = (Vec::new(), vec![5.0; 99]);
    while reader.read_next(&mut frame).unwrap() {
        assert_eq!(frame.len(), 3 * reader.points());
        frames.push(frame.clone());
    }
    assert!(frame.is_empty() && frames.len() == reader.frames());
    frames
}

fn two_frames() -> Vec<Vec<f64>> {
    coordinates().chunks(6).map(|frame| frame.iter().map(|&x| x.into()).collect()).collect()
}

#[test]
fn every_cache_gives_the_same_frames() {
    for (name, bytes) in caches() {
        let mut reader = open(name, &bytes, 2).unwrap();
        assert_eq!((reader.points(), reader.frames()), (2, 2), "{name}");
        assert_eq!(all(&mut *reader), two_frames(), "{name}");
    }
}

#[test]
fn numpy_arrays_of_either_width_byte_order_and_header_version_are_read() {
    let wide: Vec<f64> = coordinates().iter().map(|&x| x.into()).collect();
    let data = [
        ("'<f4'", little(&coordinates())),
        ("'>f4'", big(&coordinates())),
        ("\"<f8\"", wide.iter().flat_map(|x| x.to_le_bytes()).collect()),
        ("'>f8'", wide.iter().flat_map(|x| x.to_be_bytes()).collect()),
    ];
    for (descr, data) in data {
        let one = npy(descr, "'shape':(2L,2,3) , 'fortran_order':False", &data);
        for version in 1..=3 {
            let mut file = one.clone();
            file[6] = version;
            if version > 1 {
                file.splice(10..10, [0, 0]);
            }
            assert_eq!(all(&mut *open("a.npy", &file, 2).unwrap()), two_frames(), "{descr} version {version}");
        }
    }
}

#[test]
fn an_array_of_points_is_one_frame() {
    let file = npy("'<f4'", "'fortran_order': False, 'shape': (4, 3), ", &little(&coordinates()));
    assert_eq!(all(&mut *open("a.npy", &file, 4).unwrap()), [two_frames().concat()]);
}

#[test]
fn arrays_that_are_not_read_are_described_with_the_line_that_converts_them() {
    let of = |descr, rest| message(open("a.npy", &npy(descr, rest, &[0; 48]), 2));
    let error = of("'<i4'", "'fortran_order': False, 'shape': (2, 2, 3)");
    assert_eq!(
        error,
        "a.npy: has values of type \"<i4\", not 32- or 64-bit floats; \
         convert it with numpy.save(path, numpy.load(path).astype('<f4'))"
    );
    assert!(of("[('x', '<f4'), ('y', '<f4', (2,))]", "'fortran_order': False, 'shape': (2,)").contains("has records"));
    assert!(of("'<f4'", "'fortran_order': True, 'shape': (2, 2, 3)").contains("numpy.ascontiguousarray"));
    let error = of("'<f4'", "'fortran_order': False, 'shape': (2, 6)");
    assert!(error.contains("has the shape [2, 6], not (frames, points, 3); convert it with"), "{error}");
    assert!(of("'<f4'", "'fortran_order': False, 'shape': (2, 2, 3) + (1)").contains("is not understood"));
}

#[test]
fn a_cache_of_another_mesh_is_an_error_with_both_counts() {
    for (name, bytes) in caches() {
        let error = message(open(name, &bytes, 7));
        assert_eq!(
            error,
            format!("{name}: has 2 points where 7 are expected; use a capture of the same mesh as the rest pose")
        );
    }
}

#[test]
fn a_cache_of_another_size_than_promised_is_an_error_with_whole_frames_and_bytes() {
    for (name, bytes) in caches() {
        let error = message(open(name, &bytes[..bytes.len() - 5], 2));
        assert!(error.contains("promises 2 frames and has 1 whole frames, 5 bytes are missing; "), "{error}");
        let error = message(open(name, &[bytes, vec![0; 7]].concat(), 2));
        assert!(error.contains("promises 2 frames and has 2 whole frames, 7 bytes are in excess; "), "{error}");
    }
}

#[test]
fn nan_and_infinity_are_errors_that_name_frame_and_point() {
    for (name, mut bytes) in caches() {
        let culprit = bytes.len() - 8;
        let infinity = f32::NEG_INFINITY;
        bytes[culprit..culprit + 4].copy_from_slice(&if name == "a.mdd" {
            infinity.to_be_bytes()
        } else {
            infinity.to_le_bytes()
        });
        let mut reader = open(name, &bytes, 2).unwrap();
        let mut frame = Vec::new();
        assert!(reader.read_next(&mut frame).unwrap());
        for _ in 0..2 {
            let error = message(reader.read_next(&mut frame));
            assert!(error.starts_with(&format!("{name}: frame 1: point 1 has a coordinate that is NaN")), "{error}");
        }
    }
}

#[test]
fn a_capture_without_frames_or_points_is_an_error() {
    let none = npy("'<f4'", "'fortran_order': False, 'shape': (0, 2, 3)", &[]);
    assert!(message(open("a.npy", &none, 2)).contains("has no frames"));
    let none = npy("'<f4'", "'fortran_order': False, 'shape': (2, 0, 3)", &[]);
    assert!(message(open("a.npy", &none, 0)).contains("has no points"));
}

#[test]
fn caches_are_written_byte_for_byte_as_other_programs_write_them() {
    let folder = tempdir().unwrap();
    let mut header = b"\x93NUMPY\x01\0\x76\0{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2, 3), }".to_vec();
    header.resize(127, b' ');
    header.push(b'\n');
    let npy = [header, little(&coordinates())].concat();
    for (name, golden) in [("a.npy", npy), ("a.pc2", pc2()), ("a.mdd", mdd())] {
        let path = folder.path().join(name);
        let mut writer = create_frames(&path, 2, 2, &Polygons::new(), &FrameOptions::default()).unwrap();
        for frame in coordinates().chunks(6) {
            writer.write_frame(frame).unwrap();
        }
        assert!(!path.exists(), "{name}");
        writer.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), golden, "{name}");
        assert_eq!(all(&mut *open_frames(&path, 2).unwrap()), two_frames(), "{name}");
    }
}

#[test]
fn frames_as_obj_files_come_back_in_order_and_with_their_faces() {
    let folder = tempdir().unwrap();
    fs::create_dir(folder.path().join("there")).unwrap();
    let (points, frames) = (3, 12);
    let value = |frame: usize, k: usize| (frame as f32 + 0.1) * [1.0, 1e-30, 16_777_217.0][k % 3] / 3.0;
    for name in ["new", "slash.d/", "there"] {
        let path = folder.path().join(name);
        let mut writer =
            create_frames(&path, points, frames, &polygons(&[&[0, 1, 2]]), &FrameOptions::default()).unwrap();
        for frame in 0..frames {
            writer.write_frame(&(0..9).map(|k| value(frame, k)).collect::<Vec<_>>()).unwrap();
        }
        writer.finish().unwrap();
        assert_eq!(read_model(&path.join("frame_0011.obj")).unwrap().faces, polygons(&[&[0, 1, 2]]));
        for (frame, found) in all(&mut *open_frames(&path, points).unwrap()).iter().enumerate() {
            let narrow: Vec<_> = found.iter().map(|&x| x as f32).collect();
            assert_eq!(narrow, (0..9).map(|k| value(frame, k)).collect::<Vec<_>>(), "{name}");
        }
    }
}

#[test]
fn an_output_that_is_not_finished_leaves_nothing() {
    let folder = tempdir().unwrap();
    for name in ["a.npy", "a.pc2", "a.mdd", "frames"] {
        let begin =
            |frames| create_frames(folder.path().join(name), 2, frames, &Polygons::new(), &FrameOptions::default());
        let mut writer = begin(2).unwrap();
        writer.write_frame(&[0.0; 6]).unwrap();
        drop(writer);

        let mut writer = begin(2).unwrap();
        writer.write_frame(&[0.0; 6]).unwrap();
        let error = message(writer.finish());
        assert!(error.contains("was announced with 2 frames but given 1; "), "{error}");

        let mut writer = begin(1).unwrap();
        writer.write_frame(&[0.0; 6]).unwrap();
        assert!(message(writer.write_frame(&[0.0; 6])).contains("was announced with 1 frames but given 2; "));
        drop(writer);

        let mut writer = begin(1).unwrap();
        assert!(matches!(writer.write_frame(&[0.0; 9]), Err(Error::PointCount { frame: Some(0), .. })));
        let nan = writer.write_frame(&[0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0]);
        assert!(matches!(nan, Err(Error::NonFinite { frame: 0, point: 1, .. })));
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn outputs_that_make_no_sense_are_refused() {
    let folder = tempdir().unwrap();
    let create = |name: &str, points, frames, faces: &Polygons, fps| {
        create_frames(folder.path().join(name), points, frames, faces, &FrameOptions { fps, ..FrameOptions::default() })
            .map(drop)
    };
    let none = Polygons::new();
    let error = message(create("a.abc", 1, 1, &none, 24.0));
    assert!(error.ends_with("end the name in one of .npy .pc2 .mdd, or in / for a folder of .obj files"), "{error}");
    assert!(matches!(create("a.npy", 0, 1, &none, 24.0), Err(Error::Invalid { .. })));
    assert!(matches!(create("a.npy", 1, 0, &none, 24.0), Err(Error::Invalid { .. })));
    assert!(matches!(create("a.mdd", 1, 1, &none, f64::NAN), Err(Error::Invalid { .. })));
    assert!(matches!(create("a.pc2", 1 << 31, 1, &none, 24.0), Err(Error::Unsupported { .. })));
    assert!(matches!(create("dir", 2, 1, &polygons(&[&[0, 1, 2]]), 24.0), Err(Error::Invalid { .. })));
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/a"), "").unwrap();
    assert!(matches!(create("full", 1, 1, &none, 24.0), Err(Error::Target { .. })));
}

/// A folder of one-point frames whose x is their number.
fn numbered(files: &[&str]) -> tempfile::TempDir {
    let folder = tempdir().unwrap();
    for name in files {
        let number: String = name.chars().filter(char::is_ascii_digit).collect();
        fs::write(folder.path().join(name), format!("v {number} 0 0\n")).unwrap();
    }
    folder
}

fn numbers(reader: &mut dyn FrameReader) -> Vec<f64> {
    all(reader).iter().map(|frame| frame[0]).collect()
}

#[test]
fn a_folder_gives_its_mesh_files_in_natural_order_and_nothing_else() {
    let folder = numbered(&["10.obj", "2.OBJ", "1.obj", "100.obj", "99.txt", ".5.obj"]);
    fs::create_dir(folder.path().join("7.obj")).unwrap();
    assert_eq!(numbers(&mut *open_frames(folder.path(), 1).unwrap()), [1.0, 2.0, 10.0, 100.0]);
}

#[test]
fn a_pattern_gives_its_matches_in_natural_order() {
    let folder = numbered(&["b10.obj", "b2.obj", "a3.obj", "b9.txt"]);
    let pattern = |end: &str| folder.path().join(end);
    assert_eq!(numbers(&mut *open_frames(pattern("b*"), 1).unwrap()), [2.0, 10.0]);
    assert_eq!(numbers(&mut *open_frames(pattern("[ab]?.obj"), 1).unwrap()), [3.0, 2.0]);
    assert!(message(open_frames(pattern("c*.obj"), 1)).contains("c*.obj: holds no mesh files; "));
    assert!(message(open_frames(pattern("**b"), 1)).contains("is not a pattern"));
    fs::write(pattern("x.npy"), npy_f4()).unwrap();
    assert_eq!(open_frames(pattern("*.npy"), 2).unwrap().frames(), 2);
}

#[test]
fn a_folder_whose_name_looks_like_a_pattern_is_a_folder() {
    let outer = tempdir().unwrap();
    let folder = outer.path().join("take[1]");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("1.obj"), "v 1 0 0").unwrap();
    assert_eq!(open_frames(&folder, 1).unwrap().frames(), 1);
}

#[test]
fn one_mesh_file_is_one_frame() {
    let folder = numbered(&["4.obj"]);
    assert_eq!(numbers(&mut *open_frames(folder.path().join("4.obj"), 1).unwrap()), [4.0]);
}

#[test]
fn frames_need_no_faces_of_their_own() {
    let folder = tempdir().unwrap();
    fs::write(folder.path().join("1.obj"), "v 1 0 0\nf 1 2 3\nf x\n").unwrap();
    assert_eq!(numbers(&mut *open_frames(folder.path(), 1).unwrap()), [1.0]);
}

#[test]
fn folders_that_are_no_capture_are_refused_with_the_reason() {
    let mixed = numbered(&["1.obj", "2.obj"]);
    fs::write(mixed.path().join("3.ply"), "").unwrap();
    assert!(message(open_frames(mixed.path(), 1)).contains("mixes mesh formats (2 .obj, 1 .ply); "));
    let empty = numbered(&["1.txt"]);
    assert!(message(open_frames(empty.path(), 1)).contains("holds no mesh files; "));
    assert!(message(open_frames(empty.path().join("1.txt"), 1)).contains("is not a capture that is read; give .npy"));
    assert!(message(open_frames(empty.path().join("2.npy"), 1)).contains("cannot be read ("));
}

#[test]
fn a_bad_file_in_a_sequence_is_named_with_its_frame() {
    let folder = numbered(&["1.obj", "2.obj"]);
    let second = folder.path().join("2.obj");
    let mut frame = Vec::new();
    for (text, wanted) in [
        ("v 1 0 0\nv 2 0 0\n", "frame 1 has 2 points where 1 are expected; "),
        ("v 1 0 inf\n", "frame 1: line 1: the vertex has a coordinate that is NaN"),
        ("v 1 0\n", "frame 1: line 1: the vertex has 2 coordinates"),
    ] {
        fs::write(&second, text).unwrap();
        let mut reader = open_frames(folder.path(), 1).unwrap();
        assert!(reader.read_next(&mut frame).unwrap());
        let error = message(reader.read_next(&mut frame));
        assert!(error.starts_with(&format!("{}: {wanted}", second.display())), "{error}");
    }
}
