//! `cager transfer`: the motion of one model on another, encoded as any capture.

use super::cage_file::read_cage;
use super::checks::check_cage;
use super::coding_args::goal;
use super::design::{design, goal as design_goal};
use super::dry_run::tell_dry_run;
use super::encode_summary::write_report;
use super::motion_args::TransferMotionArgs;
use super::outputs::{Outputs, folder_of};
use super::transfer_source::MotionSource;
use super::{counted, grouped, human_bytes, progress, read_without_pictures, tell, transfer_remote, warn};
use anyhow::{Context, Error, Result};
use cager_cages::DesignOptions;
use cager_capture::design::FRAMES;
use cager_capture::encode::{EncodeProgress, Encoded, sample_frames};
use cager_capture::origin::{move_to, own_origin};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_formats::{AtomicFile, ReadModel, ScratchDir, Target, Units, commit_together};
use cager_geometry::mesh::{Model, Point};
use cager_motion::recover::Encoding;
use cager_motion::transfer::{
    MethodChoice, TransferFailed, TransferJob, TransferReport, Transferred, about_origin, read_pairs, transfer, words,
};
use cager_shape::TransferError;
use cager_shape::transfer::alignment::AlignBy;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(args: &TransferMotionArgs) -> Result<()> {
    let inputs = args.source_rest.iter().chain(&args.source_frames).chain(&args.source).chain(&args.cage);
    let mut outputs = Outputs::new(args.outputs, inputs.chain(&args.pairs).chain([&args.target]))?;
    let output = outputs.container(&args.output, "walk.cager")?;
    let report = args.report.as_ref().map(|path| outputs.text(path)).transpose()?;
    let method = args.method()?;
    let (align, matrix) = args.alignment()?;
    let align = words::align(align, matrix).unwrap_or(AlignBy::Surfaces);
    let ReadModel { model: mut target, units: said, dropped, .. } = read_without_pictures(&args.target)?;
    let units = said.or(args.coding.units());
    let origin = own_origin(&target.points);
    move_to(origin, &mut target.points);
    // What is wrong with them is told before anything is computed.
    let is_coded = goal(&args.coding, units, true, &target, 1)?.is_some();
    warn(dropped.sentence(&args.target, is_coded && !args.coding.exact_rest && target.surface.is_empty()).as_slice());
    let design = DesignOptions {
        goal: design_goal(args.cage_vertices, args.coding.mean_error, target.points.len())?,
        ..DesignOptions::default()
    };
    let source = MotionSource::open(args)?;
    let pairs = args.pairs.as_ref().map(|path| {
        let text = std::fs::read_to_string(path).map_err(Error::from);
        let read = text
            .and_then(|text| read_pairs(&text, [&source.rest, &target].map(|m| m.points.len())).map_err(Error::msg));
        read.with_context(|| path.display().to_string())
    });
    let pairs = pairs.transpose()?.unwrap_or_default();
    let given = cage(args, method, &source.rest, (&target, origin, units))?;
    if args.outputs.dry_run {
        let frames = source.check_frames()?;
        let what = format!("{} of {}", counted(frames, "frame"), counted(target.points.len(), "point"));
        tell_dry_run(&output, &what, &[report])?;
        source.warn_of_departures();
        return Ok(());
    }
    if let Some(address) = &args.service.server {
        transfer_remote::run(args, address, (&source, &target, units), (&output, report))?;
        source.warn_of_departures();
        return Ok(());
    }
    let report = report.map(AtomicFile::create).transpose()?;
    let scratch = ScratchDir::create(folder_of(&output))?;
    let mut frames = source.frames(scratch.path())?;
    let own = source.cage.clone().filter(|_| method == MethodChoice::Fitted);
    let bar = progress::frames("moving", frames.frames());
    let job = TransferJob {
        source: source.rest.clone(),
        cage: given.or(own),
        frames: frames.as_mut(),
        target: &target,
        method,
        pose: words::pose(args.pose),
        align: about_origin(align, origin),
        up: args.up.map(words::axis),
        pairs,
        detail: args.detail,
        system: args.system(),
        stopped: &|| false,
        scratch: scratch.path(),
    };
    let moved = transfer(job, &|done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let moved = moved.map_err(|error| named(error, args))?;
    write(args, &output, (&target, origin, units), &design, moved, report)?;
    source.warn_of_departures();
    Ok(())
}

/// The cage that is given: around the source, or around both in the target's space.
fn cage(
    args: &TransferMotionArgs,
    method: MethodChoice,
    source: &Model,
    (target, origin, units): (&Model, Option<Point>, Units),
) -> Result<Option<Cage>> {
    let Some(path) = &args.cage else { return Ok(None) };
    let around_source = (source, (None, Units::UNKNOWN));
    let (inside, place) = if method == MethodChoice::Fitted { around_source } else { (target, (origin, units)) };
    let cage = read_cage(path, place)?;
    check_cage((path, cage.mesh()), inside, &args.checks)?;
    Ok(Some(cage))
}

/// Names the file or option that caused an error.
fn named(error: TransferFailed, args: &TransferMotionArgs) -> Error {
    use TransferError::{
        Ambiguous, Coordinates, FrameNotFinite, FramePoints, Inversion, OutOfReach, Outside, Rank, Source, SourceCage,
        SourceSurface, Target, TargetSurface,
    };
    use TransferFailed::{Cage, Enclose, EndsEarly, NoCage, NoFaces, NoFrames, Transfer};
    let source = args.source.as_ref().or(args.source_rest.as_ref());
    let of = |whose: &str| if whose == "target" { Some(&args.target) } else { source };
    let place = match &error {
        Transfer(Ambiguous(up)) => {
            let options = if *up {
                "--align none, --align MATRIX, --pairs"
            } else {
                "--up, --align none, --align MATRIX, --pairs"
            };
            return anyhow::anyhow!("{}: {error} ({options})", args.target.display());
        }
        Transfer(Target(_) | TargetSurface(_) | OutOfReach { .. }) => Some(&args.target),
        Transfer(Source(_) | SourceSurface(_) | Rank { .. } | Inversion(_)) => source,
        Transfer(SourceCage(_)) => args.cage.as_ref().or(source),
        Transfer(Coordinates { whose, .. } | Outside { whose, .. })
        | NoFaces(whose)
        | TransferFailed::Outside { whose, .. }
        | Enclose { whose, .. }
        | Cage { whose, .. } => of(whose),
        Transfer(FrameNotFinite { .. } | FramePoints { .. }) | NoFrames | EndsEarly { .. } => {
            args.source.as_ref().or(args.source_frames.as_ref())
        }
        NoCage => return anyhow::anyhow!("--cage: {error}"),
        _ => None,
    };
    let place = place.map(|path| path.display().to_string());
    let error = Error::from(error);
    match place {
        Some(place) => error.context(place),
        None => error,
    }
}

/// Designs the target's cage, and encodes what was moved.
fn write(
    args: &TransferMotionArgs,
    output: &Target,
    (target, origin, units): (&Model, Option<Point>, Units),
    options: &DesignOptions,
    moved: Transferred,
    report_file: Option<AtomicFile>,
) -> Result<()> {
    let Transferred { mut frames, report, warnings } = moved;
    let samples = sample_frames(&mut frames, FRAMES, false)?;
    frames.rewind()?;
    let clock = Instant::now();
    let design = design((&args.target, target), (&args.target, &samples), None, None, options)?;
    let designed = clock.elapsed().as_secs_f64();
    warn(&design.warnings);
    let cage = Cage::new(design.cage).with_context(|| args.target.display().to_string())?;
    let encoding = Encoding {
        output,
        system: &MeanValue,
        goal: goal(&args.coding, units, true, target, report.frames)?,
        // The cage does not hold all of the motion.
        offsets: true,
        origin,
        units,
        exact_rest: args.coding.exact_rest,
    };
    let bar = progress::PreparationBar::new("encoding", report.frames);
    let result = encoding.write((target, &cage), &mut frames, &|told| match told {
        EncodeProgress::Preparing(step) => bar.preparing(step),
        EncodeProgress::Frames(done) => bar.done(done),
    });
    bar.finish();
    let Encoded { report: encoded, container } = result?;
    let report_file = report_file.map(|file| write_report(file, &report)).transpose()?;
    commit_together(report_file.into_iter().chain([container]).collect())?;
    warn(&warnings);
    warn(&encoded.warnings);
    let encoding = clock.elapsed().as_secs_f64() - designed;
    tell(&summary(&report, &encoded, cage.vertices().len(), [designed, encoding], output.path()))
}

/// With the seconds that the design of the cage and the encoding took.
fn summary(
    report: &TransferReport,
    encoded: &cager_proto::report::Report,
    cage: usize,
    [designed, encoding]: [f64; 2],
    output: &Path,
) -> String {
    let laid = report.score.map_or_else(String::new, |score| {
        let pose = report.pose.unwrap_or("relative");
        format!("  laid    the source lies {:.2} % of the diagonal from the target; {pose} pose\n", 100.0 * score)
    });
    let runner_up = report
        .runner_up
        .map_or_else(String::new, |times| format!("; the next best alignment leaves {times:.2} times the distance"));
    format!(
        "{}: {} of {} as cages of {} vertices\n\
         \x20 aligned turned by {:.1} degrees, scaled by {:.4}{runner_up}\n\
         {laid}{}\x20 size    {}; errors of encoding: L2 {:.3} % on average, L∞ {:.3} % at most\n\
         \x20 time    {:.3} s to prepare, {:.3} s to move, {:.3} s to measure, {designed:.3} s to design the \
         cage, {encoding:.3} s to encode\n",
        output.display(),
        counted(report.frames, "frame"),
        counted(report.points, "point"),
        grouped(cage),
        report.turned_degrees,
        report.scale,
        quality(report),
        human_bytes(encoded.bytes.output),
        100.0 * encoded.error.l2_mean,
        100.0 * encoded.error.linf_max,
        report.seconds.prepare,
        report.seconds.frames,
        report.seconds.measure,
    )
}

fn quality(report: &TransferReport) -> String {
    let found = report.quality;
    let shares = [("folded", found.folded), ("stretched", found.stretched)];
    let shares = shares.into_iter().filter_map(|(what, share)| Some(format!("{:.2} % {what}", 100.0 * share?)));
    let volume = found.volume.map(|[least, most]| format!("volume {least:.2} to {most:.2} times that at rest"));
    let jitter = found.jitter.map(|times| format!("jitter {times:.2} times the source's"));
    let all: Vec<String> = shares.chain(volume).chain(jitter).collect();
    if all.is_empty() { String::new() } else { format!("  quality {}\n", all.join(", ")) }
}
