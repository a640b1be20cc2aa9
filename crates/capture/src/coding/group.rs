//! Groups of frames: collected, coded, and read back to measure what they decode to.

use super::error::{CodingError, Farthest};
use super::goal::{Carried, Goal, slack};
use super::model::GroupDecoder;
use cager_codec::{
    AdjacentGroups, Hierarchy, Residual, ResidualGroup, encode_cages, encode_residual, estimate_residual,
};
use cager_core::decode::FrameError;
use cager_proto::container::most_residual_numbers;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// A group of frames as a container holds it, and the errors of what it decodes to.
pub struct CodedGroup {
    /// The coded cages.
    pub cages: Vec<u8>,
    /// The coded residual, where there is one.
    pub residual: Option<Vec<u8>>,
    /// Errors of the decoded frames.
    pub errors: Vec<FrameError>,
    /// The frame whose cage lies farthest from the origin, and how far.
    pub farthest: (usize, f64),
}

impl CodedGroup {
    pub(super) fn bytes(&self) -> u64 {
        (self.cages.len() + SECTION + self.residual.as_ref().map_or(0, |residual| residual.len() + SECTION)) as u64
    }

    pub(super) fn mean(&self) -> f64 {
        self.errors.iter().map(|error| error.l2).sum::<f64>() / self.errors.len().max(1) as f64
    }
}

/// A group's bytes, whose residual may be only estimated, and what they say.
pub(super) struct Encoded {
    /// Errors are empty until they are measured.
    pub(super) group: CodedGroup,
    residual: Option<Residual>,
    /// Where the cages take the points; when these are measured, with the residual.
    positions: Vec<Vec<f32>>,
}

/// Bytes of a section beside its payload: its header, and its entry in the table of contents.
const SECTION: usize = 80;

/// Collects frames and codes them group by group.
pub struct GroupCoder {
    pub(super) goal: Goal,
    pub(super) model: Arc<GroupDecoder>,
    pub(super) diagonal: f64,
    pub(super) carried: Carried,
    pub(super) frames: Vec<Vec<f64>>,
    pub(super) cages: Vec<Vec<f32>>,
    pub(super) most: usize,
    /// See [`slack`], of the frames that wait.
    slack: OnceLock<f64>,
}

impl GroupCoder {
    /// For groups of at most `most` frames of a prepared model. `diagonal` is the unit of errors.
    pub fn new(goal: Goal, model: Arc<GroupDecoder>, diagonal: f64, most: usize, carried: Carried) -> Self {
        Self { goal, model, diagonal, carried, frames: Vec::new(), cages: Vec::new(), most, slack: OnceLock::new() }
    }

    /// What the groups so far leave to the next.
    pub fn carried(&self) -> Carried {
        self.carried
    }

    /// Says that so many frames are left, those that wait included.
    pub fn expect(&mut self, frames: usize) {
        if let Some(room) = &mut self.carried.room {
            room.frames = frames;
        }
    }

    /// Forgets frames that wait.
    fn clear(&mut self) {
        self.frames.clear();
        self.cages.clear();
        self.slack = OnceLock::new();
    }

    /// Adds a frame; true where the group is full and to be [closed](Self::close).
    pub fn push(&mut self, frame: Vec<f64>, cage: Vec<f32>) -> bool {
        self.frames.push(frame);
        self.cages.push(cage);
        self.frames.len() >= self.most
    }

    /// Whether frames wait.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Codes what was collected and begins the next group.
    pub fn close(&mut self) -> Result<CodedGroup, CodingError> {
        self.goal.check_precision(self.diagonal, self.slack()).map_err(|error| self.explained(error))?;
        let (residual, ratio) = match self.carried.chosen {
            Some(chosen) => chosen,
            None => self.choose()?,
        };
        self.carried.chosen = Some((residual, ratio));
        let group = match self.goal {
            Goal::MeanError(error) => self.code_to_mean(error * self.diagonal)?,
            Goal::Size(bytes) => self.code_to_size(bytes)?,
            Goal::MaxError(_) | Goal::Preview | Goal::Standard => self.code(self.frames.len(), residual, ratio)?,
        };
        self.carried.frames += self.frames.len();
        self.clear();
        Ok(group)
    }

    /// What a decoded position may be off, less what machines may differ by in rounding.
    fn bound(&self) -> Option<f64> {
        let Goal::MaxError(asked) = self.goal else { return None };
        Some(asked * self.diagonal - self.slack())
    }

    /// What machines may differ by in these frames.
    fn slack(&self) -> f64 {
        *self.slack.get_or_init(|| {
            let farthest = self.frames.iter().flatten().fold(0.0f64, |far, x| far.max(x.abs()));
            // A mean error is promised of no other machine.
            let is_bound = matches!(self.goal, Goal::MaxError(_));
            let sum = if is_bound { self.model.largest_sum(&self.cages) } else { 0.0 };
            slack(self.diagonal, self.model.terms(), sum, farthest)
        })
    }

    /// Names the position that an error follows from, where it is far away.
    fn explained(&self, error: CodingError) -> CodingError {
        /// Diagonals that are told of.
        const FAR: f64 = 10.0;
        let CodingError::BelowPrecision { asked, least, .. } = error else { return error };
        let places =
            self.frames.iter().enumerate().flat_map(|(k, frame)| {
                frame.iter().enumerate().map(move |(at, x)| (x.abs() / self.diagonal, k, at / 3))
            });
        let farthest = places.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(diagonals, ..)| *diagonals > FAR);
        let farthest =
            farthest.map(|(diagonals, frame, point)| Farthest { frame: self.carried.frames + frame, point, diagonals });
        CodingError::BelowPrecision { asked, least, farthest }
    }

    pub(super) fn uncountable(&self) -> CodingError {
        let first = self.carried.frames;
        CodingError::Uncountable { first, last: first + self.frames.len().saturating_sub(1) }
    }

    /// Codes the first frames that were collected.
    pub(super) fn code(&self, count: usize, residual: f64, ratio: f64) -> Result<CodedGroup, CodingError> {
        self.finish(self.encode(count, residual, ratio)?)
    }

    /// The bytes of the first frames that were collected.
    pub(super) fn encode(&self, count: usize, residual: f64, ratio: f64) -> Result<Encoded, CodingError> {
        let steps = self.goal.steps((residual, ratio), self.model.points());
        let mut encoded = self.encode_cages(count, steps.cage)?;
        if let Some(step) = steps.residual {
            let (coded, residual) = self.residual_of(&encoded.positions, step, encode_residual)?;
            (encoded.group.residual, encoded.residual) = (Some(coded), Some(residual));
        }
        Ok(encoded)
    }

    /// About the bytes of the first frames if this `part` of the points were all.
    pub(super) fn estimate(
        &self,
        count: usize,
        residual: f64,
        ratio: f64,
        part: f64,
    ) -> Result<(f64, Encoded), CodingError> {
        let steps = self.goal.steps((residual, ratio), self.model.points());
        let mut encoded = self.encode_cages(count, steps.cage)?;
        let mut bytes = encoded.group.cages.len() as f64;
        if let Some(step) = steps.residual {
            let (of_residual, residual) = self.residual_of(&encoded.positions, step, estimate_residual)?;
            bytes += of_residual / part;
            encoded.residual = Some(residual);
        }
        Ok((bytes, encoded))
    }

    /// The first frames without a residual.
    fn encode_cages(&self, count: usize, step: f64) -> Result<Encoded, CodingError> {
        let cages: Vec<&[f32]> = self.cages[..count].iter().map(Vec::as_slice).collect();
        // Cages that travel very far are counted in larger steps; the residual says the rest.
        let is_full = self.frames.len() >= self.most;
        let adjacent = AdjacentGroups { before: self.carried.frames > 0, after: count == self.frames.len() && is_full };
        let coded = (0..16).find_map(|k| encode_cages(&self.model.basis, &cages, step * f64::from(1 << k), adjacent));
        let coded = coded.ok_or_else(|| self.uncountable())?;
        // From here on what a decoder has.
        let decoded = self.model.cages(count, &coded).map_err(|_| self.uncountable())?;
        let positions = self.model.positions(&decoded);
        let extents = decoded.iter().map(|cage| f64::from(cage.iter().fold(0.0f32, |far, x| far.max(x.abs()))));
        let farthest = extents.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        let group = CodedGroup { cages: coded, residual: None, errors: Vec::new(), farthest };
        Ok(Encoded { group, residual: None, positions })
    }

    /// What `code` makes of that which the positions of cages leave of the first frames.
    fn residual_of<T>(
        &self,
        positions: &[Vec<f32>],
        step: f64,
        code: impl Fn(&Hierarchy, &ResidualGroup<'_>) -> Option<T>,
    ) -> Result<T, CodingError> {
        let captured: Vec<&[f64]> = self.frames[..positions.len()].iter().map(Vec::as_slice).collect();
        let (bound, most_numbers) = (self.bound(), most_residual_numbers(0));
        let group = ResidualGroup { captured: &captured, of_cages: positions, step, bound, most_numbers };
        code(&self.model.hierarchy, &group).ok_or_else(|| self.uncountable())
    }

    /// Measures what a group says.
    pub(super) fn measure(&self, encoded: &mut Encoded) {
        if let Some(residual) = encoded.residual.as_ref().filter(|residual| residual.is_needed()) {
            residual.add(0, &mut encoded.positions);
        }
        // They are needed no more, and another step may be tried beside.
        let positions = std::mem::take(&mut encoded.positions);
        let measured = positions.par_iter().zip(&self.frames);
        encoded.group.errors =
            measured.map(|(decoded, captured)| FrameError::of_positions(decoded, captured)).collect();
    }

    /// Reads the bytes of a group back, and checks that they say what was measured.
    pub(super) fn finish(&self, mut encoded: Encoded) -> Result<CodedGroup, CodingError> {
        let count = encoded.positions.len().max(encoded.group.errors.len());
        let coded = encoded.group.residual.take();
        let read = |bytes: &Vec<u8>| Residual::decode(&self.model.hierarchy, count, bytes, usize::MAX);
        let read = || coded.as_ref().map(read).transpose().map_err(|_| self.uncountable());
        let measure = || {
            if encoded.group.errors.is_empty() {
                self.measure(&mut encoded);
            }
        };
        let (read, ()) = rayon::join(read, measure);
        if read? != encoded.residual {
            return Err(self.uncountable());
        }
        let Encoded { mut group, residual, .. } = encoded;
        group.residual = coded.filter(|_| residual.is_some_and(|residual| residual.is_needed()));
        if let Goal::MaxError(error) = self.goal
            && group.errors.iter().any(|found| found.linf.is_nan() || found.linf > error * self.diagonal)
        {
            return Err(self.uncountable());
        }
        Ok(group)
    }
}
