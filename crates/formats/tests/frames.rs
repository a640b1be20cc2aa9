//! What users rely on when frames are read and written.

mod support;

use std::fs;
use std::io::Write as _;
use std::path::Path;

use cager_formats::{
    CacheFormat, Error, FrameOptions, FrameReader, FrameSelection, create_frames, missing_frames, open_frames,
    open_frames_bytes, open_selected_frames, read_model,
};
use cager_geometry::mesh::Polygons;
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

/// Two frames of two points, as `numpy` stores them with their axes in another order, and so on.
fn rearranged(at: impl Fn(usize, usize, usize) -> usize) -> Vec<f32> {
    let mut out = vec![1.0; 16];
    for (t, frame) in coordinates().chunks(6).enumerate() {
        for (i, point) in frame.chunks(3).enumerate() {
            for (k, &x) in point.iter().enumerate() {
                out[at(t, i, k)] = x;
            }
        }
    }
    out
}

#[test]
fn arrays_whose_axes_come_in_another_order_are_read_and_not_scrambled() {
    let read = |rest: &str, data: &[f32]| all(&mut *open("a.npy", &npy("'<f4'", rest, &little(data)), 2).unwrap());
    let axes = rearranged(|t, i, k| 6 * t + 2 * k + i);
    assert_eq!(read("'fortran_order': False, 'shape': (2, 3, 2)", &axes[..12]), two_frames());
    let fourth = rearranged(|t, i, k| 8 * t + 4 * i + k);
    assert_eq!(read("'fortran_order': False, 'shape': (2, 2, 4)", &fourth), two_frames());
    let fortran = rearranged(|t, i, k| t + 2 * i + 4 * k);
    assert_eq!(read("'fortran_order': True, 'shape': (2, 2, 3)", &fortran[..12]), two_frames());
    let both = rearranged(|t, i, k| t + 2 * k + 6 * i);
    assert_eq!(read("'fortran_order': True, 'shape': (2, 3, 2)", &both[..12]), two_frames());
}

#[test]
fn a_fourth_coordinate_that_is_not_one_is_refused_with_its_point() {
    let mut fourth = rearranged(|t, i, k| 8 * t + 4 * i + k);
    fourth[15] = 0.5;
    let file = npy("'<f4'", "'fortran_order': False, 'shape': (2, 2, 4)", &little(&fourth));
    let mut reader = open("a.npy", &file, 2).unwrap();
    let mut frame = Vec::new();
    assert!(reader.read_next(&mut frame).unwrap());
    let error = message(reader.read_next(&mut frame));
    assert!(error.starts_with("a.npy: frame 1: point 1 has the fourth coordinate 0.5 "), "{error}");
}

/// An archive as `numpy.savez` and `numpy.savez_compressed` make it.
fn npz(arrays: &[&str], method: zip::CompressionMethod) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for name in arrays {
        let options = zip::write::SimpleFileOptions::default().compression_method(method).large_file(true);
        archive.start_file(format!("{name}.npy"), options).unwrap();
        archive.write_all(&npy_f4()).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn an_archive_with_one_array_is_read_stored_or_compressed() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("walk.npz");
    for method in [zip::CompressionMethod::Stored, zip::CompressionMethod::Deflated] {
        let whole = npz(&["arr_0"], method);
        fs::write(&path, &whole).unwrap();
        assert_eq!(all(&mut *open_frames(&path, 2).unwrap()), two_frames());
        for length in [0, 1, 30, whole.len() / 2, whole.len() - 1] {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(message(open_frames(&path, 2)).contains("walk.npz: cannot be unpacked ("), "{length}");
        }
    }
    fs::write(&path, npz(&["walk", "run"], zip::CompressionMethod::Stored)).unwrap();
    let error = message(open_frames(&path, 2));
    assert!(
        error.contains("has 2 arrays that can be the frames (walk, run); ") && error.contains("--prim walk"),
        "{error}"
    );
}

/// An archive of arrays of any content.
fn archive(arrays: &[(&str, Vec<u8>)], method: zip::CompressionMethod) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        archive.start_file(*name, zip::write::SimpleFileOptions::default().compression_method(method)).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn the_one_array_that_fits_is_read_with_the_frame_rate_beside_it() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("walk.npz");
    let rest = npy("'<f4'", "'fortran_order': False, 'shape': (2, 3), ", &little(&coordinates()[..6]));
    let faces = npy("'<i8'", "'fortran_order': False, 'shape': (4, 3), ", &[0; 96]);
    let other = npy("'<f4'", "'fortran_order': False, 'shape': (2, 5, 3), ", &[0; 120]);
    for (rate, wanted) in [
        (npy("'<i8'", "'fortran_order': False, 'shape': (), ", &60_i64.to_le_bytes()), Some(60.0)),
        (npy("'>f4'", "'fortran_order': False, 'shape': (1,), ", &29.97_f32.to_be_bytes()), Some(30_000.0 / 1001.0)),
        (npy("'<f8'", "'fortran_order': False, 'shape': (), ", &(-1_f64).to_le_bytes()), None),
        (npy("'<f8'", "'fortran_order': False, 'shape': (2,), ", &[0; 16]), None),
    ] {
        let arrays = [
            ("faces.npy", faces.clone()),
            ("rest.npy", rest.clone()),
            ("other.npy", other.clone()),
            ("readme.txt", b"by hand".to_vec()),
            ("vertices.npy", npy_f4()),
            ("fps.npy", rate),
        ];
        for method in [zip::CompressionMethod::Stored, zip::CompressionMethod::Deflated] {
            fs::write(&path, archive(&arrays, method)).unwrap();
            let mut reader = open_frames(&path, 2).unwrap();
            assert_eq!(reader.frame_rate(), wanted);
            assert_eq!(all(&mut *reader), two_frames());
            // Passed over, and read again after an error or for another sample.
            let mut reader = open_frames(&path, 2).unwrap();
            let mut frame = Vec::new();
            assert!(reader.skip().unwrap() && reader.read_next(&mut frame).unwrap());
            assert_eq!(frame, two_frames()[1]);
        }
    }
    // One frame with its axis, beside a pose without.
    let one = npy("'<f4'", "'fortran_order': False, 'shape': (1, 2, 3), ", &little(&coordinates()[6..]));
    fs::write(
        &path,
        archive(
            &[("rest.npy", rest), ("verts.npy", one), ("other.npy", other), ("faces.npy", faces)],
            zip::CompressionMethod::Stored,
        ),
    )
    .unwrap();
    assert_eq!(all(&mut *open_frames(&path, 2).unwrap()), [two_frames()[1].clone()]);
    let error = message(open_frames(&path, 7));
    assert!(error.contains("none of them is frames of 7 points") && error.contains("faces: <i8 (4, 3)"), "{error}");
}

#[test]
fn a_packed_array_never_gives_more_bytes_than_its_header_promises() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("walk.npz");
    // 400 MB of zeros behind a header that promises two frames.
    let mut bomb = npy_f4();
    bomb.resize(400 << 20, 0);
    fs::write(&path, archive(&[("a.npy", bomb)], zip::CompressionMethod::Deflated)).unwrap();
    assert!(fs::metadata(&path).unwrap().len() < 1 << 20);
    let error = message(open_frames(&path, 2));
    assert!(error.contains("promises 2 frames and has 2 whole frames, ") && error.contains("in excess"), "{error}");
    // Damaged where it is packed: told when it is read, and never read past what it should be.
    let mut file = archive(&[("a.npy", npy_f4())], zip::CompressionMethod::Stored);
    let at = file.windows(4).position(|bytes| bytes == 11_f32.to_le_bytes()).unwrap();
    file[at] ^= 1;
    fs::write(&path, file).unwrap();
    let (mut reader, mut frame) = (open_frames(&path, 2).unwrap(), Vec::new());
    assert!(reader.read_next(&mut frame).unwrap());
    assert!(
        message(reader.read_next(&mut frame))
            .contains("walk.npz: frame 1: cannot be unpacked (its checksum is another one)")
    );
}

#[test]
fn rows_of_flat_coordinates_are_frames_however_many_there_are() {
    let read = |shape: &str, data: &[f32], points| {
        let rest = format!("'fortran_order': False, 'shape': {shape}");
        all(&mut *open("a.npy", &npy("'<f4'", &rest, &little(data)), points).unwrap())
    };
    let twelve = coordinates();
    assert_eq!(read("(2, 6)", &twelve, 2), two_frames());
    assert_eq!(read("(12,)", &twelve, 4), [two_frames().concat()]);
    assert_eq!(read("(1, 2, 2, 3)", &twelve, 2), two_frames());
    // Three frames of two points, and not one frame of six with its axes first.
    let three: Vec<f32> = (0..18_u8).map(f32::from).collect();
    let rows: Vec<Vec<f64>> = three.chunks(6).map(|row| row.iter().map(|&x| x.into()).collect()).collect();
    assert_eq!(read("(3, 6)", &three, 2), rows);
    assert_eq!(read("(3, 6)", &three, 6).len(), 1);
    let fortran: Vec<f32> = (0..6).flat_map(|c| [three[c], three[6 + c], three[12 + c]]).collect();
    let file = npy("'<f4'", "'fortran_order': True, 'shape': (3, 6)", &little(&fortran));
    assert_eq!(all(&mut *open("a.npy", &file, 2).unwrap()), rows);
}

#[test]
fn arrays_that_are_not_read_are_described_with_the_line_that_converts_them() {
    let of = |descr, rest| message(open("a.npy", &npy(descr, rest, &[0; 48]), 2));
    let error = of("'<i4'", "'fortran_order': False, 'shape': (2, 2, 3)");
    assert_eq!(
        error,
        "a.npy: has values of type \"<i4\", not 32- or 64-bit floats; \
         convert it in Python with numpy.save(\"converted.npy\", numpy.load(path).astype(\"<f4\"))"
    );
    let records = of("[('x', '<f4'), ('y', '<f4', (2,))]", "'fortran_order': False, 'shape': (2,)");
    assert!(records.contains("has records (\"x\", \"y\")") && records.contains("numpy.load(path)[\"x\"]"), "{records}");
    let axes = of("[('x', '<f4'), ('y', '<f4'), ('z', '<f4')]", "'fortran_order': False, 'shape': (2, 2)");
    assert!(axes.contains("[numpy.load(path)[k] for k in \"xyz\"], -1)"), "{axes}");
    let objects = of("'|O'", "'fortran_order': False, 'shape': (2,)");
    assert!(objects.contains("allow_pickle=True) if len(frame) == 2]"), "{objects}");
    assert!(of("'|O'", "'fortran_order': False, 'shape': ()").contains("allow_pickle=True).item()[NAME]"));
    let error = of("'<f4'", "'fortran_order': False, 'shape': (2, 7)");
    assert!(error.contains("has the shape (2, 7), not (frames, points, 3)"), "{error}");
    let error = of("'<f4'", "'fortran_order': False, 'shape': (2, 9)");
    assert!(error.contains("has 3 points where 2 are expected"), "{error}");
    assert!(of("'<f4'", "'fortran_order': False, 'shape': (6, 5)").contains("numpy.load(path).T)"));
    assert!(
        of("'<f4'", "'fortran_order': False, 'shape': (5, 4, 2, 3)").contains("numpy.load(path).reshape(-1, 2, 3)")
    );
    // The order of its axes is told; `reshape` would scramble it.
    let error = message(open("a.npy", &npy("'<f4'", "'fortran_order': False, 'shape': (5, 2, 3)", &[0; 120]), 5));
    assert!(error.contains("has the shape (5, 2, 3), points before frames; ") && error.contains("transpose(1, 0, 2)"));
    let error = message(open("a.npy", &npy("'<f4'", "'fortran_order': False, 'shape': (5, 3, 2)", &[0; 120]), 5));
    assert!(error.contains("has the shape (5, 3, 2), points before frames; ") && error.contains("transpose(2, 0, 1)"));
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
    for (name, bytes) in plain_caches() {
        let error = message(open(name, &bytes[..bytes.len() - 5], 2));
        assert!(error.contains("promises 2 frames and has 1 whole frames, 5 bytes are missing; "), "{error}");
        let error = message(open(name, &[bytes, vec![0; 7]].concat(), 2));
        assert!(error.contains("promises 2 frames and has 2 whole frames, 7 bytes are in excess; "), "{error}");
    }
}

#[test]
fn nan_and_infinity_are_errors_that_name_frame_and_point() {
    for (name, mut bytes) in plain_caches() {
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

/// Frames at these times, of two points.
fn mdd_at(times: &[f32]) -> Vec<u8> {
    let mut file = [times.len() as u32, 2].map(u32::to_be_bytes).concat();
    file.extend(big(times));
    file.extend(big(&vec![0.5; 6 * times.len()]));
    file
}

#[test]
fn uneven_times_of_a_point_cache_are_kept_and_told() {
    let numbers = |times: &[f32]| {
        let file = mdd_at(times);
        let reader = open("a.mdd", &file, 2).unwrap();
        let numbers: Vec<f64> = (0..times.len()).map(|k| reader.number(k)).collect();
        (numbers, reader.frame_rate(), reader.notes().len())
    };
    assert_eq!(numbers(&[0.0, 0.04, 0.08, 0.16]), (vec![0.0, 1.0, 2.0, 4.0], Some(25.0), 1));
    assert_eq!(numbers(&[2.0, 2.5, 3.0, 3.25]), (vec![4.0, 5.0, 6.0, 6.5], Some(2.0), 1));
    // At 120 frames per second, rounded to thousandths, but even.
    let rounded: Vec<f32> = (0..24_u8).map(|k| (f32::from(k) / 0.12).round() / 1000.0).collect();
    assert_eq!(numbers(&rounded).2, 0);
    assert_eq!(numbers(&[0.0, 0.033, 0.067, 0.1]), (vec![0.0, 1.0, 2.0, 3.0], Some(30.0), 0));
    assert_eq!(numbers(&[0.0, 0.0, 0.0]), (vec![0.0, 1.0, 2.0], None, 0));
    let note = open("a.mdd", &mdd_at(&[0.0, 1.0, 3.0]), 2).unwrap().notes().remove(0);
    assert!(note.starts_with("a.mdd: its times are not evenly spaced, 1.0000 s to 2.0000 s apart"), "{note}");
    for times in [[0.0, 0.2, 0.1], [0.0, 0.1, 0.1], [0.0, f32::NAN, 0.2], [0.0, 0.1, f32::INFINITY]] {
        let error = message(open("a.mdd", &mdd_at(&times), 2));
        assert!(error.contains("s after frame ") && error.contains("times that ascend"), "{error}");
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
fn a_folder_goes_on_with_another_mesh_and_a_file_of_all_frames_does_not() {
    let folder = tempdir().unwrap();
    let options = FrameOptions { numbers: vec![4.0, 7.0], ..Default::default() };
    let there = FrameOptions { origin: Some([100.0, 0.0, 0.0]), ..Default::default() };
    let second = polygons(&[&[0, 1, 2], &[1, 3, 2]]);
    for (name, extension) in [("mesh", "obj"), ("mesh/*.ply", "ply")] {
        let mut writer = create_frames(folder.path().join(name), 3, 2, &polygons(&[&[0, 1, 2]]), &options).unwrap();
        writer.write_frame(&[0.5; 9]).unwrap();
        assert!(message(writer.change_mesh(3, &second, &there)).contains("vertex 3"));
        writer.change_mesh(4, &second, &there).unwrap();
        writer.write_frame(&[0.5; 12]).unwrap();
        writer.finish().unwrap();
        let read = |number| read_model(&folder.path().join(format!("mesh/frame_{number:04}.{extension}"))).unwrap();
        assert_eq!((read(4).points, read(4).faces), (vec![[0.5; 3]; 3], polygons(&[&[0, 1, 2]])));
        assert_eq!((read(7).points, read(7).faces), (vec![[100.5, 0.5, 0.5]; 4], second.clone()));
        fs::remove_dir_all(folder.path().join("mesh")).unwrap();
    }
    for name in ["a.npy", "a.pc2", "a.mdd", "a.abc"] {
        let path = folder.path().join(name);
        let mut writer = create_frames(&path, 3, 2, &polygons(&[&[0, 1, 2]]), &options).unwrap();
        let error = message(writer.change_mesh(4, &second, &there));
        assert!(error.contains(name) && error.contains("one mesh"), "{error}");
        drop(writer);
        assert!(!path.exists(), "{name}");
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
    let error = message(create("a.fbx", 1, 1, &none, 24.0));
    assert!(error.ends_with("in / for a folder of .obj files, or of one frame in .obj .ply .off .stl"), "{error}");
    assert!(matches!(create("a.npy", 0, 1, &none, 24.0), Err(Error::Invalid { .. })));
    assert!(matches!(create("a.npy", 1, 0, &none, 24.0), Err(Error::Invalid { .. })));
    assert!(matches!(create("a.mdd", 1, 1, &none, f64::NAN), Err(Error::Invalid { .. })));
    assert!(matches!(create("a.pc2", 1 << 31, 1, &none, 24.0), Err(Error::Unsupported { .. })));
    assert!(matches!(create("a.abc", 1 << 31, 1, &none, 24.0), Err(Error::Unsupported { .. })));
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
fn frames_have_the_numbers_of_their_files_signs_and_fractions_included() {
    let folder = tempdir().unwrap();
    for (name, x) in [("f-2", -2.0), ("f-1", -1.0), ("f0", 0.0), ("f1", 1.0), ("f1.5", 1.5), ("f2", 2.0), ("f10", 10.0)]
    {
        fs::write(folder.path().join(format!("{name}.obj")), format!("v {x} 0 0\n")).unwrap();
    }
    let mut reader = open_frames(folder.path(), 1).unwrap();
    let told: Vec<f64> = (0..reader.frames()).map(|k| reader.number(k)).collect();
    assert_eq!(told, [-2.0, -1.0, 0.0, 1.0, 1.5, 2.0, 10.0]);
    assert_eq!(numbers(&mut *reader), told);
    assert_eq!(missing_frames(&told).as_deref(), Some("3 to 9"));
}

#[test]
fn start_and_step_of_a_point_cache_are_its_frame_numbers_and_are_kept() {
    let folder = tempdir().unwrap();
    for (name, numbers, fps) in [
        ("a.pc2", vec![101.0, 103.0], None),
        ("a.mdd", vec![48.0, 49.0], Some(25.0)),
        ("frames", vec![-1.0, 0.5], None),
    ] {
        let path = folder.path().join(name);
        let options = FrameOptions { fps: fps.unwrap_or(24.0), numbers: numbers.clone(), ..FrameOptions::default() };
        let mut writer = create_frames(&path, 2, 2, &Polygons::new(), &options).unwrap();
        coordinates().chunks(6).for_each(|frame| writer.write_frame(frame).unwrap());
        writer.finish().unwrap();
        let reader = open_frames(&path, 2).unwrap();
        assert_eq!((0..2).map(|k| reader.number(k)).collect::<Vec<_>>(), numbers, "{name}");
        assert_eq!(reader.frame_rate(), fps, "{name}");
    }
    assert!(
        folder.path().join("frames/frame_-0001.obj").exists() && folder.path().join("frames/frame_0000.5.obj").exists()
    );
    let twice = FrameOptions { numbers: vec![1.0, 1.0], ..FrameOptions::default() };
    assert!(matches!(
        create_frames(folder.path().join("b"), 2, 2, &Polygons::new(), &twice),
        Err(Error::Invalid { .. })
    ));
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

#[test]
fn stl_frames_are_merged_as_the_rest_pose_is() {
    let dir = tempdir().unwrap();
    let stl = |points: [[f64; 3]; 4]| {
        let corner = |index: &u32| points[*index as usize].map(|x| x as f32).map(f32::to_le_bytes).concat();
        let facet = |face: &[u32; 3]| [vec![0; 12], face.iter().flat_map(corner).collect(), vec![0; 2]].concat();
        [vec![0; 80], 4_u32.to_le_bytes().to_vec(), FACES.iter().flat_map(facet).collect()].concat()
    };
    // In the order in which the faces meet them; the last two meet in frame 0, and nothing does in the others.
    let touching = [POINTS[0], POINTS[1], [5.0, 6.0, 7.0], [5.0, 6.0, 7.0]];
    let order = |p: [[f64; 3]; 4]| [p[0], p[2], p[1], p[3]].concat();
    for (k, points) in [touching, POINTS, touching].into_iter().enumerate() {
        fs::write(dir.path().join(format!("f{k}.stl")), stl(points)).unwrap();
    }
    let frames = all(&mut *open_frames(dir.path(), 4).unwrap());
    assert_eq!(frames, [touching, POINTS, touching].map(order));

    // A rest pose in which two points are one cannot be had from frames in which they part.
    for (k, points) in [touching, POINTS].into_iter().enumerate() {
        fs::write(dir.path().join(format!("f{k}.stl")), stl(points)).unwrap();
    }
    fs::remove_file(dir.path().join("f2.stl")).unwrap();
    let mut reader = open_frames(dir.path(), 3).unwrap();
    assert!(reader.read_next(&mut Vec::new()).unwrap());
    let error = message(reader.read_next(&mut Vec::new()));
    assert!(error.contains("f1.stl: frame 1: point 1 lies in two places"), "{error}");
}

/// A folder of one-point frames under these names.
fn files(names: &[&str]) -> tempfile::TempDir {
    let folder = tempdir().unwrap();
    for (k, name) in names.iter().enumerate() {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, format!("v {k} 0 0\n")).unwrap();
    }
    folder
}

fn told(source: &Path) -> Vec<f64> {
    told_of(source, 1)
}

fn told_of(source: &Path, points: usize) -> Vec<f64> {
    let reader = open_frames(source, points).unwrap();
    (0..reader.frames()).map(|k| reader.number(k)).collect()
}

#[test]
fn files_of_several_sequences_are_refused_with_a_pattern_that_picks_one() {
    for (names, pick, count) in [
        (vec!["f001.obj", "f002.obj", "f003 (1).obj", "f003.obj", "f1.obj"], "f???.obj", 3),
        (vec!["w_0_v2.obj", "w_0_v3.obj", "w_1_v2.obj", "w_1_v3.obj"], "w_*_v2.obj", 2),
        (vec!["w.v1.01.obj", "w.v1.02.obj", "w.v2.01.obj", "w.v2.02.obj"], "w.v1.*.obj", 2),
        (vec!["a_000.obj", "a_001.obj", "b_000.obj"], "a_*.obj", 2),
        (vec!["run1.obj", "run2.obj", "walk3.obj", "walk4.obj"], "run*.obj", 2),
        (vec!["f1.obj", "f2.obj", "rest.obj"], "f*.obj", 2),
        (vec!["f1.obj", "f2.obj", "f2 - Copy.obj"], "f?.obj", 2),
        (vec!["f[a]1.obj", "f[a]2.obj", "g1.obj"], "f[[]a[]]*.obj", 2),
    ] {
        let folder = files(&names);
        let error = message(open_frames(folder.path(), 1));
        let pattern = folder.path().join(pick);
        assert!(error.contains("several sequences") && error.contains(&format!("'{}'", pattern.display())), "{error}");
        assert_eq!(open_frames(&pattern, 1).unwrap().frames(), count, "{pick}");
    }
    for names in [["01.obj", "1.obj"], ["f1.obj", "f1 (1).obj"], ["F1.obj", "f1.obj"]] {
        assert!(matches!(open_frames(files(&names).path(), 1), Err(Error::SeveralSequences { .. })), "{names:?}");
    }
}

#[test]
fn poses_with_names_of_their_own_are_frames_in_natural_order() {
    for names in [
        ["jump.obj", "run.obj", "walk.obj"],
        ["01_sit.obj", "02_stand.obj", "10_run.obj"],
        ["jump_v2.obj", "run_v2.obj", "walk_v2.obj"],
        ["f.obj", "f1.obj", "g2.obj"],
        ["01_smile_L.obj", "01_smile_R.obj", "02_frown.obj"],
        ["f_000_a1b2.obj", "f_001_c3d4.obj", "f_002_a5b6.obj"],
        ["scan_2024-01-05_10-15-58.obj", "scan_2024-01-05_10-15-59.obj", "scan_2024-01-05_10-16-00.obj"],
    ] {
        assert_eq!(told(files(&names).path()), [0.0, 1.0, 2.0], "{names:?}");
    }
    let long = ["90071992547409931.obj", "90071992547409932.obj"];
    assert_eq!(told(files(&long).path()), [0.0, 1.0]);
}

#[test]
fn a_selection_leaves_out_the_rest_pose_and_joins_sequences() {
    let folder = files(&["f1.obj", "f2.obj", "rest.obj"]);
    let path = |name: &str| folder.path().join(name);
    let mut selection = FrameSelection { no_frames: vec![path("rest.obj")], ..FrameSelection::default() };
    let reader = open_selected_frames(folder.path(), 1, &selection).unwrap();
    assert_eq!((reader.frames(), reader.notes().len()), (2, 1));
    selection.no_frames = vec![path("f1.obj")];
    selection.join_sequences = true;
    let reader = open_selected_frames(folder.path(), 1, &selection).unwrap();
    assert_eq!((reader.frames(), reader.notes().len()), (2, 1));
    // What Blender's export leaves: the rest pose, and the frames in one file.
    let folder = files(&["rest.obj"]);
    fs::write(folder.path().join("frames.npy"), npy_f4()).unwrap();
    selection.no_frames = vec![folder.path().join("rest.obj")];
    assert_eq!(open_selected_frames(folder.path(), 2, &selection).unwrap().frames(), 2);
}

#[test]
fn a_complete_file_without_a_last_line_break_is_no_cut_one() {
    let folder = tempdir().unwrap();
    for (k, end) in ["\n", "", "\n"].iter().enumerate() {
        let text = format!("v {k} 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3{end}");
        fs::write(folder.path().join(format!("{k}.obj")), text).unwrap();
    }
    assert_eq!(numbers(&mut *open_frames(folder.path(), 3).unwrap()), [0.0, 1.0, 2.0]);
    fs::write(folder.path().join("1.obj"), "v 1 0 0\nv 0 1 0\nv 0 0 1").unwrap();
    let mut reader = open_frames(folder.path(), 3).unwrap();
    assert!(reader.read_next(&mut Vec::new()).unwrap());
    assert!(message(reader.read_next(&mut Vec::new())).contains("1.obj: frame 1: ends within a line"));
}

#[test]
fn every_part_of_a_path_may_be_a_pattern_or_a_name_that_looks_like_one() {
    let folder = files(&["t[1]/f5.obj", "t[1]/f6.obj", "t1/f7.obj", "t1/f8.obj", "b[2]_3.obj", "b[2]_4.obj"]);
    for (pattern, wanted) in [
        ("t[1]/f*.obj", [5.0, 6.0]),
        ("t[1]/f%d.obj", [5.0, 6.0]),
        ("t[1]/f[56].obj", [5.0, 6.0]),
        ("t*1]/*.obj", [5.0, 6.0]),
        ("t[12]/f*.obj", [7.0, 8.0]),
        ("b[2]_*.obj", [3.0, 4.0]),
    ] {
        assert_eq!(told(&folder.path().join(pattern)), wanted, "{pattern}");
    }
    let folder = files(&["frame_0009/mesh.obj", "frame_0010/mesh.obj", "frame_10/mesh.obj", "other/mesh.obj"]);
    for pattern in ["frame_%04d/mesh.obj", "frame_00*/mesh.obj", "frame_####/*.obj", "frame_%04d/*.obj"] {
        assert_eq!(told(&folder.path().join(pattern)), [9.0, 10.0], "{pattern}");
    }
    assert!(message(open_frames(folder.path(), 1)).contains("*/*.obj'"));
    assert!(message(open_frames(folder.path().join("frame_%06d/mesh.obj"), 1)).contains("matches no file"));
    assert!(message(open_frames(folder.path().join("frame_*"), 1)).contains("/frame_*/*.obj'"));
}

#[test]
fn a_folder_of_arrays_has_one_frame_in_each() {
    let folder = tempdir().unwrap();
    let frame =
        |k: usize| npy("'<f4'", "'fortran_order': False, 'shape': (2, 3), ", &little(&coordinates()[6 * k..][..6]));
    fs::write(folder.path().join("f_010.npy"), frame(1)).unwrap();
    fs::write(folder.path().join("f_009.npy"), frame(0)).unwrap();
    for source in ["", "f_%03d.npy", "*.npy"] {
        let source = folder.path().join(source);
        assert_eq!(told_of(&source, 2), [9.0, 10.0]);
        assert_eq!(all(&mut *open_frames(&source, 2).unwrap()), two_frames());
    }
    let (mut reader, mut out) = (open_frames(folder.path(), 3).unwrap(), Vec::new());
    assert!(matches!(reader.read_next(&mut out), Err(Error::PointCount { frame: Some(0), found: 2, .. })));
    fs::write(folder.path().join("f_010.npy"), npy_f4()).unwrap();
    let mut reader = open_frames(folder.path(), 2).unwrap();
    assert!(reader.read_next(&mut out).unwrap());
    let error = message(reader.read_next(&mut out));
    assert!(
        error.contains("f_010.npy: frame 1: has 2 frames, where a folder of several files has one in each"),
        "{error}"
    );
}
