//! Evaluation of one coordinate system: every method on every measured frame.

use super::evaluation::{MethodEvaluation, Motion, Shape};
use super::figures::{Draw, MethodFigures, NoiseFigures, Seconds, Spectra, Swaps, SystemFigures, Vectors};
use super::method_groups::{GroupPlan, MethodGroup, SeriesKind, plans};
use super::noise::{RADIUS, noisy};
use super::sample::{Frame, Sample};
use super::{CompareError, Job};
use cager_core::inversion::{BATCH, SolverOptions, default_spectrum};
use cager_core::spectral::Analysis;
use rayon::prelude::*;

/// Memory for groups of methods that are evaluated together, beside the coordinates they share.
const CHOICE_BYTES: usize = 640 << 20;
const BATCH_BYTES: usize = 256 << 20;

/// Rows with singular values below this fraction of the largest count as dependent.
const DEPENDENT: f64 = 1e-11;

/// A system with its figures, and what its geometry is made of.
pub(super) struct SystemStudy<'a> {
    pub(super) figures: SystemFigures,
    pub(super) analysis: &'a Analysis,
    /// The groups of methods, with their prepared systems.
    pub(super) method_groups: Vec<MethodGroup>,
    /// Mean and largest second temporal difference of the model itself.
    pub(super) motion: [f64; 2],
    /// Name and rows of the random draw with the median error.
    pub(super) median_draw: Option<(String, Vec<u32>)>,
}

impl SystemStudy<'_> {
    /// Cages of up to a batch of frames by one of the methods.
    pub(super) fn invert(&self, options: SolverOptions, frames: &[&[f64]]) -> Option<Vec<Vec<f32>>> {
        self.method_groups.iter().find_map(|choice| choice.invert(options, frames))
    }
}

/// Studies a system, analysed in so many seconds, on the sample.
pub(super) fn study<'a>(
    job: &Job<'_>,
    name: &str,
    (analysis, [coordinates, maxvol, svd]): (&'a Analysis, [f64; 3]),
    sample: &Sample,
    shape: &Shape,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<SystemStudy<'a>, CompareError> {
    progress(&format!("{name}: swaps"), 0.1);
    let (spectra, swaps, vectors) = (Spectra::of(analysis), Swaps::of(analysis), Vectors::of(analysis));
    let unknowns = analysis.coordinates().ncols();
    let usual = default_spectrum(unknowns);
    let damping = spectra.handles[spectra.handles.len().saturating_sub(usual + 1)];
    let start = ("pivoted LU".to_owned(), analysis.handles().map_or_else(Vec::new, |handles| handles.start.clone()));
    let plans = plans(job.rest.points.len(), unknowns, usual, damping, sample.is_complete(), start);

    let mut found = Results::default();
    let mut motion = Motion::new(sample);
    let mut kept = Vec::new();
    let total: usize = plans.iter().map(|plan| plan.series.len()).sum();
    let mut through = 0;
    let mut waiting = plans.as_slice();
    while !waiting.is_empty() {
        let mut bytes = 0;
        let fits = |plan: &&GroupPlan| {
            let before = bytes;
            bytes += plan.bytes(analysis);
            before < CHOICE_BYTES
        };
        let (group, later) = waiting.split_at(waiting.iter().take_while(fits).count());
        waiting = later;
        let fraction = |part: f64, here: usize| 0.2 + 0.7 * (through as f64 + part * here as f64) / total as f64;
        progress(&format!("{name}: inversions"), fraction(0.0, 0));
        let prepared: Vec<_> = group.par_iter().map(|plan| MethodGroup::prepare(analysis, plan, sample)).collect();
        // Rows drawn at random may determine nothing.
        let useful = prepared.into_iter().zip(group).filter(|(choice, plan)| choice.is_ok() || !plan.is_draw());
        let mut method_groups: Vec<MethodGroup> = useful.map(|(choice, _)| choice).collect::<Result<_, _>>()?;
        let here: usize = group.iter().map(|plan| plan.series.len()).sum();
        let motion = (through == 0).then_some(&mut motion);
        follow(job, &mut method_groups, motion, sample, shape, &mut |done| {
            let part = done as f64 / sample.to_read().max(1) as f64;
            progress(&format!("{name}: frame {done} of {}", sample.to_read()), fraction(part, here));
        })?;
        through += here;
        for mut choice in method_groups {
            for (series, evaluation) in std::mem::take(&mut choice.evaluations) {
                found.collect(series, evaluation);
            }
            kept.extend((!choice.is_draw()).then_some(choice));
        }
    }
    found.methods.sort_by_key(|(order, _)| *order);
    found.noise.sort_by_key(|(order, _)| *order);
    let prepared = analysis.preparation();
    let usual_seconds = |(_, m): &&(usize, MethodFigures)| m.method.is_cager() && m.method.options.spectrum == usual;
    let figures = SystemFigures {
        unknowns,
        rank: prepared.rank,
        affine_reproduction_error: prepared.affine_reproduction_error,
        outside: prepared.outside.len(),
        spectra,
        swaps,
        vectors,
        seconds: Seconds {
            coordinates,
            maxvol,
            svd,
            per_frame: found.methods.iter().find(usual_seconds).map_or(f64::NAN, |(_, m)| m.frame_seconds),
        },
        random: found.draws,
        methods: found.methods.into_iter().map(|(_, found)| found).collect(),
        noise: found.noise.into_iter().map(|(_, found)| found).collect(),
    };
    let median_draw = median_draw(&figures.random, found.rows);
    Ok(SystemStudy { figures, analysis, method_groups: kept, motion: motion.totals(), median_draw })
}

/// Evaluates all groups of methods on the frames of the capture.
fn follow(
    job: &Job<'_>,
    method_groups: &mut [MethodGroup],
    mut motion: Option<&mut Motion>,
    sample: &Sample,
    shape: &Shape,
    tell: &mut dyn FnMut(usize),
) -> Result<(), CompareError> {
    let mut reader = (job.open)()?;
    let size = (BATCH_BYTES / (24 * job.rest.points.len())).clamp(1, BATCH);
    let any_noise = method_groups.iter().any(MethodGroup::reads_noise);
    let (mut next, mut batch) = (0, Vec::new());
    loop {
        sample.fill(reader.as_mut(), &mut next, size, &mut batch)?;
        if batch.is_empty() {
            return Ok(());
        }
        if let Some(motion) = &mut motion {
            motion.take(&batch, sample, shape.diagonal);
        }
        let radius = RADIUS * shape.diagonal;
        let with_noise: Vec<Frame> = match any_noise {
            true => batch.par_iter().map(|f| Frame { points: noisy(&f.points, f.number, radius), ..*f }).collect(),
            false => Vec::new(),
        };
        method_groups.par_iter_mut().for_each(|choice| choice.take(&batch, &with_noise, shape));
        tell(next);
    }
}

/// Results of finished series; methods with their position in the order of all.
#[derive(Default)]
struct Results {
    methods: Vec<(usize, MethodFigures)>,
    noise: Vec<(usize, NoiseFigures)>,
    draws: Vec<Draw>,
    rows: Vec<Vec<u32>>,
}

impl Results {
    fn collect(&mut self, series: SeriesKind, evaluation: MethodEvaluation) {
        let totals = evaluation.found.totals();
        match series {
            SeriesKind::Method(order, method) => {
                let frame_seconds = evaluation.frame_seconds;
                self.methods
                    .push((order, MethodFigures { method, totals, per_frame: evaluation.found, frame_seconds }));
            }
            SeriesKind::Noise(order, method) => {
                let clean = evaluation.clean.totals();
                let (clean_l2_mean, clean_linf_max) = (clean.l2_mean, clean.linf_max);
                let per_frame = evaluation.found;
                self.noise.push((order, NoiseFigures { method, totals, per_frame, clean_l2_mean, clean_linf_max }));
            }
            SeriesKind::Draw(name, rows, _) => match self.draws.last_mut().filter(|draw| draw.choice == name) {
                Some(draw) => draw.totals = totals,
                None => {
                    let sigma = &evaluation.solver.preparation().singular_values;
                    let (first, last) = (sigma.first().copied().unwrap_or(0.0), sigma.last().copied().unwrap_or(0.0));
                    // For dependent rows this is rounding; a plot needs a finite value.
                    let condition = (first / last).min(1.0 / f64::EPSILON);
                    let rank = sigma.iter().filter(|&&x| x > DEPENDENT * first).count();
                    self.draws.push(Draw { choice: name, rank, condition, data_alone: totals, totals });
                    self.rows.push(rows);
                }
            },
        }
    }
}

/// The random draw with the median error.
fn median_draw(draws: &[Draw], rows: Vec<Vec<u32>>) -> Option<(String, Vec<u32>)> {
    let mut random: Vec<(&Draw, Vec<u32>)> =
        draws.iter().zip(rows).filter(|(draw, _)| draw.choice.starts_with("random")).collect();
    random.sort_by(|a, b| a.0.totals.l2_mean.total_cmp(&b.0.totals.l2_mean));
    let middle = random.len() / 2;
    random.into_iter().nth(middle).map(|(draw, rows)| (draw.choice.clone(), rows))
}
