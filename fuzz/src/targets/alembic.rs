//! Alembic archives. The first byte says how many points are expected.

use super::byte;
use crate::Target;
use cager_formats::{CacheFormat, FrameOptions, MeshFormat, create_frames, open_frames_bytes, read_model_bytes};
use cager_geometry::mesh::Polygons;
use std::path::Path;

/// Frames that are read: as many as an archive promises would take long, as repetitions take no room in it.
const READ: usize = 64;

pub(super) const ABC: Target = Target {
    name: "abc",
    run: |mut bytes| {
        let points = usize::from(byte(&mut bytes));
        let name = Path::new("a.abc");
        if let Ok(model) = read_model_bytes(MeshFormat::Abc, name, bytes) {
            assert!(!model.points.is_empty() && model.points.as_flattened().iter().all(|x| x.is_finite()));
            assert!(model.faces.indices().iter().all(|&index| (index as usize) < model.points.len()));
        }
        let mut reader = match open_frames_bytes(CacheFormat::Abc, name, bytes, points) {
            Ok(reader) => reader,
            Err(error) => {
                let text = error.to_string();
                assert!(text.starts_with("a.abc: ") && text.len() < 1000, "{text}");
                return;
            }
        };
        assert!(reader.points() == points && points > 0 && reader.frames() > 0, "nothing in it");
        assert!(reader.frame_rate().is_none_or(|rate| rate.is_finite() && rate > 0.0));
        assert!((0..reader.frames()).all(|frame| reader.number(frame).is_finite()), "a number of a frame is none");
        let mut frame = Vec::new();
        for _ in 0..reader.frames().min(READ) {
            match reader.read_next(&mut frame) {
                Ok(more) => assert!(more && frame.len() == 3 * points && frame.iter().all(|x| x.is_finite())),
                Err(_) => {
                    assert!(reader.read_next(&mut frame).is_err(), "the same frame is good the second time");
                    return;
                }
            }
        }
    },
    seeds: || {
        let uneven = FrameOptions { numbers: vec![0.0, 1.0, 5.0], ..FrameOptions::default() };
        let far = FrameOptions { origin: Some([1e6, 0.0, 0.0]), ..FrameOptions::default() };
        [FrameOptions::default(), uneven, far].iter().map(seed).collect()
    },
    words: &[
        "Ogawa\u{0}",
        "isInstance=1;",
        "schema=AbcGeom_SubD_v1",
        "schema=AbcGeom_Xform_v3",
        ".geom",
        ".xform",
        ".vals",
        ".ops",
        "_ai_DCC_FPS=30",
    ],
    fixed: 2 << 20,
    per_byte: 64,
};

/// Three frames of a triangle.
fn seed(options: &FrameOptions) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.abc");
    let mut faces = Polygons::new();
    faces.push(&[0, 1, 2]);
    let mut writer = create_frames(&path, 3, 3, &faces, options).expect("a target");
    for frame in 0..3_u8 {
        writer.write_frame(&[f32::from(frame); 9]).expect("a frame");
    }
    writer.finish().expect("a file");
    [vec![3], std::fs::read(&path).expect("a file")].concat()
}
