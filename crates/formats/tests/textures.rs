//! What users rely on when frames are written as vertex animation textures: engines put points
//! where the frames have them.

mod support;

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::Command;

use cager_formats::{FrameOptions, Target, create_frames, read_model};
use cager_geometry::mesh::Polygons;
use flate2::read::ZlibDecoder;
use gltf::json::Root;
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use support::{message, polygons};

/// A row of so many points that wave and move away.
fn frames(points: u16, count: u16) -> Vec<Vec<f32>> {
    let at = |frame: u16, k: u16| {
        let (t, x) = (0.1 * f32::from(frame), 0.01 * f32::from(k));
        [x + t, (x + t).sin(), 0.25 * (x - 2.0 * t).cos()]
    };
    (0..count).map(|frame| (0..points).flat_map(|k| at(frame, k)).collect()).collect()
}

fn strip(points: u16) -> Polygons {
    let mut faces = Polygons::new();
    (2..u32::from(points)).for_each(|k| faces.push(&[k - 2, k - 1, k]));
    faces
}

/// Texels of an image, row by row, and how wide it is.
fn texels(path: &Path) -> (Vec<[u16; 3]>, usize) {
    let bytes = fs::read(path).unwrap();
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"));
    let word = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let (mut at, mut packed, mut size) = (8, Vec::new(), (0, 0));
    while at < bytes.len() {
        let (name, data) = (&bytes[at + 4..at + 8], &bytes[at + 8..at + 8 + word(at)]);
        let mut sum = flate2::Crc::new();
        sum.update(&bytes[at + 4..at + 8 + word(at)]);
        assert_eq!(sum.sum() as usize, word(at + 8 + data.len()));
        match name {
            b"IHDR" => {
                size = (word(at + 8), word(at + 12));
                assert_eq!(data[8..], [16, 2, 0, 0, 0]);
            }
            b"IDAT" => packed.extend(data),
            _ => assert_eq!(name, b"IEND"),
        }
        at += 12 + data.len();
    }
    let mut rows = Vec::new();
    ZlibDecoder::new(&packed[..]).read_to_end(&mut rows).unwrap();
    let (width, height) = size;
    assert_eq!(rows.len(), height * (1 + 6 * width));
    let (mut above, mut all) = (vec![0_u8; 6 * width], Vec::new());
    for row in rows.chunks(1 + 6 * width) {
        assert_eq!(row[0], 2);
        above.iter_mut().zip(&row[1..]).for_each(|(above, byte)| *above = above.wrapping_add(*byte));
        all.extend(above.as_chunks::<2>().0.iter().map(|bytes| u16::from_be_bytes(*bytes)));
    }
    (all.as_chunks().0.to_vec(), width)
}

/// Texture coordinates of the mesh.
fn places(path: &Path) -> Vec<[f32; 2]> {
    let bytes = fs::read(path).unwrap();
    let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let root: Root = gltf::json::deserialize::from_slice(&bytes[20..20 + json]).unwrap();
    let attributes = &root.meshes[0].primitives[0].attributes;
    let accessor = &root.accessors[attributes[&Checked::Valid(Semantic::TexCoords(1))].value()];
    let view = &root.buffer_views[accessor.buffer_view.unwrap().value()];
    let start = 28 + json + view.byte_offset.unwrap().0 as usize;
    let numbers = bytes[start..start + 8 * accessor.count.0 as usize].as_chunks().0;
    numbers.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect::<Vec<_>>().as_chunks().0.to_vec()
}

/// Bounds in the text beside the images.
fn bounds(text: &str) -> [[f64; 3]; 2] {
    ["\"Min\": [", "\"Max\": ["].map(|key| {
        let list = text.split_once(key).unwrap().1.split(']').next().unwrap();
        list.split(", ").map(|x| x.parse().unwrap()).collect::<Vec<f64>>().try_into().unwrap()
    })
}

#[test]
fn points_are_where_the_frames_have_them() {
    for (points, count, height) in [(50, 20, 20), (9000, 3, 6), (3, 1, 1)] {
        let (frames, folder) = (frames(points, count), tempfile::tempdir().unwrap());
        let path = folder.path().join("walk.vat");
        let target = path.join("");
        let options = FrameOptions { fps: 25.0, ..FrameOptions::default() };
        let mut writer = create_frames(&target, points.into(), count.into(), &strip(points), &options).unwrap();
        frames.iter().for_each(|frame| writer.write_frame(frame).unwrap());
        assert!(writer.notes()[0].contains("points are within"), "{:?}", writer.notes());
        writer.finish().unwrap();

        let text = fs::read_to_string(path.join("walk-remap_info.json")).unwrap();
        let [low, high] = bounds(&text);
        assert!(text.contains(&format!("\"Frames\": {count}")) && text.contains("\"framerate\": 25,"), "{text}");
        let mesh = read_model(&path.join("walk.glb")).unwrap();
        assert_eq!(mesh.faces, strip(points));
        let (moved, width) = texels(&path.join("walk_vat.png"));
        let (normals, same) = texels(&path.join("walk_vnrm.png"));
        assert_eq!((moved.len() / width, same, normals.len()), (height, width, moved.len()));
        let places = places(&path.join("walk.glb"));
        for (frame, wanted) in frames.iter().enumerate() {
            for (point, place) in places.iter().enumerate() {
                // As shaders find the texel, and turn what it holds to the axes of the mesh.
                let [u, v] = place.map(f64::from);
                let row = ((v + frame as f64 / height as f64) * height as f64) as usize;
                let texel = moved[row * width + (u * width as f64) as usize];
                let by: [f64; 3] = std::array::from_fn(|k| low[k] + f64::from(texel[k]) / 65535.0 * (high[k] - low[k]));
                let found =
                    [mesh.points[point][0] + by[0], mesh.points[point][1] + by[2], mesh.points[point][2] - by[1]];
                for (k, axis) in [0, 2, 1].into_iter().enumerate() {
                    let half = 0.5 * (high[axis] - low[axis]) / 65535.0;
                    let off = (found[k] - f64::from(wanted[3 * point + k])).abs();
                    assert!(off <= half + 1e-9, "frame {frame}, point {point} is off by {off}");
                }
                let normal = normals[row * width + (u * width as f64) as usize];
                let length: f64 = normal.iter().map(|&x| (f64::from(x) / 65535.0 * 2.0 - 1.0).powi(2)).sum();
                assert!((length.sqrt() - 1.0).abs() < 1e-4, "{normal:?}");
            }
        }
    }
}

#[test]
fn normals_are_in_the_axes_of_the_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flat.vat");
    // Facing +z, which is −y in Blender.
    let flat = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut writer = create_frames(&path, 3, 1, &polygons(&[&[0, 1, 2]]), &FrameOptions::default()).unwrap();
    writer.write_frame(&flat).unwrap();
    writer.finish().unwrap();
    assert_eq!(texels(&path.join("flat_vnrm.png")).0, [[32768, 0, 32768]; 3]);
    // Its own files are replaced, others are not, and nothing is where there must be none.
    let again = |target: Target| create_frames(target, 3, 1, &Polygons::new(), &FrameOptions::default());
    assert!(message(again(Target::New(path.clone()))).contains("not empty"));
    drop(again(Target::Replacing(path.clone())).unwrap());
    fs::write(path.join("notes.txt"), "keep").unwrap();
    assert!(message(again(Target::Replacing(path))).contains("not empty, as it holds notes.txt"));
}

#[test]
fn what_images_cannot_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |points, frames| {
        let path = folder.path().join("a.vat");
        message(create_frames(path, points, frames, &Polygons::new(), &FrameOptions::default()))
    };
    assert!(refused(8193, 4097).contains("take 4096 frames at the most (--range), or write .usdc or .abc"));
    assert!(refused(1_000_000, 1000).contains("which takes more than 1024 MB"));
}

/// `make gltf` installs it.
#[test]
fn the_validator_of_khronos_and_three_read_the_mesh() {
    let Ok(packages) = std::env::var("CAGER_GLTF_NODE") else {
        eprintln!("skipped: CAGER_GLTF_NODE is not set; `make gltf` installs the packages and runs this test");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.vat");
    let mut writer = create_frames(&path, 50, 2, &strip(50), &FrameOptions::default()).unwrap();
    frames(50, 2).iter().for_each(|frame| writer.write_frame(frame).unwrap());
    writer.finish().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/gltf.mjs");
    let done = Command::new("node").arg(script).arg(packages).arg(path.join("walk.glb")).arg("0").output().unwrap();
    let text = String::from_utf8(done.stdout).unwrap();
    assert!(text.starts_with("0 errors, 0 warnings\n"), "{text:.2000}{}", String::from_utf8_lossy(&done.stderr));
}
