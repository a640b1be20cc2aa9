//! One coordinate system, studied: every method on every measured frame.

use super::figures::{Draw, MethodFigures, NoiseFigures, Seconds, Spectra, Swaps, SystemFigures, Vectors, draws};
use super::methods::{Method, methods};
use super::noise::{RADIUS, noisy};
use super::sample::{Frame, Sample};
use super::track::{Motion, Shape, Track};
use super::{CompareError, Job, Progress};
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{Analysis, BATCH, Handles, PrepareError, Reading, Solver, SolverOptions, usual_spectrum};
use cager_core::regularize::Regularizer;
use rayon::prelude::*;

/// Solvers that go through the capture together take about this much memory beside the coordinates they share: another one is added
/// as long as they take less.
const SOLVER_BYTES: usize = 640 << 20;
/// The same for a batch of frames.
const BATCH_BYTES: usize = 256 << 20;

/// Rows whose singular values are below this fraction of the largest are dependent to the working precision.
const DEPENDENT: f64 = 1e-11;

/// What became of a system.
pub(super) enum Outcome {
    /// Everything was measured.
    Studied(Box<Studied>),
    /// It cannot be computed for this cage.
    Refused(PrepareError),
}

/// A system with its figures, and what its pictures need.
pub(super) struct Studied {
    pub(super) figures: SystemFigures,
    pub(super) analysis: Analysis,
    /// Mean and largest second temporal difference of the model itself.
    pub(super) motion: [f64; 2],
    /// Rows of the random draw whose error is the middle one, and its name.
    pub(super) middling: Option<(String, Vec<u32>)>,
}

/// What a track is of.
enum Subject {
    Method(Method),
    Noise(Method),
    Draw(String, Vec<u32>, SolverOptions),
}

/// Studies a system on the sample.
pub(super) fn study(
    job: &Job<'_>,
    system: &dyn CoordinateSystem,
    sample: &Sample,
    shape: &Shape,
    progress: &mut Progress<'_>,
) -> Result<Outcome, CompareError> {
    let name = system.name();
    (progress.tell)(&format!("{name}: coordinates"), 0, 1);
    let analysis = match Analysis::new(system, job.cage, &job.rest.points) {
        Ok(analysis) => analysis,
        Err(error) => return Ok(Outcome::Refused(error)),
    };
    (progress.tell)(&format!("{name}: swaps"), 0, 1);
    let (spectra, swaps, vectors) = (Spectra::of(&analysis), Swaps::of(&analysis), Vectors::of(&analysis));
    let unknowns = analysis.coordinates().ncols();
    let usual = usual_spectrum(unknowns);
    let damping = spectra.handles[spectra.handles.len().saturating_sub(usual + 1)];

    let mut subjects: Vec<Subject> =
        methods(unknowns, usual, damping, sample.is_whole()).into_iter().map(Subject::Method).collect();
    subjects.extend(noise_methods(unknowns, usual, damping).into_iter().map(Subject::Noise));
    let start = analysis.handles().start.clone();
    let drawn = draws(unknowns, job.rest.points.len()).into_iter().chain([("pivoted LU".to_owned(), start)]);
    let regularised = SolverOptions { spectrum: usual, ..SolverOptions::PAPER };
    for (choice, rows) in drawn {
        for options in [data_alone(), regularised] {
            subjects.push(Subject::Draw(choice.clone(), rows.clone(), options));
        }
    }

    let mut workshop = Workshop { analysis: &analysis, readings: Vec::new(), drawn: None };
    let mut found = Found::default();
    let mut motion = Motion::new(sample);
    let mut subjects = subjects.into_iter().peekable();
    let mut first = true;
    while subjects.peek().is_some() {
        let mut group = Vec::new();
        let mut bytes = 0;
        while bytes < SOLVER_BYTES
            && let Some(subject) = subjects.next()
        {
            let solver = match workshop.solver(&subject) {
                Ok(solver) => solver,
                // Rows drawn at random may determine nothing.
                Err(_) if matches!(subject, Subject::Draw(..)) => continue,
                Err(error) => return Ok(Outcome::Refused(error)),
            };
            bytes += own_bytes(&solver);
            let noisy = matches!(subject, Subject::Noise(_));
            group.push((subject, Track::new(solver, noisy, sample)));
        }
        let motion = first.then_some(&mut motion);
        follow(job, &mut group, motion, sample, shape, &mut |done| {
            (progress.tell)(&format!("{name}: frames"), done, sample.to_read());
        })?;
        first = false;
        group.into_iter().for_each(|(subject, track)| found.add(subject, track));
    }
    let prepared = analysis.preparation();
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
            per_frame: found.usual_seconds(usual),
        },
        random: found.draws,
        methods: found.methods,
        noise: found.noise,
    };
    let middling = middling(&figures.random, found.rows);
    Ok(Outcome::Studied(Box::new(Studied { figures, analysis, motion: motion.totals(), middling })))
}

/// The methods that noise is tried on: plain least squares, and what reads fewer points.
fn noise_methods(unknowns: usize, usual: usize, damping: f64) -> Vec<Method> {
    let wanted = |m: &Method| {
        let plain = m.regularizer == Regularizer::None && matches!(m.handles, Handles::All | Handles::MaxVol);
        let proposed = m.regularizer == Regularizer::Laplacian && m.handles != Handles::All;
        m.curve && (plain || proposed || m.regularizer == Regularizer::Global)
    };
    methods(unknowns, usual, damping, false).into_iter().filter(wanted).collect()
}

/// Solvers of an analysis, each choice of handles decomposed once.
struct Workshop<'a> {
    analysis: &'a Analysis,
    readings: Vec<(Handles, Reading<'a>)>,
    /// The last rows drawn.
    drawn: Option<(Vec<u32>, Reading<'a>)>,
}

impl<'a> Workshop<'a> {
    fn solver(&mut self, subject: &Subject) -> Result<Solver, PrepareError> {
        match subject {
            Subject::Method(method) | Subject::Noise(method) => {
                if self.readings.iter().all(|(handles, _)| *handles != method.handles) {
                    self.readings.push((method.handles, self.analysis.reading(method.handles)?));
                }
                let of_handles = |(handles, _): &&(Handles, Reading<'a>)| *handles == method.handles;
                match self.readings.iter().find(of_handles) {
                    Some((_, reading)) => reading.solver(method.options()),
                    None => self.analysis.solver(method.options()),
                }
            }
            Subject::Draw(_, rows, options) => {
                let known = self.drawn.take().filter(|(of, _)| of == rows);
                let drawn = match known {
                    Some(drawn) => drawn,
                    None => (rows.clone(), self.analysis.reading_of(rows)?),
                };
                self.drawn.insert(drawn).1.solver(*options)
            }
        }
    }
}

/// What a solver holds beside `Φ`, which all solvers of an analysis share.
fn own_bytes(solver: &Solver) -> usize {
    solver.size_bytes() - solver.decoder().size_bytes()
}

/// Plain inversion.
pub(super) fn data_alone() -> SolverOptions {
    SolverOptions { regularizer: Regularizer::None, spectrum: 0, ..SolverOptions::default() }
}

/// Takes all tracks through the capture.
fn follow(
    job: &Job<'_>,
    group: &mut [(Subject, Track)],
    mut motion: Option<&mut Motion>,
    sample: &Sample,
    shape: &Shape,
    tell: &mut dyn FnMut(usize),
) -> Result<(), CompareError> {
    let mut reader = (job.open)()?;
    let size = (BATCH_BYTES / (24 * job.rest.points.len())).clamp(1, BATCH);
    let any_noise = group.iter().any(|(_, track)| track.noisy);
    let (mut next, mut batch, mut timed) = (0, Vec::new(), false);
    loop {
        sample.fill(reader.as_mut(), &mut next, size, &mut batch)?;
        if batch.is_empty() {
            return Ok(());
        }
        if !timed {
            group.iter_mut().for_each(|(_, track)| track.time(&batch));
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
        group.par_iter_mut().for_each(|(_, track)| {
            let frames = if track.noisy { &with_noise } else { &batch };
            track.take(frames, &batch, sample, shape);
        });
        tell(next);
    }
}

/// What the tracks that are through have found.
#[derive(Default)]
struct Found {
    methods: Vec<MethodFigures>,
    noise: Vec<NoiseFigures>,
    draws: Vec<Draw>,
    rows: Vec<Vec<u32>>,
}

impl Found {
    fn add(&mut self, subject: Subject, track: Track) {
        let totals = track.found.totals();
        match subject {
            Subject::Method(method) => {
                let frame_seconds = track.frame_seconds;
                self.methods.push(MethodFigures { method, totals, per_frame: track.found, frame_seconds });
            }
            Subject::Noise(method) => {
                let clean = track.clean.totals();
                let (clean_l2_mean, clean_linf_max) = (clean.l2_mean, clean.linf_max);
                self.noise.push(NoiseFigures { method, totals, per_frame: track.found, clean_l2_mean, clean_linf_max });
            }
            Subject::Draw(choice, rows, _) => match self.draws.last_mut().filter(|draw| draw.choice == choice) {
                Some(draw) => draw.totals = totals,
                None => {
                    let sigma = &track.solver.preparation().singular_values;
                    let (first, last) = (sigma.first().copied().unwrap_or(0.0), sigma.last().copied().unwrap_or(0.0));
                    // Of what is dependent, rounding decides; infinity has no place in a plot.
                    let condition = (first / last).min(1.0 / f64::EPSILON);
                    let rank = sigma.iter().filter(|&&x| x > DEPENDENT * first).count();
                    self.draws.push(Draw { choice, rank, condition, data_alone: totals, totals });
                    self.rows.push(rows);
                }
            },
        }
    }

    fn usual_seconds(&self, usual: usize) -> f64 {
        let found = self.methods.iter().find(|m| m.method.is_cager() && m.method.spectrum == usual);
        found.map_or(f64::NAN, |m| m.frame_seconds)
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

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::cage::Cage;
    use cager_core::coordinates::Green;
    use cager_core::synthetic::{Capture, Options};

    #[test]
    fn what_a_solver_iterates_with_counts_as_its_own() {
        let capture = Capture::new(&Options { points: 400, frames: 2, cage_vertices: 40 });
        let cage = Cage::new(capture.cage).expect("a cage");
        let own = |system: &Green| {
            let analysis = Analysis::new(system, &cage, &capture.rest.points).expect("an analysis");
            let solver = analysis.solver(SolverOptions::default()).expect("a solver");
            let columns = solver.decoder().columns();
            (own_bytes(&solver) - 8 * solver.operator().nrows() * solver.operator().ncols(), columns)
        };
        let (free, columns) = own(&Green::Free);
        assert!(free < 8 * columns * columns, "{free} bytes beside an operator");
        // The Gram matrix, and in single precision.
        let (consistent, columns) = own(&Green::Consistent);
        assert!(consistent > 12 * columns * columns, "{consistent} bytes");
    }
}
