//! Where frames to upload come from.

use std::io;

/// Frames of a capture that can be read from any frame on: an upload that broke off goes on in the middle.
///
/// It is read on a thread of its own, so it may block.
pub trait FrameSource: Send {
    /// Points of every frame.
    fn points(&self) -> usize;

    /// Number of frames, where it is known before the last is read.
    fn frames(&self) -> Option<u32>;

    /// Makes `frame` the next one. One past the last is no error.
    ///
    /// # Errors
    /// Those of reading.
    fn seek(&mut self, frame: u32) -> io::Result<()>;

    /// Reads the next frame into `out`, replacing what it held: points × 3 coordinates, `x y z x y z …`. False after the
    /// last one.
    ///
    /// # Errors
    /// Those of reading; the message should say what to do.
    fn read(&mut self, out: &mut Vec<f32>) -> io::Result<bool>;
}

impl<S: FrameSource + ?Sized> FrameSource for Box<S> {
    fn points(&self) -> usize {
        (**self).points()
    }

    fn frames(&self) -> Option<u32> {
        (**self).frames()
    }

    fn seek(&mut self, frame: u32) -> io::Result<()> {
        (**self).seek(frame)
    }

    fn read(&mut self, out: &mut Vec<f32>) -> io::Result<bool> {
        (**self).read(out)
    }
}

/// Frames in memory.
#[derive(Clone, Debug)]
pub struct MemoryFrames {
    points: usize,
    values: std::sync::Arc<[f32]>,
    next: usize,
}

impl MemoryFrames {
    /// Frames of `points` points each, one after another: frames × points × 3 values.
    ///
    /// # Panics
    /// Where the values are no whole frames, or more than a session can have.
    pub fn new(points: usize, values: impl Into<std::sync::Arc<[f32]>>) -> Self {
        let values = values.into();
        assert!(points > 0 && values.len().is_multiple_of(3 * points), "whole frames of {points} points");
        assert!(u32::try_from(values.len() / (3 * points)).is_ok(), "no more frames than a session can have");
        Self { points, values, next: 0 }
    }
}

impl FrameSource for MemoryFrames {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> Option<u32> {
        u32::try_from(self.values.len() / (3 * self.points)).ok()
    }

    fn seek(&mut self, frame: u32) -> io::Result<()> {
        self.next = frame as usize;
        Ok(())
    }

    fn read(&mut self, out: &mut Vec<f32>) -> io::Result<bool> {
        out.clear();
        let Some(frame) = self.values.chunks_exact(3 * self.points).nth(self.next) else { return Ok(false) };
        out.extend_from_slice(frame);
        self.next += 1;
        Ok(true)
    }
}

/// Frames that a function makes or fetches.
pub struct FnFrames<F> {
    points: usize,
    frames: Option<u32>,
    next: u32,
    fill: F,
}

impl<F: FnMut(u32, &mut Vec<f32>) -> io::Result<bool> + Send> FnFrames<F> {
    /// `fill` puts the frame of the given number into the empty vector, or returns false where there is none; `frames` is
    /// their number, where it is known.
    pub fn new(points: usize, frames: Option<u32>, fill: F) -> Self {
        Self { points, frames, next: 0, fill }
    }
}

impl<F: FnMut(u32, &mut Vec<f32>) -> io::Result<bool> + Send> FrameSource for FnFrames<F> {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> Option<u32> {
        self.frames
    }

    fn seek(&mut self, frame: u32) -> io::Result<()> {
        self.next = frame;
        Ok(())
    }

    fn read(&mut self, out: &mut Vec<f32>) -> io::Result<bool> {
        out.clear();
        if self.frames.is_some_and(|frames| self.next >= frames) {
            return Ok(false);
        }
        let more = (self.fill)(self.next, out)?;
        self.next += u32::from(more);
        Ok(more)
    }
}
