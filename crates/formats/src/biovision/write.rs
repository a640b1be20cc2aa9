//! Writing BVH files.

use super::skeleton::{Channel, Motion, Skeleton};
use crate::atomic::AtomicFile;
use crate::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// Writes a skeleton and its motion as a BVH file, which appears whole or not at all.
///
/// # Errors
/// Where the file cannot be written.
pub fn write_bvh(path: impl AsRef<Path>, skeleton: &Skeleton, motion: &Motion) -> Result<(), Error> {
    let path = path.as_ref();
    let mut file = AtomicFile::create(path)?;
    std::io::Write::write_all(&mut file, &bvh_bytes(skeleton, motion)).map_err(|cause| Error::write(path, cause))?;
    file.commit()
}

/// The bytes of a BVH file. Numbers are as short as they can be read back exactly.
pub fn bvh_bytes(skeleton: &Skeleton, motion: &Motion) -> Vec<u8> {
    let mut text = String::from("HIERARCHY\n");
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); skeleton.joints.len()];
    let mut depth = vec![0; skeleton.joints.len()];
    for (number, joint) in skeleton.joints.iter().enumerate() {
        if let Some(parent) = joint.parent {
            below[parent].push(number);
            depth[number] = depth[parent] + 1;
        }
    }
    // Joints may be listed in any order that has parents first, and are written depth first.
    let mut order = Vec::new();
    let mut stack: Vec<(usize, bool)> = if skeleton.joints.is_empty() { Vec::new() } else { vec![(0, false)] };
    while let Some((number, done)) = stack.pop() {
        let indent = "\t".repeat(depth[number]);
        if done {
            let _ = writeln!(text, "{indent}}}");
            continue;
        }
        order.push(number);
        let joint = &skeleton.joints[number];
        let kind = if joint.parent.is_none() { "ROOT" } else { "JOINT" };
        let _ = writeln!(text, "{indent}{kind} {}\n{indent}{{", joint.name);
        let _ = writeln!(text, "{indent}\tOFFSET {} {} {}", joint.offset[0], joint.offset[1], joint.offset[2]);
        let _ = write!(text, "{indent}\tCHANNELS {}", joint.channels.len());
        for channel in &joint.channels {
            let (axis, kind) = match *channel {
                Channel::Position(axis) => (axis, "position"),
                Channel::Rotation(axis) => (axis, "rotation"),
            };
            let _ = write!(text, " {}{kind}", ["X", "Y", "Z"][usize::from(axis).min(2)]);
        }
        text.push('\n');
        for [x, y, z] in &joint.end_sites {
            let _ = writeln!(text, "{indent}\tEnd Site\n{indent}\t{{\n{indent}\t\tOFFSET {x} {y} {z}\n{indent}\t}}");
        }
        stack.push((number, true));
        stack.extend(below[number].iter().rev().map(|&child| (child, false)));
    }
    let counts = || skeleton.joints.iter().map(|joint| joint.channels.len());
    let first = |number: usize| counts().take(number).sum::<usize>();
    let ranges: Vec<_> = order.iter().map(|&k| first(k)..first(k + 1)).collect();
    let _ = writeln!(text, "MOTION\nFrames: {}\nFrame Time: {}", motion.frames(), motion.frame_time);
    for frame in 0..motion.frames() {
        let values = motion.frame(frame);
        let row: Vec<String> = ranges.iter().flat_map(|range| &values[range.clone()]).map(f64::to_string).collect();
        text.push_str(&row.join(" "));
        text.push('\n');
    }
    text.into_bytes()
}
