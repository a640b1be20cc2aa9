//! `cager compare`.

use super::args::CompareArgs;
use super::checks::{explained, unnamed_files, warn_of_departures};
use super::dry_run::{read_all, tell_dry_run};
use super::outputs::Outputs;
use super::solver_options::with_input_name;
use super::{human_bytes, plain, progress, warning};
use anyhow::{Result, bail};
use cager_capture::{OpenOptions, Opened};
use cager_compare::report_page::{Contents, NO_PAGE, ReportKind, ReportPage};
use cager_compare::{CompareError, Figures, Job, compare, seconds};
use cager_core::coordinates;
use cager_core::coordinates::CoordinateSystem;
use cager_formats::{AtomicFile, commit_together};
use cager_proto::report::json_file;
use indicatif::ProgressBar;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(args: &CompareArgs) -> Result<()> {
    let clock = Instant::now();
    let mut outputs = Outputs::new(args.outputs, [&args.rest, &args.cage, &args.frames])?;
    // Without the page, the figures take the place of the report.
    let page = ReportPage::built_in();
    let figures = args.json.clone().unwrap_or_else(|| figures_path(&args.output));
    if page.is_none() && (args.json.is_some() || figures != args.output) && args.output.as_os_str() != "-" {
        // Refused for the same reasons as where it is written.
        outputs.text(&args.output)?;
    }
    let (output, json) = match (&page, &args.json) {
        (Some(_), json) => (outputs.text(&args.output)?, json.as_ref().map(|path| outputs.text(path)).transpose()?),
        (None, _) => (outputs.text(&figures)?, None),
    };
    let options = OpenOptions {
        files: unnamed_files(&args.checks),
        flip_cage: args.flip_cage,
        allow_mismatch: args.checks.force,
        ..OpenOptions::default()
    };
    let Opened { rest, cage, files, .. } =
        warning(|warnings| options.read(&args.rest, Some(&args.cage), &args.frames, warnings))
            .map_err(|error| explained(error, &args.frames, args.flip_cage))?;
    let Some(cage) = cage else { bail!("--cage: give one") };
    let open = || files.open();
    let frames = open()?.frames();
    let systems = systems(&args.coordinates);
    if args.outputs.dry_run {
        let frames = read_all(open()?.as_mut())?;
        let what = format!("a comparison on at most {} of {frames} frames", args.frames_at_most.min(frames as u32));
        return tell_dry_run(&output, &what, &[json]);
    }
    let mut report = AtomicFile::create(&output)?;
    let json = json.as_ref().map(AtomicFile::create).transpose()?;

    let job = Job {
        rest: &rest,
        cage: &cage,
        flip_cage: args.flip_cage,
        open: &open,
        frames,
        systems: &systems,
        frames_at_most: args.frames_at_most as usize,
        up: args.up,
        names: [&args.rest, &args.cage, &args.frames].map(|path| path.display().to_string()),
    };
    let expected = seconds(&job);
    let bar = progress::timed_steps();
    let plural = if systems.len() == 1 { "" } else { "s" };
    bar.println(format!("about {} for {} coordinate system{plural}", progress::duration(expected), systems.len()));
    let result = compare(&job, &mut |step, done| show(&bar, step, done, expected));
    bar.finish_and_clear();
    let (figures, geometry) = result.map_err(|error| match error {
        CompareError::Prepare(error) => with_input_name(&error, &args.rest, &args.cage),
        CompareError::Formats(error) => error.into(),
    })?;

    let figures_text = json_file(&figures)?;
    match &page {
        Some(page) => {
            let (kind, program) = (ReportKind::Comparison, figures.program);
            report.write_all(&page.with(&Contents { kind, program, figures: &figures, geometry: &geometry })?)?;
        }
        None => {
            report.write_all(&figures_text)?;
            super::warn(&[format!("{}: holds the figures alone, since {NO_PAGE}", output.path().display())]);
        }
    }
    let bytes = report.complete()?;
    let mut written = vec![report];
    if let Some(mut file) = json {
        file.write_all(&figures_text)?;
        written.insert(0, file);
    }
    commit_together(written)?;
    warn_of_departures(&files);
    super::tell(&summary(&figures, output.path(), bytes, clock.elapsed().as_secs_f64())?)
}

/// Where the figures go in place of a report.
fn figures_path(report: &Path) -> PathBuf {
    if report.as_os_str() == "-" { report.to_owned() } else { report.with_extension("json") }
}

/// Shows a step, and the time left: as long as little is done, more by what was `expected` of the
/// whole than by what has passed.
fn show(bar: &ProgressBar, step: &str, done: f64, expected: f64) {
    let by_now = bar.elapsed().as_secs_f64() / done.max(1e-3);
    let left = (1.0 - done) * (done * by_now + (1.0 - done) * expected);
    bar.set_message(step.to_owned());
    bar.set_prefix(format!("about {} left", progress::duration(left)));
    bar.set_position((done * progress::STEPS as f64) as u64);
}

/// The systems asked for, each once; all where none is.
fn systems(given: &[&'static dyn CoordinateSystem]) -> Vec<&'static dyn CoordinateSystem> {
    if given.is_empty() {
        return coordinates::SYSTEMS.to_vec();
    }
    let mut systems: Vec<&'static dyn CoordinateSystem> = Vec::new();
    for &system in given {
        if systems.iter().all(|known| known.name() != system.name()) {
            systems.push(system);
        }
    }
    systems
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
    for (name, choice) in
        [("smoothest", &figures.recommendation.editing), ("closest", &figures.recommendation.accuracy)]
    {
        if let Some(choice) = choice {
            writeln!(out, "  {name:<12}{}   (mean L2 {:.4} %)", choice.flags, 100.0 * choice.l2_mean)?;
        }
    }
    writeln!(out, "  time        {seconds:.1} s")?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_follows_what_was_expected_at_first_and_what_has_passed_at_the_end() {
        let bar = ProgressBar::hidden();
        show(&bar, "mvc: coordinates", 0.0, 60.0);
        assert_eq!(bar.prefix(), "about 60 s left");
        show(&bar, "mvc: what is drawn", 1.0, 60.0);
        assert_eq!((bar.prefix().as_str(), bar.position()), ("about 1 s left", progress::STEPS));
    }
}
