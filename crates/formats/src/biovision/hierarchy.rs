//! The part of a BVH file that begins with `HIERARCHY`: the tree of joints.

use super::skeleton::{Channel, Joint, Skeleton};
use super::words::Words;
use crate::error::Fault;
use crate::text::{no_number, number, quoted};
use cager_geometry::mesh::Point;
use std::collections::HashMap;

/// More joints than any skeleton has.
const MAX_JOINTS: usize = 4096;
/// Joints below each other.
const MAX_DEPTH: usize = 512;
/// Bytes of a joint's name.
const MAX_NAME: usize = 256;

/// A brace that is open.
#[derive(Clone, Copy)]
enum Open {
    Joint(usize),
    EndSite,
}

/// Reads the tree and the word `MOTION` behind it.
pub(super) fn read(text: &mut Words<'_>) -> Result<Skeleton, Fault> {
    let mut skeleton = Skeleton::default();
    let mut names: HashMap<String, usize> = HashMap::new();
    let mut open: Vec<Open> = Vec::new();
    match text.next() {
        Some(word) if word.eq_ignore_ascii_case(b"HIERARCHY") => {}
        _ => return Err(Fault::damaged("does not begin with HIERARCHY; choose a BVH file")),
    }
    loop {
        let Some(word) = text.next() else { return Err(cut(text, open.len())) };
        let at = open.last().copied();
        match (word.to_ascii_uppercase().as_slice(), at) {
            (b"ROOT", None) if skeleton.joints.is_empty() => begin(text, &mut skeleton, &mut names, &mut open)?,
            (b"ROOT", None) => {
                return Err(Fault::unsupported(format!(
                    "line {}: a second skeleton begins; export one skeleton to a file",
                    text.number()
                )));
            }
            (b"JOINT", Some(Open::Joint(_))) => begin(text, &mut skeleton, &mut names, &mut open)?,
            (b"END", Some(Open::Joint(joint))) => {
                text.rest_of_line_until_brace(MAX_NAME)?;
                skeleton.joints[joint].end_sites.push([0.0; 3]);
                open.push(Open::EndSite);
            }
            (b"OFFSET", Some(Open::Joint(joint))) => skeleton.joints[joint].offset = offset(text)?,
            (b"OFFSET", Some(Open::EndSite)) => {
                let offset = offset(text)?;
                let above = open.iter().rev().find_map(|open| match open {
                    Open::Joint(joint) => Some(*joint),
                    Open::EndSite => None,
                });
                if let Some(end) = above.and_then(|joint| skeleton.joints[joint].end_sites.last_mut()) {
                    *end = offset;
                }
            }
            (b"CHANNELS", Some(Open::Joint(joint))) => {
                if !skeleton.joints[joint].channels.is_empty() {
                    let name = quoted(skeleton.joints[joint].name.as_bytes());
                    return Err(Fault::damaged(format!("line {}: joint {name} has channels twice", text.number())));
                }
                skeleton.joints[joint].channels = channels(text)?;
            }
            (b"}", Some(_)) => {
                open.pop();
            }
            (b"MOTION", None) if !skeleton.joints.is_empty() => break,
            _ => {
                return Err(Fault::damaged(format!(
                    "line {}: {} is not expected here; export the motion again",
                    text.number(),
                    quoted(word)
                )));
            }
        }
    }
    if skeleton.channels() == 0 {
        return Err(Fault::invalid("no joint has channels, so nothing moves; export a motion"));
    }
    Ok(skeleton)
}

/// A joint's name and its opening brace.
fn begin(
    text: &mut Words<'_>,
    skeleton: &mut Skeleton,
    names: &mut HashMap<String, usize>,
    open: &mut Vec<Open>,
) -> Result<(), Fault> {
    let name = text.rest_of_line_until_brace(MAX_NAME)?;
    let line = text.number();
    if skeleton.joints.len() == MAX_JOINTS || open.len() == MAX_DEPTH {
        return Err(Fault::unsupported(format!(
            "line {line}: more than {MAX_JOINTS} joints, or {MAX_DEPTH} below each other; leave out what does not move"
        )));
    }
    if name.is_empty() {
        return Err(Fault::damaged(format!("line {line}: the joint has no name; export the motion again")));
    }
    let shown = quoted(name.as_bytes());
    if name.contains(['{', '}']) {
        return Err(Fault::damaged(format!(
            "line {line}: joint {shown} has a brace in its name; export the motion again"
        )));
    }
    if let Some(&first) = names.get(&name) {
        let above = open.iter().any(|open| matches!(open, Open::Joint(joint) if *joint == first));
        let what = if above { "below itself: the tree would be cyclic" } else { "twice" };
        return Err(Fault::invalid(format!("line {line}: joint {shown} comes {what}; give each joint its own name")));
    }
    let parent = open.last().and_then(|open| match open {
        Open::Joint(joint) => Some(*joint),
        Open::EndSite => None,
    });
    let number = skeleton.joints.len();
    names.insert(name.clone(), number);
    skeleton.joints.push(Joint { name, parent, offset: [0.0; 3], channels: Vec::new(), end_sites: Vec::new() });
    open.push(Open::Joint(number));
    Ok(())
}

impl Words<'_> {
    /// The words up to an opening brace, which may stand on the next line, joined by spaces.
    fn rest_of_line_until_brace(&mut self, most: usize) -> Result<String, Fault> {
        let mut name = String::new();
        loop {
            let Some(word) = self.next() else { return Err(cut(self, 1)) };
            if word == b"{" {
                return Ok(name);
            }
            let (word, brace) = word.strip_suffix(b"{").map_or((word, false), |word| (word, true));
            if !name.is_empty() {
                name.push(' ');
            }
            name.push_str(&String::from_utf8_lossy(word));
            if name.len() > most {
                return Err(Fault::damaged(format!(
                    "line {}: no opening brace follows the joint's name; export the motion again",
                    self.number()
                )));
            }
            if brace {
                return Ok(name);
            }
        }
    }
}

fn offset(text: &mut Words<'_>) -> Result<Point, Fault> {
    let mut point = [0.0; 3];
    for coordinate in &mut point {
        let Some(word) = text.next() else { return Err(cut(text, 1)) };
        *coordinate = finite(word, text.number())?;
    }
    Ok(point)
}

fn channels(text: &mut Words<'_>) -> Result<Vec<Channel>, Fault> {
    let Some(word) = text.next() else { return Err(cut(text, 1)) };
    let count = crate::text::integer::<usize>(word).filter(|&count| count <= 6);
    let Some(count) = count else {
        return Err(Fault::damaged(format!(
            "line {}: a joint has {} channels, and 0 to 6 are possible; export the motion again",
            text.number(),
            quoted(word)
        )));
    };
    let mut channels = Vec::with_capacity(count);
    for _ in 0..count {
        let Some(word) = text.next() else { return Err(cut(text, 1)) };
        let unknown = || {
            Fault::unsupported(format!(
                "line {}: channel {} is not known; Xposition, Xrotation and those of Y and Z are",
                text.number(),
                quoted(word)
            ))
        };
        let (axis, kind) = word.split_first().ok_or_else(unknown)?;
        let axis = b"XYZ".iter().position(|a| a.eq_ignore_ascii_case(axis)).ok_or_else(unknown)? as u8;
        let channel = match kind.to_ascii_lowercase().as_slice() {
            b"position" => Channel::Position(axis),
            b"rotation" => Channel::Rotation(axis),
            _ => return Err(unknown()),
        };
        if channels.contains(&channel) {
            let text = format!("line {}: channel {} comes twice in a joint", text.number(), quoted(word));
            return Err(Fault::damaged(text + "; export the motion again"));
        }
        channels.push(channel);
    }
    Ok(channels)
}

/// A finite number.
pub(super) fn finite(word: &[u8], line: usize) -> Result<f64, Fault> {
    let value = number(word).ok_or_else(|| Fault::damaged(format!("line {line}: {}", no_number(word))))?;
    if value.is_finite() {
        return Ok(value);
    }
    Err(Fault::invalid(format!("line {line}: a value is NaN or infinite; repair or remove the frame or joint")))
}

/// The file ends inside the tree.
fn cut(text: &Words<'_>, open: usize) -> Fault {
    let inside = if open > 0 { "inside a joint" } else { "before MOTION" };
    Fault::damaged(format!("ends {inside}, after line {}; copy or export the file again", text.number()))
}
