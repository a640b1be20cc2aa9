//! Values at times, which parsers read when they are asked for.

use crate::error::Fault;
use crate::frames::{Scalar, Times};

/// Frames that any scene may have, as repetitions and points that a transform moves take no
/// room. Of more it holds every other one.
pub(crate) const MOST_REPEATED: usize = 1 << 14;
/// Shares of the way from one sample to the next by which a time may miss one.
const NEAR: f64 = 1e-6;

/// Refuses frames of which the scene holds fewer than half.
pub(crate) fn check_held(frames: usize, is_held: bool) -> Result<(), Fault> {
    if frames <= MOST_REPEATED || is_held {
        return Ok(());
    }
    Err(Fault::unsupported(format!(
        "promises {frames} frames, of which it holds fewer than half; export {MOST_REPEATED} frames at the most, or \
         all of them as positions"
    )))
}

/// Where a parser stores a value: opaque to all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Value(pub(crate) u64);

#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    /// The value where there are no times.
    pub(crate) default: Option<Value>,
    /// Ascending, and the value at each.
    pub(crate) times: Vec<f64>,
    pub(crate) values: Vec<Value>,
}

impl Track {
    pub(crate) fn is_empty(&self) -> bool {
        self.default.is_none() && self.times.is_empty()
    }

    /// The value that does not change, or else the first one.
    pub(crate) fn still(&self) -> Option<Value> {
        self.default.or_else(|| self.values.first().copied())
    }

    /// The value at a time, the next one, and the share of the way there; the default where there
    /// are no times. Before the first and after the last they hold.
    pub(crate) fn at(&self, time: f64) -> Option<(Value, Value, f64)> {
        let Some(last) = self.times.len().checked_sub(1) else { return self.default.map(|value| (value, value, 0.0)) };
        let (low, share) = position(&self.times, time);
        Some((self.values[low], self.values[(low + 1).min(last)], share))
    }
}

/// The last of at least one time that is not after another, and the share of the way to the next.
pub(crate) fn position(times: &[f64], time: f64) -> (usize, f64) {
    let low = times.partition_point(|&t| t <= time).saturating_sub(1);
    let (before, after) = (times[low], times[(low + 1).min(times.len() - 1)]);
    let share = if after > before { ((time - before) / (after - before)).max(0.0) } else { 0.0 };
    if share > 1.0 - NEAR { (low + 1, 0.0) } else { (low, if share > NEAR { share } else { 0.0 }) }
}

/// All of some times once, ascending; those are one that are nearer than `near`.
pub(crate) fn union(mut times: Vec<f64>, near: f64) -> Vec<f64> {
    times.sort_by(f64::total_cmp);
    times.dedup_by(|later, earlier| *later - *earlier <= near);
    times
}

#[derive(Default)]
pub(crate) struct Timeline {
    pub(crate) times: Times,
    /// The time of each frame, as the tracks of the scene count it.
    pub(crate) at: Vec<f64>,
}

/// Whole frames of a rate from one time to another, in seconds, where so many keys are.
pub(crate) fn whole_frames([begin, end]: [f64; 2], rate: f64, keys: usize) -> Result<Timeline, Fault> {
    // Frames by which the first and the last may miss whole ones, and past which numbers say nothing.
    const SLACK: f64 = 1e-3;
    const FARTHEST: f64 = 1e9;
    let first = (begin * rate - SLACK).ceil();
    let last = (end * rate + SLACK).floor().max(first);
    if ![first, last].iter().all(|number| number.abs() < FARTHEST) {
        return Err(Fault::invalid(format!(
            "has times from {begin} s to {end} s, too far for {rate} frames per second; export it again with times \
             near 0 s"
        )));
    }
    let count = (last - first) as usize + 1;
    check_held(count, keys >= count / 2)?;
    let at = (0..count).map(|frame| (first + frame as f64) / rate).collect();
    Ok(Timeline { times: Times { frame_rate: Some(rate), first, ..Times::default() }, at })
}

/// An array of points, which lies in the file as it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Points {
    pub(crate) start: u64,
    pub(crate) count: usize,
    pub(crate) scalar: Scalar,
}

pub(crate) trait Values: Send {
    /// The numbers of a value: a number, a vector, a quaternion (real part last) or matrices.
    fn numbers(&mut self, value: Value) -> Result<Vec<f64>, Fault>;

    /// An array of at most so many whole numbers.
    fn integers(&mut self, value: Value, most: u64) -> Result<Vec<i32>, Fault>;

    fn points(&mut self, value: Value) -> Result<Points, Fault>;

    /// Reads points, `x y z x y z …`, all of which are overwritten; gives whether all are finite.
    fn read(&mut self, points: Points, out: &mut [f64]) -> Result<bool, Fault>;
}
