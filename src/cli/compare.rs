//! `cager compare`.

use super::args::{CompareArgs, CoordinatesArg, UpArg};
use super::encode::{blame, read_cage};
use super::outputs::refuse_overwriting;
use super::{human_bytes, interrupt, plain, progress};
use crate::compare::{CompareError, Figures, Job, Progress, Up, compare, page};
use crate::coordinates;
use anyhow::{Context, Result};
use cager_core::coordinates::CoordinateSystem;
use cager_formats::{AtomicFile, commit_together, open_frames, read_model};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(args: &CompareArgs) -> Result<()> {
    let clock = Instant::now();
    let rest = read_model(&args.rest)?;
    let cage = read_cage(&args.cage, args.flip_cage)?;
    let open = || open_frames(&args.frames, rest.points.len());
    open()?;
    let systems = systems(&args.coordinates)?;
    // Before the work, so that outputs that cannot be written cost no waiting.
    refuse_overwriting(&args.output, args.json.as_deref(), [&args.rest, &args.cage, &args.frames])?;
    interrupt::leaves_nothing()?;
    let mut report = AtomicFile::create(&args.output)?;
    let json = args.json.as_ref().map(AtomicFile::create).transpose()?;

    let bar = progress::steps();
    let mut tell = |step: &str, done: usize, all: usize| {
        bar.set_message(step.to_owned());
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let job = Job {
        rest: &rest,
        cage: &cage,
        flip_cage: args.flip_cage,
        open: &open,
        systems: &systems,
        frames_at_most: args.frames_at_most as usize,
        up: args.up.map(Into::into),
        names: [&args.rest, &args.cage, &args.frames].map(|path| path.display().to_string()),
    };
    let result = compare(&job, &mut Progress { tell: &mut tell });
    bar.finish_and_clear();
    let (figures, pictures) = result.map_err(|error| match error {
        CompareError::Prepare(error) => blame(&error, &args.rest, &args.cage),
        CompareError::Formats(error) => error.into(),
    })?;

    report.write_all(page(&figures, &pictures).as_bytes())?;
    let report = report.complete()?;
    let bytes = report.length();
    let mut outputs = vec![report];
    if let Some(mut file) = json {
        let mut text = serde_json::to_vec_pretty(&figures)?;
        text.push(b'\n');
        file.write_all(&text)?;
        outputs.insert(0, file.complete()?);
    }
    commit_together(outputs)?;
    super::tell(&summary(&figures, &args.output, bytes, clock.elapsed().as_secs_f64())?)
}

/// The systems asked for, each once; all where none is.
fn systems(names: &[CoordinatesArg]) -> Result<Vec<&'static dyn CoordinateSystem>> {
    if names.is_empty() {
        return Ok(coordinates::ALL.to_vec());
    }
    let mut systems: Vec<&'static dyn CoordinateSystem> = Vec::new();
    for name in names.iter().map(|name| name.name()) {
        let system = coordinates::by_name(name).with_context(|| format!("--coordinates: {name} is unknown"))?;
        if systems.iter().all(|known| known.name() != name) {
            systems.push(system);
        }
    }
    Ok(systems)
}

fn summary(figures: &Figures, output: &Path, bytes: u64, seconds: f64) -> Result<String> {
    let mut out = String::new();
    writeln!(
        out,
        "{}: {}, {} frames measured",
        plain(&output.display().to_string()),
        human_bytes(bytes),
        figures.capture.measured.len()
    )?;
    for system in &figures.systems {
        if let Some(reason) = &system.refused {
            writeln!(out, "  {:<12}not compared: {}", system.name, plain(reason))?;
        }
    }
    for (name, choice) in [("calmest", &figures.recommendation.editing), ("closest", &figures.recommendation.accuracy)]
    {
        if let Some(choice) = choice {
            writeln!(out, "  {name:<12}{}   (mean L2 {:.4} %)", choice.flags, 100.0 * choice.l2_mean)?;
        }
    }
    writeln!(out, "  time        {seconds:.1} s")?;
    Ok(out)
}

impl From<UpArg> for Up {
    fn from(arg: UpArg) -> Self {
        match arg {
            UpArg::X => Self::X,
            UpArg::Y => Self::Y,
            UpArg::Z => Self::Z,
        }
    }
}
