//! Frames for a computation on another thread, handed over one by one by the thread that reads the arrays.

use crate::apart::Caller;
use cager_formats::{Error, FrameReader};
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, Sender};

/// What is asked of the frames.
#[derive(Clone, Copy)]
pub(crate) enum Next {
    Read,
    Skip,
}

type Handed = Result<Option<Vec<f64>>, Error>;

/// The frames as the computation reads them.
pub(crate) struct HandedFrames {
    caller: Caller<Next>,
    handed: Receiver<Handed>,
    points: usize,
    numbers: Vec<f64>,
    frame_rate: Option<f64>,
}

/// Where they come from.
pub(crate) struct HandingFrames<R> {
    frames: R,
    hand: Sender<Handed>,
}

impl<R: FrameReader> HandingFrames<R> {
    /// Frames of a reader, and what makes frames of a caller of them.
    pub(crate) fn new(frames: R) -> (Self, impl FnOnce(Caller<Next>) -> HandedFrames + Send + 'static) {
        let (hand, handed) = mpsc::channel();
        let (points, frame_rate) = (frames.points(), frames.frame_rate());
        let numbers = (0..frames.frames()).map(|frame| frames.number(frame)).collect();
        let taken = move |caller| HandedFrames { caller, handed, points, numbers, frame_rate };
        (Self { frames, hand }, taken)
    }

    /// Answers.
    pub(crate) fn serve(&mut self, next: Next) {
        let mut frame = Vec::new();
        let more = match next {
            Next::Read => self.frames.read_next(&mut frame),
            Next::Skip => self.frames.skip(),
        };
        // Where the computation has ended meanwhile, nobody takes it.
        let _ = self.hand.send(more.map(|more| more.then_some(frame)));
    }
}

impl HandedFrames {
    fn next(&self, next: Next) -> Handed {
        let asked = self.caller.ask(next).is_continue();
        let handed = asked.then(|| self.handed.recv().ok()).flatten();
        handed.unwrap_or_else(|| Err(Error::Invalid { path: PathBuf::from("frames"), what: "stopped".to_owned() }))
    }
}

impl FrameReader for HandedFrames {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.numbers.len()
    }

    fn number(&self, frame: usize) -> f64 {
        self.numbers.get(frame).copied().unwrap_or(frame as f64)
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        let frame = self.next(Next::Read)?;
        let more = frame.is_some();
        *out = frame.unwrap_or_default();
        Ok(more)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        Ok(self.next(Next::Skip)?.is_some())
    }
}
