//! Groups of frames: collected, coded, and read back to measure what they decode to.

use super::{CodingError, Goal};
use cager_codec::{CageBasis, Hierarchy, Residual, ResidualGroup, decode_cages, encode_cages, encode_residual};
use cager_core::decode::{Decoder, FrameError};
use cager_core::inversion::BATCH;
use cager_core::mesh::Model;
use cager_proto::container::most_residual_numbers;
use rayon::prelude::*;

/// Steps of the numbers, in the capture's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steps {
    pub(crate) cage: f64,
    pub(crate) residual: Option<f64>,
}

/// A group of frames as a container holds it, and the errors of what it decodes to.
pub(crate) struct CodedGroup {
    pub(crate) cages: Vec<u8>,
    pub(crate) residual: Option<Vec<u8>>,
    pub(crate) errors: Vec<FrameError>,
    /// The frame whose cage lies farthest from the origin, and how far.
    pub(crate) farthest: (usize, f64),
}

impl CodedGroup {
    pub(super) fn bytes(&self) -> u64 {
        (self.cages.len() + self.residual.as_ref().map_or(0, |r| r.len() + SECTION)) as u64 + SECTION as u64
    }

    pub(super) fn mean(&self) -> f64 {
        self.errors.iter().map(|error| error.l2).sum::<f64>() / self.errors.len().max(1) as f64
    }
}

/// Bytes of a section beside its payload: its header, and its entry in the table of contents.
const SECTION: usize = 80;
/// What is left of a size.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Room {
    /// Bytes for frames.
    pub(crate) bytes: u64,
    /// Frames.
    pub(crate) frames: usize,
    /// Bytes of everything else, and of groups before.
    pub(crate) other: u64,
}

/// Collects frames and codes them group by group.
pub(crate) struct GroupCoder<'a> {
    pub(super) goal: Goal,
    pub(super) basis: &'a CageBasis,
    hierarchy: Hierarchy,
    pub(super) decoder: &'a Decoder,
    pub(super) diagonal: f64,
    /// Step of the residual and of the cage over it; set by the first group.
    pub(super) chosen: Option<(f64, f64)>,
    /// What is left, where a size was asked for.
    pub(super) room: Option<Room>,
    pub(super) frames: Vec<Vec<f64>>,
    cages: Vec<Vec<f32>>,
    most: usize,
    first: usize,
}

impl<'a> GroupCoder<'a> {
    /// For a prepared model. `rest` is what a decoder reads, `diagonal` the unit of errors; `room` is what a size leaves for the frames.
    pub(crate) fn new(
        goal: Goal,
        rest: &Model,
        diagonal: f64,
        basis: &'a CageBasis,
        decoder: &'a Decoder,
        most: usize,
        room: Option<Room>,
    ) -> Self {
        Self {
            goal,
            basis,
            hierarchy: Hierarchy::new(&rest.faces, rest.points.len()),
            decoder,
            diagonal,
            chosen: None,
            room,
            frames: Vec::new(),
            cages: Vec::new(),
            most,
            first: 0,
        }
    }

    /// The steps in use.
    pub(crate) fn steps(&self) -> Option<Steps> {
        self.chosen.map(|(residual, ratio)| self.steps_of(residual, ratio))
    }

    /// Adds a frame; true where the group is full and to be [closed](Self::close).
    pub(crate) fn push(&mut self, frame: Vec<f64>, cage: Vec<f32>) -> bool {
        self.frames.push(frame);
        self.cages.push(cage);
        self.frames.len() >= self.most
    }

    /// Whether frames wait.
    pub(crate) fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Codes what was collected and begins the next group.
    pub(crate) fn close(&mut self) -> Result<CodedGroup, CodingError> {
        if let Goal::MaxError(asked) | Goal::MeanError(asked) = self.goal {
            self.check_precision(asked, if matches!(self.goal, Goal::MaxError(_)) { 4.0 } else { 1.0 })?;
        }
        let (residual, ratio) = match self.chosen {
            Some(chosen) => chosen,
            None => self.choose()?,
        };
        self.chosen = Some((residual, ratio));
        let group = match self.goal {
            Goal::MeanError(error) => self.code_to_mean(error * self.diagonal)?,
            Goal::Size(bytes) => self.code_to_size(bytes)?,
            Goal::MaxError(_) | Goal::Preview | Goal::Standard => self.code(self.frames.len(), residual, ratio)?,
        };
        self.first += self.frames.len();
        self.frames.clear();
        self.cages.clear();
        Ok(group)
    }

    /// What a decoded position may be off, less what machines may differ by in rounding.
    fn bound(&self) -> Option<f64> {
        let Goal::MaxError(asked) = self.goal else { return None };
        Some(asked * self.diagonal - self.slack())
    }

    /// What positions of these frames may differ by from machine to machine.
    pub(super) fn slack(&self) -> f64 {
        let far = self.frames.iter().flatten().fold(0.0f64, |far, x| far.max(x.abs()));
        1e-6 * self.diagonal + f64::from(f32::EPSILON) * far
    }

    /// Whether an error is so many times larger than that.
    pub(super) fn check_precision(&self, asked: f64, times: f64) -> Result<(), CodingError> {
        let least = times * self.slack() / self.diagonal;
        if asked < least { Err(CodingError::BelowPrecision { asked, least }) } else { Ok(()) }
    }

    pub(super) fn steps_of(&self, residual: f64, ratio: f64) -> Steps {
        let cage = ratio * residual / (self.decoder.points() as f64).sqrt();
        Steps { cage, residual: (self.goal != Goal::Preview).then_some(residual) }
    }

    pub(super) fn uncountable(&self) -> CodingError {
        CodingError::Uncountable { first: self.first, last: self.first + self.frames.len().saturating_sub(1) }
    }

    /// Codes the first frames that were collected.
    pub(super) fn code(&self, count: usize, residual: f64, ratio: f64) -> Result<CodedGroup, CodingError> {
        let steps = self.steps_of(residual, ratio);
        let cages: Vec<&[f32]> = self.cages[..count].iter().map(Vec::as_slice).collect();
        let captured: Vec<&[f64]> = self.frames[..count].iter().map(Vec::as_slice).collect();
        // Cages that travel very far are counted in larger steps; the residual says the rest.
        let coded = (0..16).find_map(|doubled| encode_cages(self.basis, &cages, steps.cage * f64::from(1 << doubled)));
        let coded = coded.ok_or_else(|| self.uncountable())?;
        // From here on what a decoder has.
        let decoded = decode_cages(self.basis, count, &coded).map_err(|_| self.uncountable())?;
        let mut positions: Vec<Vec<f32>> = vec![Vec::new(); count];
        for (cages, positions) in decoded.chunks(BATCH).zip(positions.chunks_mut(BATCH)) {
            let cages: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
            self.decoder.decode(&cages, positions);
        }
        let mut residual = None;
        if let Some(step) = steps.residual {
            let group = ResidualGroup {
                captured: &captured,
                of_cages: &positions,
                step,
                bound: self.bound(),
                most_numbers: most_residual_numbers(0),
            };
            let bytes = encode_residual(&self.hierarchy, &group).ok_or_else(|| self.uncountable())?;
            let read = Residual::decode(&self.hierarchy, count, &bytes, usize::MAX).map_err(|_| self.uncountable())?;
            if read.is_needed() {
                read.add(0, &mut positions);
                residual = Some(bytes);
            }
        }
        let measured = positions.par_iter().zip(&captured);
        let errors = measured.map(|(decoded, captured)| FrameError::of_positions(decoded, captured)).collect();
        let extents = decoded.iter().map(|cage| f64::from(cage.iter().fold(0.0f32, |far, x| far.max(x.abs()))));
        let farthest = extents.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        let group = CodedGroup { cages: coded, residual, errors, farthest };
        if let Goal::MaxError(error) = self.goal
            && group.errors.iter().any(|found| found.linf.is_nan() || found.linf > error * self.diagonal)
        {
            return Err(self.uncountable());
        }
        Ok(group)
    }
}
