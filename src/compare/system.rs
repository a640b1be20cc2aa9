//! One coordinate system, studied: every method on every measured frame.

use super::choices::{Choice, Plan, Subject, plans};
use super::figures::{Draw, MethodFigures, NoiseFigures, Seconds, Spectra, Swaps, SystemFigures, Vectors};
use super::noise::{RADIUS, noisy};
use super::sample::{Frame, Sample};
use super::track::{Motion, Shape, Track};
use super::{CompareError, Job, Progress};
use cager_core::inversion::{Analysis, BATCH, SolverOptions, usual_spectrum};
use rayon::prelude::*;

/// Choices of rows that go through the capture together take about this much memory beside the coordinates they share.
const CHOICE_BYTES: usize = 640 << 20;
/// The same for a batch of frames.
const BATCH_BYTES: usize = 256 << 20;

/// Rows whose singular values are below this fraction of the largest are dependent to the working precision.
const DEPENDENT: f64 = 1e-11;

/// A system with its figures, and what its pictures need.
pub(super) struct Studied<'a> {
    pub(super) figures: SystemFigures,
    pub(super) analysis: &'a Analysis,
    /// The choices of rows of the methods, with these.
    pub(super) choices: Vec<Choice<'a>>,
    /// Mean and largest second temporal difference of the model itself.
    pub(super) motion: [f64; 2],
    /// Rows of the random draw whose error is the middle one, and its name.
    pub(super) middling: Option<(String, Vec<u32>)>,
}

impl Studied<'_> {
    /// Cages of up to a batch of frames by one of the methods.
    pub(super) fn invert(&self, options: SolverOptions, frames: &[&[f64]]) -> Option<Vec<Vec<f32>>> {
        self.choices.iter().find_map(|choice| choice.invert(options, frames))
    }
}

/// Studies a system on the sample.
///
/// # Errors
/// [`CompareError::Prepare`] where it cannot be inverted for this cage.
pub(super) fn study<'a>(
    job: &Job<'_>,
    name: &str,
    analysis: &'a Analysis,
    sample: &Sample,
    shape: &Shape,
    progress: &mut Progress<'_>,
) -> Result<Studied<'a>, CompareError> {
    (progress.tell)(&format!("{name}: swaps"), 0.1);
    let (spectra, swaps, vectors) = (Spectra::of(analysis), Swaps::of(analysis), Vectors::of(analysis));
    let unknowns = analysis.coordinates().ncols();
    let usual = usual_spectrum(unknowns);
    let damping = spectra.handles[spectra.handles.len().saturating_sub(usual + 1)];
    let start = ("pivoted LU".to_owned(), analysis.handles().start.clone());
    let plans = plans(job.rest.points.len(), unknowns, usual, damping, sample.is_whole(), start);

    let mut found = Found::default();
    let mut motion = Motion::new(sample);
    let mut kept = Vec::new();
    let total: usize = plans.iter().map(|plan| plan.subjects.len()).sum();
    let mut through = 0;
    let mut waiting = plans.as_slice();
    while !waiting.is_empty() {
        let mut bytes = 0;
        let fits = |plan: &&Plan| {
            let before = bytes;
            bytes += plan.bytes(analysis);
            before < CHOICE_BYTES
        };
        let (group, later) = waiting.split_at(waiting.iter().take_while(fits).count());
        waiting = later;
        let fraction = |part: f64, here: usize| 0.2 + 0.7 * (through as f64 + part * here as f64) / total as f64;
        (progress.tell)(&format!("{name}: inversions"), fraction(0.0, 0));
        let prepared: Vec<_> = group.par_iter().map(|plan| Choice::prepare(analysis, plan, sample)).collect();
        // Rows drawn at random may determine nothing.
        let useful = prepared.into_iter().zip(group).filter(|(choice, plan)| choice.is_ok() || !plan.is_draw());
        let mut choices: Vec<Choice<'a>> = useful.map(|(choice, _)| choice).collect::<Result<_, _>>()?;
        let here: usize = group.iter().map(|plan| plan.subjects.len()).sum();
        let motion = (through == 0).then_some(&mut motion);
        follow(job, &mut choices, motion, sample, shape, &mut |done| {
            let part = done as f64 / sample.to_read().max(1) as f64;
            (progress.tell)(&format!("{name}: frame {done} of {}", sample.to_read()), fraction(part, here));
        })?;
        through += here;
        for choice in choices {
            let is_draw = choice.is_draw();
            let kept_choice = found.add(choice);
            kept.extend((!is_draw).then_some(kept_choice));
        }
    }
    found.methods.sort_by_key(|(order, _)| *order);
    found.noise.sort_by_key(|(order, _)| *order);
    let prepared = analysis.preparation();
    let usual_seconds = |(_, m): &&(usize, MethodFigures)| m.method.is_cager() && m.method.spectrum == usual;
    let figures = SystemFigures {
        unknowns,
        rank: prepared.rank,
        affine_reproduction_error: prepared.affine_reproduction_error,
        outside: prepared.outside.len(),
        spectra,
        swaps,
        vectors,
        seconds: Seconds {
            coordinates: prepared.coordinates_seconds,
            maxvol: prepared.maxvol_seconds,
            svd: prepared.svd_seconds,
            per_frame: found.methods.iter().find(usual_seconds).map_or(f64::NAN, |(_, m)| m.frame_seconds),
        },
        random: found.draws,
        methods: found.methods.into_iter().map(|(_, found)| found).collect(),
        noise: found.noise.into_iter().map(|(_, found)| found).collect(),
    };
    let middling = middling(&figures.random, found.rows);
    Ok(Studied { figures, analysis, choices: kept, motion: motion.totals(), middling })
}

/// Takes all choices of rows through the capture.
fn follow(
    job: &Job<'_>,
    choices: &mut [Choice<'_>],
    mut motion: Option<&mut Motion>,
    sample: &Sample,
    shape: &Shape,
    tell: &mut dyn FnMut(usize),
) -> Result<(), CompareError> {
    let mut reader = (job.open)()?;
    let size = (BATCH_BYTES / (24 * job.rest.points.len())).clamp(1, BATCH);
    let any_noise = choices.iter().any(Choice::reads_noise);
    let (mut next, mut batch, mut timed) = (0, Vec::new(), false);
    loop {
        sample.fill(reader.as_mut(), &mut next, size, &mut batch)?;
        if batch.is_empty() {
            return Ok(());
        }
        if !timed {
            for choice in choices.iter_mut() {
                choice.time(&batch)?;
            }
            timed = true;
        }
        if let Some(motion) = &mut motion {
            motion.take(&batch, sample, shape.diagonal);
        }
        let radius = RADIUS * shape.diagonal;
        let with_noise: Vec<Frame> = match any_noise {
            true => batch.par_iter().map(|f| Frame { points: noisy(&f.points, f.number, radius), ..*f }).collect(),
            false => Vec::new(),
        };
        choices.par_iter_mut().for_each(|choice| choice.take(&batch, &with_noise, shape));
        tell(next);
    }
}

/// What the tracks that are through have found; methods with their place among all.
#[derive(Default)]
struct Found {
    methods: Vec<(usize, MethodFigures)>,
    noise: Vec<(usize, NoiseFigures)>,
    draws: Vec<Draw>,
    rows: Vec<Vec<u32>>,
}

impl Found {
    /// Takes what the tracks of a choice have found; gives the choice back without them.
    fn add<'a>(&mut self, mut choice: Choice<'a>) -> Choice<'a> {
        for (subject, track) in std::mem::take(&mut choice.tracks) {
            self.add_track(&choice, subject, track);
        }
        choice
    }

    fn add_track(&mut self, choice: &Choice<'_>, subject: Subject, track: Track) {
        let totals = track.found.totals();
        match subject {
            Subject::Method(order, method) => {
                let frame_seconds = track.frame_seconds;
                self.methods.push((order, MethodFigures { method, totals, per_frame: track.found, frame_seconds }));
            }
            Subject::Noise(order, method) => {
                let clean = track.clean.totals();
                let (clean_l2_mean, clean_linf_max) = (clean.l2_mean, clean.linf_max);
                let per_frame = track.found;
                self.noise.push((order, NoiseFigures { method, totals, per_frame, clean_l2_mean, clean_linf_max }));
            }
            Subject::Draw(name, rows, _) => match self.draws.last_mut().filter(|draw| draw.choice == name) {
                Some(draw) => draw.totals = totals,
                None => {
                    let sigma = choice.reading.singular_values();
                    let (first, last) = (sigma.first().copied().unwrap_or(0.0), sigma.last().copied().unwrap_or(0.0));
                    // Of what is dependent, rounding decides; infinity has no place in a plot.
                    let condition = (first / last).min(1.0 / f64::EPSILON);
                    let rank = sigma.iter().filter(|&&x| x > DEPENDENT * first).count();
                    self.draws.push(Draw { choice: name, rank, condition, data_alone: totals, totals });
                    self.rows.push(rows);
                }
            },
        }
    }
}

/// The random draw with the middle error.
fn middling(draws: &[Draw], rows: Vec<Vec<u32>>) -> Option<(String, Vec<u32>)> {
    let mut random: Vec<(&Draw, Vec<u32>)> =
        draws.iter().zip(rows).filter(|(draw, _)| draw.choice.starts_with("random")).collect();
    random.sort_by(|a, b| a.0.totals.l2_mean.total_cmp(&b.0.totals.l2_mean));
    let middle = random.len() / 2;
    random.into_iter().nth(middle).map(|(draw, rows)| (draw.choice.clone(), rows))
}
