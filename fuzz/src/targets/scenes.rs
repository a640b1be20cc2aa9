//! Reads files of one mesh that moves. The first byte says how many points are expected.

use super::byte;
use cager_formats::{CacheFormat, FrameOptions, MeshFormat, create_frames, open_frames_bytes, read_model_bytes};
use cager_geometry::mesh::Polygons;
use std::path::Path;

/// Frames that are read: as many as a file promises would take long, as repetitions take no room in it.
const READ: usize = 64;

pub(super) fn read(cache: CacheFormat, mesh: MeshFormat, name: &str, mut bytes: &[u8]) {
    let points = usize::from(byte(&mut bytes));
    let path = Path::new(name);
    if let Ok(model) = read_model_bytes(mesh, path, bytes) {
        assert!(!model.points.is_empty() && model.points.as_flattened().iter().all(|x| x.is_finite()));
        assert!(model.faces.indices().iter().all(|&index| (index as usize) < model.points.len()));
    }
    let mut reader = match open_frames_bytes(cache, path, bytes, points) {
        Ok(reader) => reader,
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with(name) && text.chars().count() < 2000, "{text}");
            return;
        }
    };
    assert!(reader.points() == points && points > 0 && reader.frames() > 0, "nothing in it");
    assert!(reader.frame_rate().is_none_or(|rate| rate.is_finite() && rate > 0.0));
    assert!((0..reader.frames()).all(|frame| reader.number(frame).is_finite()), "a frame has no number");
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
}

/// Three frames of a triangle: at even times, at uneven ones, far away.
pub(super) fn seeds(name: &str, uneven: [f64; 3]) -> Vec<Vec<u8>> {
    let uneven = FrameOptions { numbers: uneven.to_vec(), ..FrameOptions::default() };
    let far = FrameOptions { origin: Some([1e6, 0.0, 0.0]), ..FrameOptions::default() };
    written(name, &[FrameOptions::default(), uneven, far])
}

/// Three frames of a triangle for each of several options.
pub(super) fn written(name: &str, options: &[FrameOptions]) -> Vec<Vec<u8>> {
    let written = |options: &FrameOptions| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        let mut faces = Polygons::new();
        faces.push(&[0, 1, 2]);
        let mut writer = create_frames(&path, 3, 3, &faces, options).expect("a target");
        for frame in 0..3_u8 {
            writer.write_frame(&[f32::from(frame); 9]).expect("a frame");
        }
        writer.finish().expect("a file");
        [vec![3], std::fs::read(&path).expect("a file")].concat()
    };
    options.iter().map(written).collect()
}
