//! Point caches. The first byte says how many points are expected.

use super::{byte, scenes};
use crate::Target;
use cager_formats::{CacheFormat, FrameOptions, FrameReader, open_frames, open_frames_bytes};
use std::io::{Cursor, Write};
use std::path::Path;
use zip::CompressionMethod;
use zip::write::SimpleFileOptions;

const fn target(
    name: &'static str,
    run: fn(&[u8]),
    seeds: fn() -> Vec<Vec<u8>>,
    words: &'static [&'static str],
) -> Target {
    Target { name, run, seeds, words, fixed: 1 << 20, per_byte: 64 }
}

pub(super) const NPY: Target = target(
    "npy",
    |bytes| read(CacheFormat::Npy, bytes),
    || {
        let file = |version: u8, descr: &str, rest: &str, data: &[u8]| {
            let text = format!("{{'descr': {descr}, {rest}}}\n");
            let mut file = vec![2];
            file.extend(b"\x93NUMPY");
            file.extend([version, 0]);
            let length = (text.len() as u32).to_le_bytes();
            file.extend(&length[..if version == 1 { 2 } else { 4 }]);
            file.extend(text.bytes());
            file.extend(data);
            file
        };
        vec![
            file(1, "'<f4'", "'fortran_order': False, 'shape': (2, 2, 3), ", &little()),
            file(2, "'<f8'", "'fortran_order': False, 'shape': (1, 2, 3), ", &[0; 48]),
            file(1, "'>f4'", "\"shape\": (2L, 3), 'fortran_order': False", &[0; 24]),
            file(1, "'<f4'", "'fortran_order': True, 'shape': (2, 2, 3), ", &little()),
            file(1, "'<f4'", "'fortran_order': True, 'shape': (2, 6), ", &little()),
            file(1, "'<f4'", "'fortran_order': False, 'shape': (1, 2, 2, 3), ", &little()),
        ]
    },
    &[
        "'descr'",
        "'fortran_order'",
        "'shape'",
        "True",
        "False",
        "(2, 2, 3)",
        "(2, 3)",
        "(",
        ")",
        ",",
        "[",
        "]",
        "{",
        "}",
        "'<f4'",
        "'<f8'",
        "'|u1'",
        "'>f8'",
        "'=f4'",
        "'",
        "\"",
        ": ",
        "L",
        "[('x', '<f4')]",
    ],
);

pub(super) const PC2: Target = target(
    "pc2",
    |bytes| read(CacheFormat::Pc2, bytes),
    || {
        let mut file = b"\x02POINTCACHE2\0\x01\0\0\0\x02\0\0\0\0\0\0\0\0\0\x80\x3f\x02\0\0\0".to_vec();
        file.extend(little());
        vec![file]
    },
    &["POINTCACHE2\0"],
);

pub(super) const MDD: Target = target(
    "mdd",
    |bytes| read(CacheFormat::Mdd, bytes),
    || {
        let mut file = b"\x02\0\0\0\x02\0\0\0\x02\0\0\0\0\x3d\x2a\xaa\xab".to_vec();
        file.extend((0..12_u8).flat_map(|k| f32::from(k).to_be_bytes()));
        let mut uneven = b"\x01\0\0\0\x03\0\0\0\x01".to_vec();
        uneven.extend([0.0_f32, 1.0, 3.0].iter().chain(&[0.5; 9]).flat_map(|x| x.to_be_bytes()));
        vec![file, uneven]
    },
    &["\0\0\0\u{2}"],
);

pub(super) const MCX: Target = target(
    "mcx",
    |bytes| read(CacheFormat::Mcx, bytes),
    || {
        let uneven = FrameOptions { numbers: vec![0.0, 1.0, 4.0], ..FrameOptions::default() };
        let far = FrameOptions { origin: Some([1e6, 0.0, 0.0]), ..FrameOptions::default() };
        [scenes::written("a.mcx", &[FrameOptions::default(), uneven]), scenes::written("a.mc", &[far])].concat()
    },
    &["FOR4", "FOR8", "MYCH", "TIME", "CHNM", "SIZE", "FVCA", "DVCA", "_normals", "\0\0\0\u{4}"],
);

/// Archives lie on the disk.
pub(super) const NPZ: Target = target(
    "npz",
    |mut bytes| {
        let points = usize::from(byte(&mut bytes));
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.npz");
        std::fs::write(&path, bytes).expect("a file");
        match open_frames(&path, points) {
            Ok(mut reader) => read_all(&mut *reader, points),
            Err(error) => assert!(error.to_string().starts_with(&format!("{}: ", path.display())), "{error}"),
        }
    },
    || {
        let npy = &(NPY.seeds)()[0][1..];
        let archive = |names: &[&str], method| {
            let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
            for name in names {
                let options = SimpleFileOptions::default().compression_method(method);
                archive.start_file(*name, options).expect("in memory");
                archive.write_all(npy).expect("in memory");
            }
            [vec![2], archive.finish().expect("in memory").into_inner()].concat()
        };
        vec![
            archive(&["a.npy"], CompressionMethod::Stored),
            archive(&["a.npy"], CompressionMethod::Deflated),
            archive(&["a.npy", "fps.npy"], CompressionMethod::Stored),
        ]
    },
    &["PK\u{1}\u{2}", "PK\u{3}\u{4}", "PK\u{5}\u{6}", "PK\u{6}\u{6}", "fps.npy", "'<f4'", "(2, 2, 3)"],
);

fn little() -> Vec<u8> {
    (0..12_u8).flat_map(|k| f32::from(k).to_le_bytes()).collect()
}

fn read(format: CacheFormat, mut bytes: &[u8]) {
    let points = match byte(&mut bytes) {
        0xff => usize::MAX,
        0xfe => 1 << 63,
        0xfd => 1 << 31,
        0xfc => i32::MAX as usize,
        0xfb => u32::MAX as usize,
        0xfa => usize::MAX / 12 + 1,
        few => usize::from(few),
    };
    let name = Path::new("a").with_extension(format.extension());
    let mut reader = match open_frames_bytes(format, &name, bytes, points) {
        Ok(reader) => reader,
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with(&format!("{}: ", name.display())) && text.len() < 2000, "{text}");
            return;
        }
    };
    assert_eq!(reader.points(), points);
    assert!(points > 0 && reader.frames() > 0, "nothing in it");
    let held = reader.frames().checked_mul(points).and_then(|n| n.checked_mul(12));
    assert!(
        held.is_some_and(|held| held <= bytes.len()),
        "{} frames of {points} in {} bytes",
        reader.frames(),
        bytes.len()
    );
    read_all(&mut *reader, points);
}

fn read_all(reader: &mut dyn FrameReader, points: usize) {
    assert!(reader.frame_rate().is_none_or(|rate| rate.is_finite() && rate > 0.0));
    assert!((0..reader.frames()).all(|frame| reader.number(frame).is_finite()), "a number of a frame is none");
    let mut frame = Vec::new();
    for _ in 0..reader.frames() {
        match reader.read_next(&mut frame) {
            Ok(more) => assert!(more && frame.len() == 3 * points && frame.iter().all(|x| x.is_finite())),
            Err(_) => {
                assert!(reader.read_next(&mut frame).is_err(), "the same frame is good the second time");
                return;
            }
        }
    }
    assert!(!reader.read_next(&mut frame).is_ok_and(|more| more), "a frame beyond the last");
}
