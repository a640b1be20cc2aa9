//! `cager recover`: an animation from surfaces without correspondence, encoded as any capture.

use super::coding_args::goal;
use super::dry_run::tell_dry_run;
use super::outputs::Outputs;
use super::recover_args::{Align, JointsKind, PersonMethod, RecoverArgs};
use super::rig::{read_manifold, read_rig};
use super::solver_options::read_cage;
use super::{grouped, human_bytes, progress, read_model, recover_remote, tell, warn};
use crate::encode::{EncodeProgress, Encoded};
use crate::origin::{move_to, own_origin};
use crate::recover::{
    Encoding, JOINTS_RATE, Person, RecoverJob, RecoverOptions, RecoverProgress, Recovered, RecoveryReport, cage_around,
    recover,
};
use anyhow::{Context, Result, bail};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_formats::{AtomicFile, MeshSequence, ScratchDir, Target, commit_together, mesh_sequence};
use cager_geometry::mesh::{Model, Point};
use cager_recover::manifold::Manifold;
use cager_recover::people::{FitOptions, Method};
use cager_recover::rig::Rig;
use std::io::Write;
use std::path::Path;
use std::sync::OnceLock;

pub(super) fn run(args: &RecoverArgs) -> Result<()> {
    let files = [&args.template, &args.frames].into_iter().chain(&args.cage).chain(&args.rig).chain(&args.manifold);
    let mut outputs = Outputs::new(args.outputs, files)?;
    let output = outputs.binary(&args.output, "dance.cager")?;
    let report = args.report.as_ref().map(|path| outputs.text(path)).transpose()?;
    let joints = args.joints.as_ref().map(|path| joints_target(&mut outputs, path)).transpose()?;
    let mut template = read_model(&args.template)?;
    if template.faces.is_empty() {
        bail!("{}: has no faces, and a template is a mesh; give one with faces", args.template.display());
    }
    goal(&args.coding, true, &template, 1)?;
    let origin = own_origin(&template.points);
    if origin.is_some() && args.rig.is_some() {
        bail!(
            "{}: lies far away from the origin, where rigs are not exact; move it and the frames there",
            args.template.display()
        );
    }
    move_to(origin, &mut template.points);
    let files = frames(args)?;
    if let Some(address) = args.server.as_deref().filter(|_| !args.outputs.dry_run) {
        return recover_remote::run(args, address, &template, &files, &output, report, joints);
    }
    let person = person(args)?;
    if args.outputs.dry_run {
        let what = format!("{} frames of {} points", grouped(files.files.len()), grouped(template.points.len()));
        return tell_dry_run(&output, &what, &[report, joints.map(|(target, _)| target)]);
    }
    let cage = match &person {
        Some((rig, _)) => Cage::new(rig.cage()).context("--rig")?,
        None => cage(args, &template, origin)?,
    };
    let report = report.map(AtomicFile::create).transpose()?;
    let joints =
        joints.map(|(target, kind)| Ok::<_, anyhow::Error>((AtomicFile::create(target)?, kind))).transpose()?;
    let scratch = ScratchDir::create(scratch_folder(&output))?;
    let options = person_options(args.method);
    let known = person.as_ref().map(|(rig, manifold)| Person { rig, manifold, options });
    let recovered = followed(args, (template, cage, origin), known, &files, scratch.path())?;
    let system = if person.is_some() { options.system.system() } else { &MeanValue };
    write(args, &output, (system, origin), recovered, report, joints)
}

/// What is known of a person.
fn person(args: &RecoverArgs) -> Result<Option<(Rig, Manifold)>> {
    let (Some(rig), Some(manifold)) = (&args.rig, &args.manifold) else { return Ok(None) };
    if args.align == Align::Auto || args.scale == Align::Auto || args.up.is_some() {
        bail!("--rig: finds the person wherever it is; leave out --align, --scale and --up");
    }
    let rig = read_rig(rig)?;
    let manifold = read_manifold(manifold, &rig)?;
    Ok(Some((rig, manifold)))
}

fn person_options(method: PersonMethod) -> FitOptions {
    let method = match method {
        PersonMethod::Robust => Method::Robust,
        PersonMethod::Paper => Method::Paper,
    };
    FitOptions { method, ..FitOptions::default() }
}

fn joints_target(outputs: &mut Outputs, path: &Path) -> Result<(Target, JointsKind)> {
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    let kind = match extension.as_deref() {
        Some("csv") => JointsKind::Csv,
        Some("bvh") => JointsKind::Bvh,
        _ => bail!("{}: joints are written as .csv or .bvh; name a file that ends so", path.display()),
    };
    Ok((outputs.text(path)?, kind))
}

/// The files of the frames; the template and the cage are none unless they are called like these.
fn frames(args: &RecoverArgs) -> Result<MeshSequence> {
    let no_frames: Vec<_> = [&args.template].into_iter().chain(&args.cage).cloned().collect();
    let mut files = mesh_sequence(&args.frames, &no_frames)?;
    warn(&files.notes);
    if let Some(start) = args.timing.start {
        files.numbers = Some((0..files.files.len()).map(|frame| start + frame as f64).collect());
    }
    Ok(files)
}

/// The cage that is given, or one around the template.
fn cage(args: &RecoverArgs, template: &Model, origin: Option<Point>) -> Result<Cage> {
    if let Some(path) = &args.cage {
        return read_cage(path, false, origin);
    }
    let bar = progress::ticking("making a cage");
    let made = cage_around(template);
    bar.finish_and_clear();
    let named = || args.template.display().to_string();
    Cage::new(made.with_context(named)?).with_context(named)
}

/// Beside the output, where there is room for it.
fn scratch_folder(output: &Target) -> &Path {
    let folder = match output {
        Target::StandardOutput => None,
        output => output.path().parent().filter(|folder| !folder.as_os_str().is_empty()),
    };
    folder.unwrap_or(Path::new("."))
}

fn followed(
    args: &RecoverArgs,
    (template, cage, origin): (Model, Cage, Option<Point>),
    person: Option<Person<'_>>,
    files: &MeshSequence,
    scratch: &Path,
) -> Result<Recovered> {
    let job = RecoverJob {
        template,
        cage,
        person,
        source: files,
        pool: None,
        frame_rate: args.timing.fps,
        origin,
        options: RecoverOptions {
            align: args.align == Align::Auto,
            scale: args.scale == Align::Auto,
            up: args.up,
            offsets: args.offsets,
            force: args.force,
            points: args.points as usize,
        },
        scratch,
    };
    let (there, back) = (progress::frames("following", files.files.len()), OnceLock::new());
    let recovered = recover(job, &|told| match told {
        RecoverProgress::Followed(found) => there.set_position(found.frame as u64 + 1),
        RecoverProgress::Refined(done) => {
            there.finish_and_clear();
            back.get_or_init(|| progress::frames("refining", files.files.len())).set_position(done as u64);
        }
    });
    there.finish_and_clear();
    back.into_inner().inspect(indicatif::ProgressBar::finish_and_clear);
    Ok(recovered?)
}

/// Encodes what was recovered.
fn write(
    args: &RecoverArgs,
    output: &Target,
    (system, origin): (&'static dyn CoordinateSystem, Option<Point>),
    recovered: Recovered,
    report_file: Option<AtomicFile>,
    joints_file: Option<(AtomicFile, JointsKind)>,
) -> Result<()> {
    let Recovered { rest, cage, mut frames, report, joints, warnings, .. } = recovered;
    let count = report.frames.len();
    let goal = goal(&args.coding, true, &rest, count)?;
    if args.offsets && goal.is_none() {
        warn(&[
            "--offsets: cages alone are stored, without what leaves them; add --max-error to store that too".to_owned()
        ]);
    }
    let bar = progress::PreparationBar::new("encoding", count);
    let (offsets, exact_rest) = (args.offsets, args.coding.exact_rest);
    let encoding = Encoding { output, system, goal, offsets, origin, exact_rest };
    let result = encoding.write((&rest, &cage), &mut frames, &|told| match told {
        EncodeProgress::Preparing(step) => bar.preparing(step),
        EncodeProgress::Frames(done) => bar.done(done),
    });
    bar.finish();
    let Encoded { report: encoded, container } = result?;
    let report_file = report_file.map(|mut file| {
        file.write_all(&report.json()?)?;
        Ok::<_, anyhow::Error>(file)
    });
    let report_file = report_file.transpose()?;
    let numbers: Vec<f64> = report.frames.iter().map(|frame| frame.number).collect();
    let joints_file = joints_file.zip(joints).map(|((mut file, kind), joints)| {
        match kind {
            JointsKind::Csv => file.write_all(joints.csv(&numbers).as_bytes()),
            JointsKind::Bvh => file.write_all(&joints.bvh(args.timing.fps.unwrap_or(JOINTS_RATE))),
        }
        .map(|()| file)
    });
    let joints_file = joints_file.transpose()?;
    commit_together(report_file.into_iter().chain(joints_file).chain([container]).collect())?;
    warn(&warnings);
    warn(&encoded.warnings);
    tell(&summary(&report, &encoded, output.path()))
}

fn summary(report: &RecoveryReport, encoded: &cager_proto::report::Report, output: &Path) -> String {
    let percent =
        |share: Option<f64>| share.map_or("not measured".to_owned(), |share| format!("{:.3} %", 100.0 * share));
    let count = |outcome: &str| report.frames.iter().filter(|frame| frame.outcome == outcome).count();
    let placed = report.placement.map_or_else(String::new, |placed| {
        format!("  placed  turned by {:.1} degrees, scaled by {:.4}\n", placed.degrees, placed.scale)
    });
    let s = report.seconds;
    format!(
        "{}: {} frames of {} points as cages of {} vertices\n\
         {placed}\x20 frames  {} followed from the one before, {} found by a wider search, {} lost\n\
         \x20 surface template to surface {}, surface to template {} of the diagonal, on average\n\
         \x20 size    {}; errors of encoding: L2 {} on average, {} at most\n\
         \x20 time    {:.3} s: {:.3} s to prepare, {:.3} s to follow, {:.3} s to refine\n",
        output.display(),
        grouped(report.frames.len()),
        grouped(report.points),
        grouped(report.cage_vertices),
        grouped(count("followed")),
        grouped(count("wider_search")),
        grouped(report.lost.len()),
        percent(report.to_surface),
        percent(report.from_surface),
        human_bytes(encoded.bytes.output),
        percent(Some(encoded.error.l2_mean)),
        percent(Some(encoded.error.linf_max)),
        s.prepare + s.follow + s.refine,
        s.prepare,
        s.follow,
        s.refine,
    )
}
