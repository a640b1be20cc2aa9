//! Skeletons and their motion.

use crate::Target;
use cager_formats::biovision::{bvh_bytes, read_bvh_bytes};
use std::path::Path;

pub(super) const BVH: Target = Target {
    name: "bvh",
    run: |bytes| match read_bvh_bytes(Path::new("a.bvh"), bytes) {
        Ok(clip) => {
            let (skeleton, motion) = (&clip.skeleton, &clip.motion);
            assert!(motion.frames() > 0 && motion.values.iter().all(|value| value.is_finite()), "frames");
            assert_eq!(motion.values.len(), motion.frames() * skeleton.channels(), "values");
            let parents =
                skeleton.joints.iter().enumerate().all(|(k, joint)| joint.parent.is_none_or(|parent| parent < k));
            assert!(parents, "a joint before its parent");
            assert_eq!(skeleton.pose(motion.frame(0)).len(), skeleton.joints.len(), "poses");
            let again = read_bvh_bytes(Path::new("a.bvh"), &bvh_bytes(skeleton, motion)).expect("what was written");
            assert_eq!(again.motion.frames(), motion.frames(), "frames that were written");
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with("a.bvh: ") && text.len() < 600, "{text}");
        }
    },
    seeds: || {
        let arm = b"HIERARCHY\nROOT a\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n JOINT b {\n  OFFSET 0 2 0\n  \
                    CHANNELS 1 Zrotation\n  End Site\n  {\n   OFFSET 0 1 0\n  }\n }\n}\nMOTION\nFrames: 2\nFrame Time: .01\n1 2 3 0 0 0 0\n0 0 0 9 0 0 1\n";
        let two = b"HIERARCHY\r\nROOT r\r\n{\r\nOFFSET 1e1 -.5 +2\r\nCHANNELS 3 zrotation Yrotation Xrotation\r\nJOINT s\r\n{\r\nCHANNELS 0\r\n}\r\n\
                    JOINT t\r\n{\r\n}\r\n}\r\nMOTION\r\nFrames:\t1\r\nFrame Time:\t1\r\n1 2 3\r\n";
        vec![arm.to_vec(), two.to_vec()]
    },
    words: &[
        "HIERARCHY",
        "ROOT ",
        "JOINT ",
        "End Site",
        "OFFSET ",
        "CHANNELS ",
        "MOTION",
        "Frames: ",
        "Frame Time: ",
        "Xposition",
        "Zrotation",
        "{",
        "}",
        "\n",
        "nan",
        "1e999",
        "18446744073709551615",
        "b",
    ],
    // Numbers that are written out in full take three hundred digits.
    fixed: 1 << 20,
    per_byte: 512,
};
