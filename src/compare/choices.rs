//! Choices of rows, and what each is tried with: frames are projected once for all methods that read the same rows.

use super::figures::{DRAW_FRAMES, draws};
use super::methods::{Method, methods};
use super::sample::{Frame, Sample};
use super::track::{Batch, Shape, Track};
use cager_core::inversion::{Analysis, Factored, Handles, PrepareError, Reading, SolverOptions};
use cager_core::regularize::Regularizer;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Times of an inversion are the least of this many.
const REPEATS: usize = 3;

/// What a track is of; methods with their place among all.
#[derive(Clone)]
pub(super) enum Subject {
    Method(usize, Method),
    Noise(usize, Method),
    Draw(String, Vec<u32>, SolverOptions),
}

impl Subject {
    fn options(&self) -> SolverOptions {
        match self {
            Self::Method(_, method) | Self::Noise(_, method) => method.options(),
            Self::Draw(_, _, options) => *options,
        }
    }
}

/// A choice of rows that is to be prepared.
pub(super) struct Plan {
    pub(super) subjects: Vec<Subject>,
}

/// Every choice of rows: those of the methods, draws at random, and the rows maxvol starts from, with their name.
pub(super) fn plans(
    points: usize,
    unknowns: usize,
    usual: usize,
    damping: f64,
    in_order: bool,
    start: (String, Vec<u32>),
) -> Vec<Plan> {
    let all = methods(unknowns, usual, damping, in_order);
    let mut plans: Vec<(Handles, Plan)> = Vec::new();
    let noisy = all.iter().filter(|m| is_tried_with_noise(m)).cloned().enumerate();
    let noisy: Vec<Subject> = noisy.map(|(order, method)| Subject::Noise(order, method)).collect();
    let plain = all.into_iter().enumerate().map(|(order, method)| Subject::Method(order, method));
    for subject in plain.chain(noisy) {
        let handles = subject.options().handles;
        match plans.iter_mut().find(|(of, _)| *of == handles) {
            Some((_, plan)) => plan.subjects.push(subject),
            None => plans.push((handles, Plan { subjects: vec![subject] })),
        }
    }
    let regularised = SolverOptions { spectrum: usual, ..SolverOptions::PAPER };
    let drawn = draws(unknowns, points).into_iter().chain([start]).map(|(name, rows)| {
        let draw = |options| Subject::Draw(name.clone(), rows.clone(), options);
        Plan { subjects: [data_alone(), regularised].map(draw).to_vec() }
    });
    plans.into_iter().map(|(_, plan)| plan).chain(drawn).collect()
}

/// Plain inversion.
pub(super) fn data_alone() -> SolverOptions {
    SolverOptions { regularizer: Regularizer::None, spectrum: 0, ..SolverOptions::default() }
}

/// Plain least squares, and what reads fewer points.
fn is_tried_with_noise(method: &Method) -> bool {
    let plain = method.regularizer == Regularizer::None && matches!(method.handles, Handles::All | Handles::MaxVol);
    let proposed = method.regularizer == Regularizer::Laplacian && method.handles != Handles::All;
    method.curve && (plain || proposed || method.regularizer == Regularizer::Global)
}

impl Plan {
    pub(super) fn is_draw(&self) -> bool {
        matches!(self.subjects.first(), Some(Subject::Draw(..)))
    }

    /// Bytes that its choice will take at the most, about.
    pub(super) fn bytes(&self, analysis: &Analysis) -> usize {
        let m = analysis.coordinates().ncols();
        let columns = if analysis.decoder().tied_normals().is_some() { analysis.decoder().columns() } else { 0 };
        let operator = if columns > 0 { m * analysis.coordinates().nrows() } else { 0 };
        8 * m * m * 4 + (8 * (m * m + operator) + 16 * columns * columns) * self.subjects.len()
    }
}

/// Rows with their decomposition, and every method that reads them.
pub(super) struct Choice<'a> {
    pub(super) reading: Reading<'a>,
    pub(super) methods: Vec<(SolverOptions, Arc<Factored>)>,
    pub(super) tracks: Vec<(Subject, Track)>,
    is_tied: bool,
    is_draw: bool,
    /// The frames measured.
    sample: Sample,
}

impl<'a> Choice<'a> {
    /// Decomposes the rows of a plan and prepares its methods.
    pub(super) fn prepare(analysis: &'a Analysis, plan: &Plan, sample: &Sample) -> Result<Self, PrepareError> {
        let reading = match plan.subjects.first() {
            Some(Subject::Draw(_, rows, _)) => analysis.reading_of(rows)?,
            Some(Subject::Method(_, method) | Subject::Noise(_, method)) => analysis.reading(method.handles)?,
            None => return Err(PrepareError::NoSolution { what: "choice of rows" }),
        };
        let mut options: Vec<SolverOptions> = Vec::new();
        for of in plan.subjects.iter().map(Subject::options) {
            if !options.contains(&of) {
                options.push(of);
            }
        }
        // The first by itself: what all of them share is computed with it.
        let (first, others) = options.split_at(1);
        let factored = |of: &SolverOptions| Ok((*of, Arc::new(reading.factored(*of)?)));
        let mut methods: Vec<(SolverOptions, Arc<Factored>)> =
            first.iter().map(factored).collect::<Result<_, PrepareError>>()?;
        methods.extend(others.par_iter().map(factored).collect::<Result<Vec<_>, PrepareError>>()?);
        let is_tied = analysis.decoder().tied_normals().is_some();
        let sample = if is_tied && plan.is_draw() { sample.some(DRAW_FRAMES) } else { sample.clone() };
        let track = |subject: &Subject| {
            let (_, method) = methods.iter().find(|(of, _)| *of == subject.options())?;
            let track = Track::new(method.clone(), matches!(subject, Subject::Noise(..)), &sample);
            Some((subject.clone(), track))
        };
        let tracks = plan.subjects.iter().filter_map(track).collect();
        Ok(Self { reading, methods, tracks, is_tied, is_draw: plan.is_draw(), sample })
    }

    pub(super) fn is_draw(&self) -> bool {
        self.is_draw
    }

    pub(super) fn reads_noise(&self) -> bool {
        self.tracks.iter().any(|(_, track)| track.noisy)
    }

    /// Times the matrix product that encoding takes, which is the same for every method that reads these rows; where frames depend
    /// on each other, with what that takes. Where every method iterates, tracks are timed on their way instead.
    pub(super) fn time(&mut self, batch: &[Frame]) -> Result<(), PrepareError> {
        if self.is_draw || self.is_tied {
            return Ok(());
        }
        let frames: Vec<&[f64]> = batch.iter().map(|frame| frame.points.as_slice()).collect();
        let mut known: Option<f64> = None;
        for (subject, track) in &mut self.tracks {
            let ordered = track.method.follows_previous();
            track.frame_seconds = match known.filter(|_| !ordered) {
                Some(seconds) => seconds,
                None => {
                    let solver = self.reading.solver(subject.options())?;
                    let seconds = (0..REPEATS).map(|_| {
                        let clock = Instant::now();
                        std::hint::black_box(solver.invert_after(None, &frames));
                        clock.elapsed().as_secs_f64()
                    });
                    seconds.fold(f64::INFINITY, f64::min) / frames.len() as f64
                }
            };
            if !ordered {
                known = Some(track.frame_seconds);
            }
        }
        Ok(())
    }

    /// Inverts and measures those of the frames that follow which are needed; `with_noise` are all of them with noise, for methods.
    pub(super) fn take(&mut self, batch: &[Frame], with_noise: &[Frame], shape: &Shape) {
        let needed = batch.iter().filter(|frame| self.sample.needed(frame.number));
        let measured = |frame: &Frame| self.sample.position(frame.number).is_some();
        let some: Vec<Frame>;
        let batch = if self.is_draw {
            some = needed.map(|frame| Frame { measured: measured(frame), ..frame.clone() }).collect();
            some.as_slice()
        } else {
            batch
        };
        if batch.is_empty() {
            return;
        }
        let project = |of: &[Frame]| {
            let frames: Vec<&[f64]> = of.iter().map(|frame| frame.points.as_slice()).collect();
            self.reading.project(&frames)
        };
        let clean = project(batch);
        let noisy = self.reads_noise().then(|| project(with_noise));
        let (reading, is_tied, sample) = (&self.reading, self.is_tied, &self.sample);
        self.tracks.par_iter_mut().for_each(|(_, track)| {
            let (frames, projected) = match &noisy {
                Some(noisy) if track.noisy => (with_noise, noisy),
                _ => (batch, &clean),
            };
            track.take(&Batch { reading, projected, timed: is_tied, frames, clean: batch }, sample, shape);
        });
    }

    /// Cages of up to a batch of frames by the method with these options, if it is among these.
    pub(super) fn invert(&self, options: SolverOptions, frames: &[&[f64]]) -> Option<Vec<Vec<f32>>> {
        let (_, method) = self.methods.iter().find(|(of, _)| *of == options)?;
        Some(self.reading.cages(method, None, &self.reading.project(frames), frames))
    }
}
