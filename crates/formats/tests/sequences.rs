//! Captures with a file for each frame, of formats that could hold all of them.

mod support;

use std::fs;
use std::path::Path;

use cager_formats::{
    Error, FrameOptions, FrameReader, FrameSelection, Units, Up, create_frames, open_frames, open_selected_frames,
};
use support::{all, coordinates, little, message, npy, numbers, polygons, tetrahedron};
use tempfile::{TempDir, tempdir};

const CENTIMETRES: Units = Units::new(Up::Z, 0.01);

/// The tetrahedron, which rises by one from frame to frame.
fn rising(frame: u16) -> Vec<f32> {
    tetrahedron().points.iter().flat_map(|&[x, y, z]| [x, y + f64::from(frame), z].map(|x| x as f32)).collect()
}

/// A file of so many frames from one on.
fn write(folder: &Path, name: &str, first: u16, frames: u16, units: Units) {
    let numbers = (first..first + frames).map(f64::from).collect();
    let options = FrameOptions { numbers, units, fps: 25.0, ..FrameOptions::default() };
    let faces = tetrahedron().faces;
    let mut writer = create_frames(folder.join(name), 4, frames.into(), &faces, &options).unwrap();
    (first..first + frames).for_each(|frame| writer.write_frame(&rising(frame)).unwrap());
    writer.finish().unwrap();
}

fn shot(names: &[&str], frames: u16) -> TempDir {
    let folder = tempdir().unwrap();
    for (first, name) in (1001..).zip(names) {
        write(folder.path(), name, first, frames, CENTIMETRES);
    }
    folder
}

fn open(source: &Path) -> Result<Box<dyn FrameReader>, Error> {
    open_frames(source, 4)
}

#[test]
fn files_of_every_format_with_a_frame_each_are_frames() {
    for extension in ["usdc", "usdz", "usd", "abc", "mcx", "mc", "pc2", "mdd", "npy"] {
        let names = [1001, 1002, 1003].map(|number| format!("cache.{number}.{extension}"));
        let folder = shot(&names.each_ref().map(String::as_str), 1);
        fs::write(folder.path().join("notes.txt"), "of the shot").unwrap();
        for source in ["", &format!("cache.*.{extension}"), &format!("cache.%04d.{extension}")] {
            let mut reader = open(&folder.path().join(source)).unwrap();
            assert_eq!(numbers(&*reader), [1001.0, 1002.0, 1003.0], "{extension}");
            assert_eq!(reader.notes(), Vec::<String>::new());
            if extension.starts_with("usd") {
                assert_eq!((reader.units(), reader.frame_rate()), (CENTIMETRES, Some(25.0)));
            }
            let frames = all(&mut *reader);
            let wanted: Vec<Vec<f64>> =
                (1001..1004).map(|frame| rising(frame).iter().map(|&x| x.into()).collect()).collect();
            assert_eq!(frames, wanted, "{extension}");
            if extension.starts_with("usd") || extension == "abc" {
                let (path, faces) = reader.mesh().unwrap();
                assert_eq!((path.file_name().unwrap(), faces), (names[2].as_ref(), &tetrahedron().faces));
            }
        }
    }
}

#[test]
fn files_that_are_several_captures_are_called_what_they_are() {
    let said = |folder: &TempDir| message(open(folder.path()));
    let many = shot(&["a1.usdc", "a2.usdc"], 2);
    assert!(said(&many).contains("has 2 captures, such as a1.usdc of 2 frames; name one of them, or export one frame"));
    let kinds = shot(&["a.1.usdc", "a.2.usdc", "a.1.abc"], 1);
    assert!(
        said(&kinds).contains("has 3 captures of several kinds (1 .abc, 2 .usdc)") && said(&kinds).contains("'*.usdc'")
    );
    let unnumbered = shot(&["run.abc", "walk.abc"], 1);
    assert!(
        said(&unnumbered).contains("2 captures of one frame each, such as run.abc and walk.abc"),
        "{}",
        said(&unnumbered)
    );
    let takes = shot(&["a1.abc", "a2.abc", "b1.abc", "b2.abc"], 1);
    assert!(matches!(open(takes.path()), Err(Error::SeveralSequences { .. })), "{}", said(&takes));
    // All by their names, where that is asked for.
    let selection = FrameSelection { join_sequences: true, ..FrameSelection::default() };
    assert_eq!(open_selected_frames(takes.path(), 4, &selection).unwrap().frames(), 4);
    assert_eq!(open_selected_frames(unnumbered.path(), 4, &selection).unwrap().frames(), 2);
}

#[test]
fn names_with_hash_signs_and_of_one_number_are_refused_in_words() {
    for names in [&["A1b1.npy", "a#b1.npy"][..], &["A1b1.npy", "a#b2.npy", "run.npy"], &["x1.npy", "x1.NPY", "x2.npy"]]
    {
        let folder = shot(names, 1);
        match open(folder.path()) {
            Ok(reader) => assert_eq!(numbers(&*reader).len(), names.len(), "{names:?}"),
            Err(error) => assert!(error.to_string().contains("several sequences"), "{error}"),
        }
    }
    assert!(message(open(shot(&["x1.npy", "x1.NPY", "x2.npy"], 1).path())).contains("have the same frame number"));
}

#[test]
fn a_file_unlike_the_others_is_named_with_its_frame() {
    let folder = shot(&["a.1.usdc", "a.2.usdc", "a.4.usdc"], 1);
    let read = || {
        let mut reader = open(folder.path())?;
        let mut frame = Vec::new();
        while reader.read_next(&mut frame)? {}
        Ok(())
    };
    read().unwrap();
    write(folder.path(), "a.3.usdc", 1003, 2, CENTIMETRES);
    let said = message(read());
    assert!(
        said.contains("a.3.usdc: frame 2: has 2 frames, where a folder of several files has one in each"),
        "{said}"
    );
    fs::remove_file(folder.path().join("a.3.usdc")).unwrap();
    write(folder.path(), "a.3.usdc", 1003, 1, Units::METRES);
    let said = message(read());
    assert!(
        said.contains("a.3.usdc: frame 2: says another unit or upward axis than") && said.contains("a.1.usdc"),
        "{said}"
    );
    fs::remove_file(folder.path().join("a.3.usdc")).unwrap();
    let mut other =
        create_frames(folder.path().join("a.3.usdc"), 3, 1, &polygons(&[]), &FrameOptions::default()).unwrap();
    other.write_frame(&[0.0; 9]).unwrap();
    other.finish().unwrap();
    let Err(Error::PointCount { frame, expected, found, .. }) = read() else { panic!("another number of points") };
    assert_eq!((frame, expected, found), (Some(2), 4, 3));
}

/// An archive with these arrays of one frame of two points.
fn arrays(names: &[&str]) -> Vec<u8> {
    use std::io::Write;
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (k, name) in names.iter().enumerate() {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(format!("{name}.npy"), options).unwrap();
        let values: Vec<f32> = coordinates()[..6].iter().map(|x| x + k as f32).collect();
        archive.write_all(&npy("'<f4'", "'fortran_order': False, 'shape': (2, 3), ", &little(&values))).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn one_array_of_several_is_taken_by_its_name() {
    let folder = tempdir().unwrap();
    let prim = |name: &str| FrameSelection { prims: vec![name.to_owned()], ..FrameSelection::default() };
    let path = folder.path().join("body.1.npz");
    fs::write(&path, arrays(&["vertices", "v_template"])).unwrap();
    for k in 2..4 {
        fs::write(folder.path().join(format!("body.{k}.npz")), arrays(&["vertices", "v_template"])).unwrap();
    }
    let read = |source: &Path, name: &str| all(&mut *open_selected_frames(source, 2, &prim(name)).unwrap());
    for (name, first) in [("vertices", 0.0), ("v_template", 1.0)] {
        assert_eq!(read(&path, name)[0][0], first);
        let frames = read(folder.path(), name);
        assert_eq!(frames.iter().map(|frame| frame[0]).collect::<Vec<_>>(), [first; 3]);
    }
    let said = message(open_frames(&path, 2));
    assert!(said.contains("(vertices, v_template); name the one that is meant, as with --prim vertices"), "{said}");
    assert!(!said.contains("numpy"), "{said}");
    // A file without the named array is none of its frames, though another array of it fits.
    fs::write(folder.path().join("body.3.npz"), arrays(&["v_template"])).unwrap();
    let mut reader = open_selected_frames(folder.path(), 2, &prim("vertices")).unwrap();
    (0..2).for_each(|_| assert!(reader.read_next(&mut Vec::new()).unwrap()));
    let said = message(reader.read_next(&mut Vec::new()));
    assert!(said.contains("body.3.npz: frame 2: has no array \"vertices\", as "), "{said}");
    // Another name leaves the choice open.
    let said = message(open_selected_frames(&path, 2, &prim("gone")));
    assert!(said.contains("has no array \"gone\", and has 2 arrays of") && said.contains("--prim vertices"), "{said}");
    let notes = |arrays: &[u8]| {
        fs::write(&path, arrays).unwrap();
        open_selected_frames(&path, 2, &prim("gone")).unwrap().notes()
    };
    assert!(notes(&arrays(&["vertices"])).is_empty());
    // Where nobody names one, each file has the one that is read of the first.
    for (k, name) in [(1, "vertices"), (2, "vertices"), (3, "other")] {
        fs::write(folder.path().join(format!("body.{k}.npz")), arrays(&[name])).unwrap();
    }
    let mut reader = open_frames(folder.path(), 2).unwrap();
    (0..2).for_each(|_| assert!(reader.read_next(&mut Vec::new()).unwrap()));
    let said = message(reader.read_next(&mut Vec::new()));
    assert!(said.contains("body.3.npz: frame 2: has no array \"vertices\", as "), "{said}");
    assert!(said.contains("but \"other\""), "{said}");
    // Arrays that are numbered may be the frames of one capture.
    fs::write(&path, arrays(&["arr_0", "arr_1"])).unwrap();
    let said = message(open_frames(&path, 2));
    assert!(said.contains("--prim arr_0") && said.contains("join them in Python with a = numpy.load(path)"), "{said}");
}

/// Four frames of the tetrahedron with these numbers.
fn numbered(path: &Path, fps: f64, numbers: &[f64]) -> Vec<String> {
    let options = FrameOptions { numbers: numbers.to_vec(), fps, ..FrameOptions::default() };
    let mut writer = create_frames(path, 4, numbers.len(), &tetrahedron().faces, &options).unwrap();
    (0..numbers.len()).for_each(|frame| writer.write_frame(&rising(frame as u16)).unwrap());
    let notes = writer.notes();
    writer.finish().unwrap();
    notes
}

#[test]
fn rates_of_television_come_back_as_fractions_from_every_format_that_has_rates() {
    let folder = tempdir().unwrap();
    for (rounded, exact) in
        [(23.976, 24_000.0 / 1001.0), (29.97, 30_000.0 / 1001.0), (59.94, 60_000.0 / 1001.0), (24.0, 24.0)]
    {
        for fps in [rounded, exact] {
            for extension in ["abc", "usdc", "usdz", "usd", "mdd", "mcx", "mc", "glb", "gltf"] {
                let path = folder.path().join(format!("{fps}.{extension}"));
                let told: Vec<f64> = (1001..1049).map(f64::from).collect();
                numbered(&path, fps, &told);
                let reader = open(&path).unwrap();
                let rate = reader.frame_rate().unwrap();
                assert!((rate - exact).abs() < 1e-9, "{fps} .{extension}: {rate}");
                assert!(numbers(&*reader).iter().zip(&told).all(|(a, b)| (a - b).abs() < 1e-6), "{fps} .{extension}");
            }
        }
    }
}

#[test]
fn uneven_times_are_told_where_a_cache_has_no_room_for_them() {
    let folder = tempdir().unwrap();
    let notes = numbered(&folder.path().join("a.pc2"), 24.0, &[1.0, 2.0, 5.5, 6.0]);
    assert!(notes[0].contains("a.pc2: holds one distance between all frames"), "{notes:?}");
    assert!(numbered(&folder.path().join("b.pc2"), 24.0, &[1.0, 3.0, 5.0, 7.0]).is_empty());
    assert!(numbered(&folder.path().join("a.mdd"), 24.0, &[1.0, 2.0, 5.5, 6.0]).is_empty());
}
