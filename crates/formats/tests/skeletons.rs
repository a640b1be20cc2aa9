//! BVH files: what is read, how joints are posed, and what is refused.

use cager_formats::biovision::{Channel, Clip, bvh_bytes, read_bvh, read_bvh_bytes};
use std::path::{Path, PathBuf};

const ARM: &str = "HIERARCHY\nROOT hip\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation \
                   Yrotation Xrotation\n \
                   JOINT upper arm {\n  OFFSET 0 2 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 1.5 0\n  }\n }\n}\n\
                   MOTION\nFrames: 2\nFrame Time: .01\n1 2 3 0 0 0 0 0 0\n0 0 0 90 0 0 0 90 0\n";

fn read(text: &str) -> Result<Clip, String> {
    read_bvh_bytes(Path::new("a.bvh"), text.as_bytes()).map_err(|error| error.to_string())
}

#[test]
fn joints_are_posed_by_their_channels_in_the_order_of_the_file() {
    let Clip { skeleton, motion } = read(ARM).unwrap();
    assert_eq!((skeleton.joints.len(), skeleton.channels(), motion.frames()), (2, 9, 2));
    assert_eq!(skeleton.joint("upper arm"), Some(1));
    assert_eq!(skeleton.joints[1].channels[1], Channel::Rotation(0));
    let poses = skeleton.pose(motion.frame(0));
    assert_eq!((poses[0].translation.to_array(), poses[1].translation.to_array()), ([1.0, 2.0, 3.0], [1.0, 4.0, 3.0]));
    let poses = skeleton.pose(motion.frame(1));
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-12);
    assert!(near(poses[1].translation.to_array(), [-2.0, 0.0, 0.0]), "{poses:?}");
    // Z after X: the end of the arm points along z, which a turn about z leaves alone.
    assert!(
        near(poses[1].transform_point3(skeleton.joints[1].end_sites[0].into()).to_array(), [-2.0, 0.0, 1.5]),
        "{poses:?}"
    );
    assert_eq!(skeleton.zero_pose()[1].translation.to_array(), [0.0, 2.0, 0.0]);
}

#[test]
fn what_is_written_is_read_back_exactly() {
    let clip = read(ARM).unwrap();
    let bytes = bvh_bytes(&clip.skeleton, &clip.motion);
    assert_eq!(read_bvh_bytes(Path::new("b.bvh"), &bytes).unwrap(), clip);
}

#[test]
fn a_mark_of_byte_order_and_labels_without_a_blank_are_read() {
    let text = ARM.replace("Frames: 2", "Frames:2").replace("Frame Time: .01", "frame time:.01");
    assert_eq!(read(&format!("\u{feff}{text}")).unwrap(), read(ARM).unwrap());
    assert!(read(&ARM.replace("Frames: 2", "Frames2")).is_err());
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let cases = [
        ("HIERARCHY", "MESH", "does not begin with HIERARCHY"),
        ("Yrotation\n  End", "Wrotation\n  End", "line 8: channel \"Wrotation\" is not known"),
        ("CHANNELS 3 Zrotation", "CHANNELS 3 Xrotation", "line 8: channel \"Xrotation\" comes twice"),
        ("CHANNELS 3", "CHANNELS 7", "line 8: a joint has \"7\" channels"),
        ("JOINT upper arm", "JOINT hip", "line 6: joint \"hip\" comes below itself: the tree would be cyclic"),
        ("OFFSET 0 2 0", "OFFSET 0 2 nan", "line 7: a value is NaN or infinite"),
        ("OFFSET 0 2 0", "OFFSET 0 2,5 0", "line 7: \"2,5\" has a decimal comma"),
        ("Frames: 2", "Frames: 3", "ends after 2 of 3 frames"),
        ("Frames: 2", "Frames: 1", "line 19: there are more than the 1 frames"),
        ("0 0 0 90 0 0 0 90 0", "0 0 0 90 0 0 0 90", "line 19: the frame has 8 values where the channels are 9"),
        ("0 0 0 90 0 0 0 90 0", "0 0 0 90 0 0 0 90 0 1", "line 19: the frame has 10 values where the channels are 9"),
        ("1 2 3 0", "1 2 inf 0", "line 18: a value is NaN or infinite"),
        (" }\n}\nMOTION", " }\nMOTION", "line 14: \"MOTION\" is not expected here"),
        ("Frame Time: .01", "Frame Time: -1", "line 17: the time of a frame is negative"),
        ("}\nMOTION", "}\nROOT b\n{\n}\nMOTION", "line 15: a second skeleton begins"),
    ];
    for (from, to, expected) in cases {
        let text = ARM.replacen(from, to, 1);
        assert_ne!(text, ARM, "{from}");
        let error = read(&text).unwrap_err();
        assert!(error.starts_with("a.bvh: ") && error.contains(expected), "{expected}: {error}");
    }
    for end in [11, 40, 100, 200, 250] {
        assert!(read(&ARM[..end]).unwrap_err().starts_with("a.bvh: "), "{end}");
    }
    let twice = ARM.replacen("End Site\n  {\n   OFFSET 0 1.5 0\n  }\n }", "}\n JOINT upper arm {\n }", 1);
    assert!(read(&twice).unwrap_err().contains("joint \"upper arm\" comes twice"), "{twice}");
}

#[test]
fn deep_trees_are_refused() {
    let joints: String = (0..100_000).map(|k| format!("JOINT j{k}\n{{\n")).collect();
    let text = format!("HIERARCHY\nROOT r\n{{\nCHANNELS 1 Xrotation\n{joints}");
    assert!(read(&text).unwrap_err().contains("512 below each other"));
}

#[test]
fn clips_of_real_captures_are_read_and_written() {
    let data = std::env::var_os("CAGER_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    for (name, joints, frames) in [("02_02", 43, 299), ("131_01", 31, 994)] {
        let path = data.join("bvh").join(name).with_extension("bvh");
        let Ok(bytes) = std::fs::read(&path) else {
            eprintln!("skipped: there is no {}", path.display());
            continue;
        };
        let clip = read_bvh(&path).unwrap();
        eprintln!(
            "{name}: {} joints, {} frames, {} bytes",
            clip.skeleton.joints.len(),
            clip.motion.frames(),
            bytes.len()
        );
        assert_eq!((clip.skeleton.joints.len(), clip.motion.frames()), (joints, frames));
        let again = read_bvh_bytes(&path, &bvh_bytes(&clip.skeleton, &clip.motion)).unwrap();
        assert_eq!(again, clip);
    }
}
