//! Skeletons and blend shapes of USD: by hand, as the library writes it, and of a character of Blender.

mod support;

use std::path::Path;

use cager_formats::{
    CacheFormat, Error, FrameSelection, MeshFormat, Units, Up, open_frames_bytes, open_selected_frames, read_mesh,
    read_mesh_bytes,
};
use cager_geometry::surface::Part;
use support::{all, arrays, character, message, numbers};

/// Two joints along x, of which the second turns by 90° about z; three meshes that lie aside.
const ARM: &str = include_str!("usd/arm.usda");
/// The same, written by usd-core.
const ARM_BINARY: &[u8] = include_bytes!("usd/arm.usdc");
const POINTS: usize = 9;

fn frames(format: CacheFormat, bytes: &[u8]) -> Result<Vec<Vec<f64>>, Error> {
    let mut reader = open_frames_bytes(format, Path::new("arm.usd"), bytes, POINTS)?;
    assert_eq!((numbers(&*reader), reader.frame_rate()), (vec![1.0, 2.0, 3.0], Some(24.0)));
    let mut frames = Vec::new();
    let mut frame = Vec::new();
    while reader.read_next(&mut frame)? {
        frames.push(frame.clone());
    }
    Ok(frames)
}

fn near(found: &[f64], expected: &[[f64; 3]]) -> bool {
    found.len() == 3 * expected.len() && found.iter().zip(expected.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-5)
}

#[test]
fn joints_and_shapes_move_points() {
    for (format, bytes) in [(CacheFormat::Usda, ARM.as_bytes()), (CacheFormat::Usdc, ARM_BINARY)] {
        let frames = frames(format, bytes).unwrap();
        // Skinned points are where the skeleton is, at (0, 100, 10), and not where the mesh is, at (7, 7, 17). As it
        // is bound, one point lies at the first joint, one halfway between both and one, scaled, on the second.
        let arm = [
            [[0.0, 101.0, 10.0], [1.0, 101.0, 10.0], [3.0, 101.0, 12.0]],
            // Halfway to 0.5, where the shape is at 3; by 45°, the point at (-1, 1) of the joint is at (-√2, 0).
            [[0.0, 101.0, 13.0], [1.5 - 0.5_f64.sqrt(), 100.5, 10.0], [2.0, 100.0 + 2_f64.sqrt(), 12.0]],
            [[0.0, 101.0, 14.0], [1.0, 100.0, 10.0], [1.0, 101.0, 12.0]],
        ];
        // Of which all points follow one joint.
        let side = 0.5_f64.sqrt();
        let one = [
            [[3.0, 100.0, 10.0], [4.0, 100.0, 10.0], [3.0, 100.0, 12.0]],
            [
                [2.0 + side, 100.0 + side, 10.0],
                [2.0 + 2.0 * side, 100.0 + 2.0 * side, 10.0],
                [2.0 + side, 100.0 + side, 12.0],
            ],
            [[2.0, 101.0, 10.0], [2.0, 102.0, 10.0], [2.0, 101.0, 12.0]],
        ];
        // Moved by shapes alone it stays where it is.
        let free = [0.0, 0.5, 1.0].map(|w| [[10.0, 7.0, 17.0 + 4.0 * w], [11.0, 7.0, 17.0], [10.0 + w, 7.0, 18.0]]);
        for (k, frame) in frames.iter().enumerate() {
            assert!(near(&frame[..9], &arm[k]), "{k}: {frame:?}");
            assert!(near(&frame[9..18], &one[k]), "{k}: {frame:?}");
            assert!(near(&frame[18..], &free[k]), "{k}: {frame:?}");
        }
    }
}

#[test]
fn the_rest_pose_is_the_first_frame_and_says_nothing_of_a_skin() {
    let read = read_mesh_bytes(MeshFormat::Usda, Path::new("arm.usda"), ARM.as_bytes()).unwrap();
    assert!(near(read.model.points[..3].as_flattened(), &[[0.0, 101.0, 10.0], [1.0, 101.0, 10.0], [3.0, 101.0, 12.0]]));
    assert_eq!(read.dropped.sentence(Path::new("arm.usda"), true), None);
}

#[test]
fn points_stay_where_no_root_no_skeleton_or_no_animation_is() {
    let first = |text: &str| frames(CacheFormat::Usda, text.as_bytes()).map(|frames| frames[2][6..9].to_vec());
    // At rest, the second joint is as it was bound.
    let still = ARM.replace("rel skel:animationSource = </root/rig/moves>", "");
    let mut reader = open_frames_bytes(CacheFormat::Usda, Path::new("a.usda"), still.as_bytes(), POINTS).unwrap();
    assert_eq!((reader.frames(), &all(&mut *reader)[0][6..9]), (1, &[3.0, 101.0, 11.0][..]));
    for unbound in [ARM.replace("SkelRoot", "Xform"), ARM.replace("rel skel:skeleton = </root/rig>", "")] {
        let mut reader = open_frames_bytes(CacheFormat::Usda, Path::new("a.usda"), unbound.as_bytes(), POINTS).unwrap();
        assert_eq!(all(&mut *reader)[0][6..9], [10.0, 7.0, 18.0]);
    }
    // What an animation does not say whole, it does not say.
    let half = ARM.replace("half3[] scales = [(1, 1, 2)]", "");
    assert_eq!(first(&half).unwrap(), [3.0, 101.0, 11.0]);
}

#[test]
fn what_cannot_be_read_is_named() {
    for (from, to, what) in [
        ("[1, 0, 1, 0, 0, 1] (", "[1, 0, 1, 0, 0, 2] (", "is bound to a joint that is not there"),
        ("[1, 0, 1, 0, 0, 1] (", "[1, 0, 1, 0, 0] (", "other numbers of joints"),
        ("[\"upper/lower\", \"upper\"]", "[\"upper/lower\", \"toe\"]", "names a joint that its skeleton does not have"),
        ("[\"upper\", \"upper/lower\"]", "[\"upper/lower\", \"upper\"]", "has a joint before the one above it"),
        ("[\"upper\", \"upper/lower\"]", "[\"upper\", \"upper\"]", "has a joint twice"),
        ("uniform matrix4d[] bindTransforms", "uniform matrix4d[] others", "bindTransforms"),
        ("uniform matrix4d[] restTransforms", "uniform matrix4d[] others", "restTransforms"),
        ("pointIndices = [0]", "pointIndices = [3]", "moves a point that is not there"),
        (
            "int[] primvars:skel:jointIndices = [1] (",
            "token primvars:skel:skinningMethod = \"dualQuaternion\"\nint[] primvars:skel:jointIndices = [1] (",
            "dual quaternions",
        ),
    ] {
        let text = ARM.replacen(from, to, 1);
        assert_ne!(text, ARM, "{from}");
        let error = message(frames(CacheFormat::Usda, text.as_bytes()));
        assert!(error.contains(what), "{error}\nnot: {what}");
    }
}

#[test]
fn damaged_skeletons_are_errors_at_the_most() {
    let mut random = support::random(7);
    for _ in 0..500 {
        for (format, whole) in [(CacheFormat::Usda, ARM.as_bytes()), (CacheFormat::Usdc, ARM_BINARY)] {
            let mut bytes = whole.to_vec();
            for _ in 0..=random() % 3 {
                let at = random() % bytes.len();
                bytes[at] = [b"0123456789-\"]),<>"[random() % 17], random() as u8][random() % 2];
            }
            let Ok(mut reader) = open_frames_bytes(format, Path::new("a.usd"), &bytes, POINTS) else { continue };
            let (mut out, most) = (Vec::new(), reader.frames().min(16));
            let _ = (0..most).all(|_| reader.read_next(&mut out).is_ok());
        }
    }
}

#[test]
fn a_character_of_blender_moves_as_its_author_says() {
    let Some(folder) = character("robin_skel.usdc") else { return };
    let (truth, path) = (arrays(&folder.join("truth.npz")), folder.join("robin_skel.usdc"));
    // All, as Blender says that the lantern is hidden.
    let prims = vec!["/root".to_owned()];
    let model = read_mesh(&path, &prims).unwrap().model;
    assert_eq!((model.surface.parts.len(), model.points.len()), (8, 1183));
    let selection = FrameSelection { prims, ..FrameSelection::default() };
    let mut reader = open_selected_frames(&path, model.points.len(), &selection).unwrap();
    assert_eq!(numbers(&*reader), (1001..1025).map(f64::from).collect::<Vec<_>>());
    assert_eq!(reader.units(), Units::new(Up::Z, 0.01));
    let frames = all(&mut *reader);
    let name = |part: &Part| {
        let last = part.path.rsplit('/').next().unwrap().to_owned();
        last.replace("eyeball_", "eye.")
    };
    for (part, range) in model.surface.ranges(&model.faces) {
        let expected = truth[&format!("{}|positions_m_yup", name(part))].as_chunks::<3>().0;
        assert_eq!(expected.len(), 24 * part.points);
        for (frame, expected) in frames.iter().zip(expected.chunks(part.points)) {
            for (point, [x, y, z]) in frame.as_chunks::<3>().0[range.points.clone()].iter().zip(expected) {
                let apart = [point[0] - 100.0 * x, point[1] + 100.0 * z, point[2] - 100.0 * y];
                // A character of 200 units.
                assert!(apart.iter().all(|x| x.abs() < 2e-3), "{}: {apart:?}", part.path);
            }
        }
    }
}
