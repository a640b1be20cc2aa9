//! Methods grouped by the rows that they read, so that frames are projected once per group.

use super::evaluation::{MethodEvaluation, Shape, cages};
use super::figures::{DRAW_FRAMES, draws};
use super::methods::{Method, methods};
use super::sample::{Frame, Sample};
use cager_core::inversion::{Handles, PrepareError, Solver, SolverOptions};
use cager_core::regularize::Regularizer;
use cager_core::spectral::{Analysis, HandleSystem};
use rayon::prelude::*;
use std::sync::Arc;

/// Which series this is; methods with their position in the order of all.
#[derive(Clone)]
pub(super) enum SeriesKind {
    Method(usize, Method),
    Noise(usize, Method),
    Draw(String, Vec<u32>, SolverOptions),
}

impl SeriesKind {
    fn options(&self) -> SolverOptions {
        match self {
            Self::Method(_, method) | Self::Noise(_, method) => method.options,
            Self::Draw(_, _, options) => *options,
        }
    }
}

/// A choice of rows to be prepared, and the series that read them.
pub(super) struct GroupPlan {
    pub(super) series: Vec<SeriesKind>,
}

/// All choices of rows: of the methods, at random, and those that maxvol starts from.
pub(super) fn plans(
    points: usize,
    unknowns: usize,
    usual: usize,
    damping: f64,
    in_order: bool,
    start: (String, Vec<u32>),
) -> Vec<GroupPlan> {
    let all = methods(unknowns, usual, damping, in_order);
    let mut plans: Vec<(Handles, GroupPlan)> = Vec::new();
    let noisy = all.iter().filter(|m| is_tried_with_noise(m)).cloned().enumerate();
    let noisy: Vec<SeriesKind> = noisy.map(|(order, method)| SeriesKind::Noise(order, method)).collect();
    let plain = all.into_iter().enumerate().map(|(order, method)| SeriesKind::Method(order, method));
    for series in plain.chain(noisy) {
        let handles = series.options().handles;
        match plans.iter_mut().find(|(of, _)| *of == handles) {
            Some((_, plan)) => plan.series.push(series),
            None => plans.push((handles, GroupPlan { series: vec![series] })),
        }
    }
    let regularised = SolverOptions { spectrum: usual, ..SolverOptions::PAPER };
    let drawn = draws(unknowns, points).into_iter().chain([start]).map(|(name, rows)| {
        let draw = |options| SeriesKind::Draw(name.clone(), rows.clone(), options);
        GroupPlan { series: [data_alone(), regularised].map(draw).to_vec() }
    });
    plans.into_iter().map(|(_, plan)| plan).chain(drawn).collect()
}

/// Options of the unregularised inversion.
pub(super) fn data_alone() -> SolverOptions {
    SolverOptions { regularizer: Regularizer::None, spectrum: 0, ..SolverOptions::default() }
}

/// Unregularised least squares, and methods that read fewer points.
fn is_tried_with_noise(method: &Method) -> bool {
    let SolverOptions { handles, regularizer, .. } = method.options;
    let is_tried = match regularizer {
        Regularizer::None => matches!(handles, Handles::All | Handles::MaxVol),
        Regularizer::Laplacian => handles != Handles::All,
        other => other == Regularizer::Global,
    };
    method.curve && is_tried
}

impl GroupPlan {
    pub(super) fn is_draw(&self) -> bool {
        matches!(self.series.first(), Some(SeriesKind::Draw(..)))
    }

    /// Upper estimate of the memory that the group takes, in bytes.
    pub(super) fn bytes(&self, analysis: &Analysis) -> usize {
        let m = analysis.coordinates().ncols();
        let columns = if analysis.decoder().dependent_normals().is_some() { analysis.decoder().columns() } else { 0 };
        let reads_all = self.series.iter().any(|series| series.options().handles == Handles::All);
        let read = if reads_all { analysis.coordinates().nrows() } else { 2 * m };
        8 * m * m * 4 + (8 * m * read + 16 * columns * columns) * self.series.len()
    }
}

/// Every method that reads the same rows.
pub(super) struct MethodGroup {
    methods: Vec<(SolverOptions, Arc<Solver>)>,
    pub(super) evaluations: Vec<(SeriesKind, MethodEvaluation)>,
    is_draw: bool,
    sample: Sample,
}

impl MethodGroup {
    /// Decomposes the rows of a plan and prepares its methods.
    pub(super) fn prepare(analysis: &Analysis, plan: &GroupPlan, sample: &Sample) -> Result<Self, PrepareError> {
        let handle_system = match plan.series.first() {
            Some(SeriesKind::Draw(_, rows, _)) => analysis.handle_system_of(rows)?,
            Some(SeriesKind::Method(_, method) | SeriesKind::Noise(_, method)) => {
                analysis.handle_system(method.options.handles)?
            }
            None => return Err(PrepareError::NoSolution { what: "choice of rows" }),
        };
        let mut options: Vec<SolverOptions> = Vec::new();
        for of in plan.series.iter().map(SeriesKind::options) {
            if !options.contains(&of) {
                options.push(of);
            }
        }
        // The first alone, since it computes what all of them share.
        let (first, others) = options.split_at(1);
        let prepared = |of: &SolverOptions| Ok((*of, Arc::new(solver(&handle_system, *of)?)));
        let mut methods: Vec<(SolverOptions, Arc<Solver>)> =
            first.iter().map(prepared).collect::<Result<_, PrepareError>>()?;
        methods.extend(others.par_iter().map(prepared).collect::<Result<Vec<_>, PrepareError>>()?);
        let iterates = analysis.decoder().dependent_normals().is_some();
        let sample = if iterates && plan.is_draw() { sample.some(DRAW_FRAMES) } else { sample.clone() };
        let evaluation = |series: &SeriesKind| {
            let (_, method) = methods.iter().find(|(of, _)| *of == series.options())?;
            let evaluation = MethodEvaluation::new(method.clone(), matches!(series, SeriesKind::Noise(..)), &sample);
            Some((series.clone(), evaluation))
        };
        let evaluations = plan.series.iter().filter_map(evaluation).collect();
        Ok(Self { methods, evaluations, is_draw: plan.is_draw(), sample })
    }

    pub(super) fn is_draw(&self) -> bool {
        self.is_draw
    }

    pub(super) fn reads_noise(&self) -> bool {
        self.evaluations.iter().any(|(_, evaluation)| evaluation.noisy)
    }

    /// Inverts and measures the frames that are needed; `with_noise` are all of them with noise.
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
        let sample = &self.sample;
        self.evaluations.par_iter_mut().for_each(|(_, evaluation)| {
            evaluation.take(if evaluation.noisy { with_noise } else { batch }, batch, sample, shape);
        });
    }

    /// Cages of frames by the method with these options, if it is among these.
    pub(super) fn invert(&self, options: SolverOptions, frames: &[&[f64]]) -> Option<Vec<Vec<f32>>> {
        let (_, solver) = self.methods.iter().find(|(of, _)| *of == options)?;
        Some(cages(solver, None, frames))
    }
}

/// A method as the paper has it: nothing keeps cages near their frames, unless iterations start
/// there.
pub(super) fn solver(handle_system: &HandleSystem<'_>, options: SolverOptions) -> Result<Solver, PrepareError> {
    let solver = handle_system.solver(options, None)?;
    let iterates = solver.decoder().dependent_normals().is_some();
    Ok(if iterates { solver } else { solver.without_nearness() })
}
