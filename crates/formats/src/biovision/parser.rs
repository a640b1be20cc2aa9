//! The words of a BVH file: its tree of joints, then a line of values for each frame.

use super::skeleton::{Channel, Clip, Joint, Motion, Skeleton};
use crate::error::Fault;
use crate::text::{Lines, integer, no_number, number, quoted, words};
use cager_geometry::mesh::Point;
use std::fmt::Display;

/// More joints than any skeleton has, how many lie below each other, and bytes of a joint's name.
const MAX_JOINTS: usize = 4096;
const MAX_DEPTH: usize = 512;
const MAX_NAME: usize = 256;

pub(super) fn read(bytes: &[u8]) -> Result<Clip, Fault> {
    let mut parser = Parser { lines: Lines::new(bytes), line: &[], skeleton: Skeleton::default(), open: Vec::new() };
    parser.hierarchy()?;
    let motion = parser.motion()?;
    Ok(Clip { skeleton: parser.skeleton, motion })
}

struct Parser<'a> {
    lines: Lines<'a>,
    /// The rest of the present line.
    line: &'a [u8],
    skeleton: Skeleton,
    /// Braces that are open: the joint, and whether it is one of its end sites.
    open: Vec<(usize, bool)>,
}

impl<'a> Parser<'a> {
    fn damaged(&self, what: impl Display) -> Fault {
        Fault::damaged(format!("line {}: {what}; export the motion again", self.lines.number()))
    }

    /// Goes to the next word.
    fn skip_blanks(&mut self) -> Result<(), Fault> {
        self.line = self.line.trim_ascii_start();
        while self.line.is_empty() {
            self.line = self.lines.next().ok_or_else(|| {
                let place = if self.open.is_empty() { "before its frames" } else { "inside a joint" };
                Fault::damaged(format!(
                    "ends {place}, after line {}; copy or export the file again",
                    self.lines.number()
                ))
            })?;
        }
        Ok(())
    }

    fn word(&mut self) -> Result<&'a [u8], Fault> {
        self.skip_blanks()?;
        let end = self.line.iter().position(u8::is_ascii_whitespace).unwrap_or(self.line.len());
        let (word, rest) = self.line.split_at(end);
        self.line = rest;
        Ok(word)
    }

    /// Passes over a word; behind a colon no blank need follow.
    fn expect(&mut self, label: &[u8]) -> Result<(), Fault> {
        self.skip_blanks()?;
        if let Some((start, rest)) = self.line.split_at_checked(label.len())
            && start.eq_ignore_ascii_case(label)
            && (label.ends_with(b":") || rest.first().is_none_or(u8::is_ascii_whitespace))
        {
            self.line = rest;
            return Ok(());
        }
        let word = self.word()?;
        Err(self.damaged(format!("{} where {} is expected", quoted(word), quoted(label))))
    }

    fn number(&self, word: &[u8]) -> Result<f64, Fault> {
        let line = self.lines.number();
        match number(word) {
            None => Err(Fault::damaged(format!("line {line}: {}", no_number(word)))),
            Some(value) if value.is_finite() => Ok(value),
            Some(_) => Err(Fault::invalid(format!(
                "line {line}: a value is NaN or infinite; repair or remove the frame or joint"
            ))),
        }
    }

    /// Reads the tree and the word `MOTION` behind it.
    fn hierarchy(&mut self) -> Result<(), Fault> {
        if !self.word().is_ok_and(|word| word.eq_ignore_ascii_case(b"HIERARCHY")) {
            return Err(Fault::damaged("does not begin with HIERARCHY; choose a BVH file"));
        }
        loop {
            let word = self.word()?;
            let (at, is_first) = (self.open.last().copied(), self.skeleton.joints.is_empty());
            match (word.to_ascii_uppercase().as_slice(), at) {
                (b"ROOT", None) if is_first => self.joint(None)?,
                (b"ROOT", None) => {
                    return Err(Fault::unsupported(format!(
                        "line {}: a second skeleton begins; export one skeleton to a file",
                        self.lines.number()
                    )));
                }
                (b"JOINT", Some((parent, false))) => self.joint(Some(parent))?,
                (b"END", Some((joint, false))) => {
                    self.name()?;
                    self.skeleton.joints[joint].end_sites.push([0.0; 3]);
                    self.open.push((joint, true));
                }
                (b"OFFSET", Some((joint, is_end))) => {
                    let mut offset = Point::default();
                    for coordinate in &mut offset {
                        let word = self.word()?;
                        *coordinate = self.number(word)?;
                    }
                    let joint = &mut self.skeleton.joints[joint];
                    let end = joint.end_sites.last_mut().filter(|_| is_end);
                    *end.unwrap_or(&mut joint.offset) = offset;
                }
                (b"CHANNELS", Some((joint, false))) => {
                    let known = &self.skeleton.joints[joint];
                    if !known.channels.is_empty() {
                        return Err(self.damaged(format!("joint {} has channels twice", quoted(known.name.as_bytes()))));
                    }
                    self.skeleton.joints[joint].channels = self.channels()?;
                }
                (b"}", Some(_)) => drop(self.open.pop()),
                (b"MOTION", None) if !is_first => break,
                _ => return Err(self.damaged(format!("{} is not expected here", quoted(word)))),
            }
        }
        if self.skeleton.channels() == 0 {
            return Err(Fault::invalid("no joint has channels, so nothing moves; export a motion"));
        }
        Ok(())
    }

    /// A joint's name and its opening brace.
    fn joint(&mut self, parent: Option<usize>) -> Result<(), Fault> {
        let name = self.name()?;
        let (line, joints, shown) = (self.lines.number(), self.skeleton.joints.len(), quoted(name.as_bytes()));
        if joints == MAX_JOINTS || self.open.len() == MAX_DEPTH {
            return Err(Fault::unsupported(format!(
                "line {line}: more than {MAX_JOINTS} joints, or {MAX_DEPTH} below each other; leave out what does not \
                 move"
            )));
        }
        if name.is_empty() {
            return Err(self.damaged("the joint has no name"));
        }
        if name.contains(['{', '}']) {
            return Err(self.damaged(format!("joint {shown} has a brace in its name")));
        }
        if let Some(first) = self.skeleton.joint(&name) {
            let is_above = self.open.iter().any(|&(joint, _)| joint == first);
            let what = if is_above { "below itself: the tree would be cyclic" } else { "twice" };
            return Err(Fault::invalid(format!(
                "line {line}: joint {shown} comes {what}; give each joint its own name"
            )));
        }
        self.skeleton.joints.push(Joint { name, parent, ..Joint::default() });
        self.open.push((joints, false));
        Ok(())
    }

    /// The words up to an opening brace, which may stand on the next line, joined by spaces.
    fn name(&mut self) -> Result<String, Fault> {
        let mut name = String::new();
        loop {
            let word = self.word()?;
            let plain = word.strip_suffix(b"{").unwrap_or(word);
            if !name.is_empty() && !plain.is_empty() {
                name.push(' ');
            }
            name.push_str(&String::from_utf8_lossy(plain));
            if name.len() > MAX_NAME {
                return Err(self.damaged("no opening brace follows the joint's name"));
            }
            if plain.len() < word.len() {
                return Ok(name);
            }
        }
    }

    fn channels(&mut self) -> Result<Vec<Channel>, Fault> {
        let (word, mut channels) = (self.word()?, Vec::new());
        let Some(count) = integer::<usize>(word).filter(|&count| count <= 6) else {
            return Err(self.damaged(format!("a joint has {} channels, and 0 to 6 are possible", quoted(word))));
        };
        for _ in 0..count {
            let word = self.word()?;
            let axis = b"xyz".iter().position(|axis| word[0].eq_ignore_ascii_case(axis)).map(|axis| axis as u8);
            let channel = match (axis, word[1..].to_ascii_lowercase().as_slice()) {
                (Some(axis), b"position") => Channel::Position(axis),
                (Some(axis), b"rotation") => Channel::Rotation(axis),
                _ => {
                    return Err(Fault::unsupported(format!(
                        "line {}: channel {} is not known; Xposition, Xrotation and those of Y and Z are",
                        self.lines.number(),
                        quoted(word)
                    )));
                }
            };
            if channels.contains(&channel) {
                return Err(self.damaged(format!("channel {} comes twice in a joint", quoted(word))));
            }
            channels.push(channel);
        }
        Ok(channels)
    }

    /// Reads what is behind `MOTION`.
    fn motion(&mut self) -> Result<Motion, Fault> {
        self.expect(b"Frames:")?;
        let word = self.word()?;
        let Some(frames) = integer::<usize>(word).filter(|&frames| frames > 0) else {
            return Err(self.damaged(format!("{} is no number of frames", quoted(word))));
        };
        self.expect(b"Frame")?;
        self.expect(b"Time:")?;
        let word = self.word()?;
        let frame_time = self.number(word)?;
        if frame_time < 0.0 {
            let line = self.lines.number();
            return Err(Fault::invalid(format!("line {line}: the time of a frame is negative; correct it")));
        }
        let (channels, mut found, mut values) = (self.skeleton.channels(), 0, Vec::new());
        loop {
            let count = words(self.line).count();
            if count > 0 {
                if found == frames {
                    return Err(self.damaged(format!("there are more than the {frames} frames that are announced")));
                }
                if count != channels {
                    return Err(self.damaged(format!("the frame has {count} values where the channels are {channels}")));
                }
                for word in words(self.line) {
                    values.push(self.number(word)?);
                }
                found += 1;
            }
            match self.lines.next() {
                Some(line) => self.line = line,
                None if found == frames => return Ok(Motion { frame_time, channels, values }),
                None => {
                    return Err(Fault::damaged(format!(
                        "ends after {found} of {frames} frames; copy or export the file again"
                    )));
                }
            }
        }
    }
}
