//! The part of a BVH file behind `MOTION`: one line of values for each frame.

use super::hierarchy::finite;
use super::skeleton::Motion;
use super::words::Words;
use crate::error::Fault;
use crate::text::{integer, quoted, words};

/// Reads the frames of a skeleton with so many channels.
pub(super) fn read(text: &mut Words<'_>, channels: usize) -> Result<Motion, Fault> {
    label(text, &[b"Frames:"])?;
    let word = text.next().unwrap_or_default();
    let Some(frames) = integer::<usize>(word).filter(|&frames| frames > 0) else {
        return Err(Fault::damaged(format!("line {}: {} is no number of frames", text.number(), quoted(word))));
    };
    label(text, &[b"Frame", b"Time:"])?;
    let frame_time = finite(text.next().unwrap_or_default(), text.number())?;
    if frame_time < 0.0 {
        return Err(Fault::invalid(format!("line {}: the time of a frame is negative; correct it", text.number())));
    }
    let mut values = Vec::new();
    let mut found = 0;
    loop {
        let line = text.rest_of_line();
        if !line.is_empty() {
            if found == frames {
                return Err(Fault::damaged(format!(
                    "line {}: there are more than the {frames} frames that are announced; export the motion again",
                    text.number()
                )));
            }
            frame(line, text.number(), channels, &mut values)?;
            found += 1;
        }
        match text.lines.next() {
            Some(line) => text.line = line,
            None => break,
        }
    }
    if found < frames {
        return Err(Fault::damaged(format!("ends after {found} of {frames} frames; copy or export the file again")));
    }
    Ok(Motion { frame_time, channels, values })
}

fn frame(line: &[u8], number: usize, channels: usize, values: &mut Vec<f64>) -> Result<(), Fault> {
    let before = values.len();
    for word in words(line) {
        if values.len() - before == channels {
            return Err(wrong_count(number, words(line).count(), channels));
        }
        values.push(finite(word, number)?);
    }
    if values.len() - before < channels {
        return Err(wrong_count(number, values.len() - before, channels));
    }
    Ok(())
}

fn wrong_count(line: usize, found: usize, channels: usize) -> Fault {
    Fault::damaged(format!(
        "line {line}: the frame has {found} values where the channels are {channels}; copy or export the file again"
    ))
}

fn label(text: &mut Words<'_>, expected: &[&[u8]]) -> Result<(), Fault> {
    for &expected in expected {
        let Some(word) = text.next_label(expected) else {
            return Err(Fault::damaged(format!(
                "ends after line {}, before its frames; copy or export the file again",
                text.number()
            )));
        };
        if !word.eq_ignore_ascii_case(expected) {
            return Err(Fault::damaged(format!(
                "line {}: {} where {} is expected; export the motion again",
                text.number(),
                quoted(word),
                quoted(expected)
            )));
        }
    }
    Ok(())
}
