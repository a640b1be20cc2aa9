//! `cager compare`.

use super::args::{CompareArgs, CoordinatesArg, UpArg};
use super::dry_run::{read_all, tell_would};
use super::encode::{blame, read_cage};
use super::outputs::Outputs;
use super::{human_bytes, plain, progress};
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
    let mut outputs = Outputs::new(args.outputs, [&args.rest, &args.cage, &args.frames])?;
    let output = outputs.text(&args.output)?;
    let json = args.json.as_ref().map(|path| outputs.text(path)).transpose()?;
    let rest = read_model(&args.rest)?;
    let cage = read_cage(&args.cage, args.flip_cage)?;
    let open = || open_frames(&args.frames, rest.points.len());
    open()?;
    let systems = systems(&args.coordinates)?;
    if args.outputs.dry_run {
        let frames = read_all(open()?.as_mut())?;
        let what = format!("a comparison on at most {} of {frames} frames", args.frames_at_most.min(frames as u32));
        return tell_would(&output, &what, &[json]);
    }
    let mut report = AtomicFile::create(&output)?;
    let json = json.as_ref().map(AtomicFile::create).transpose()?;

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
    super::tell(&summary(&figures, output.path(), bytes, clock.elapsed().as_secs_f64())?)
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
