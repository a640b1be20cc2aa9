//! `cager recover`: an animation from surfaces without correspondence, encoded as any capture.

use super::coding_args::goal;
use super::dry_run::tell_dry_run;
use super::outputs::Outputs;
use super::recover_args::{Align, JointsKind, RecoverArgs};
use super::recover_stretch::{Beside, Done, Stretching};
use super::rig::{read_manifold, read_rig};
use super::stretches::{Stretch, StretchList, cut, numbered};
use super::{counted, read_without_pictures, recover_remote, tell, warn};
use anyhow::{Result, bail};
use cager_capture::origin::{move_to, own_origin};
use cager_formats::{
    AtomicFile, MeshSequence, ReadModel, Target, Units, commit_together, mesh_sequence, missing_frames, read_mesh,
};
use cager_geometry::mesh::{Model, Point};
use cager_motion::recover::placed_units;
use cager_proto::report::json_file;
use cager_shape::people::manifold::Manifold;
use cager_shape::people::rig::Rig;
use std::io::Write;
use std::path::Path;

pub(super) fn run(args: &RecoverArgs) -> Result<()> {
    let count = args.template.len();
    refuse_several(args)?;
    let templates = args.template.iter().map(|key| &key.path);
    let files = templates.chain([&args.frames]).chain(&args.cage).chain(&args.rig).chain(&args.manifold);
    let mut outputs = Outputs::new(args.outputs, files)?;
    let named = |path: &Path, at: usize| if count == 1 { path.to_owned() } else { numbered(path, at) };
    let mut targets = |at: usize| {
        let output = outputs.container(&named(&args.output, at), "dance.cager")?;
        let report = args.report.as_ref().map(|path| outputs.text(&named(path, at))).transpose()?;
        Ok::<_, anyhow::Error>((output, report))
    };
    let targets = (0..count).map(&mut targets).collect::<Result<Vec<_>>>()?;
    let list = (count > 1).then(|| outputs.text(&StretchList::path(&args.output))).transpose()?;
    let joints = args.joints.as_ref().map(|path| joints_target(&mut outputs, path)).transpose()?;
    let gait = args.gait.as_ref().map(|path| picture_target(&mut outputs, path)).transpose()?;
    let templates = args.template.iter().map(|key| template(args, &key.path)).collect::<Result<Vec<_>>>()?;
    let stretches = cut(frames(args)?, &args.template)?;
    if let (Some(address), false) = (args.service.server.as_deref(), args.outputs.dry_run)
        && let [(output, report)] = &targets[..]
    {
        return recover_remote::run(
            args,
            address,
            (&templates[0].0, templates[0].2),
            &stretches[0],
            output,
            report.clone(),
            joints,
        );
    }
    let person = person(args)?;
    if args.outputs.dry_run {
        let mut others = vec![list, joints.map(|(target, _)| target), gait];
        for (((output, report), (template, ..)), files) in targets.iter().zip(&templates).zip(&stretches) {
            others.push(report.clone());
            let what =
                format!("{} of {}", counted(files.files.len(), "frame"), counted(template.points.len(), "point"));
            tell_dry_run(output, &what, &std::mem::take(&mut others))?;
        }
        return Ok(());
    }
    let joints =
        joints.map(|(target, kind)| Ok::<_, anyhow::Error>((AtomicFile::create(target)?, kind))).transpose()?;
    let mut beside = Beside { joints, gait: gait.map(AtomicFile::create).transpose()?, report: None };
    let list = list.map(AtomicFile::create).transpose()?;
    let (mut done, mut listed) = (Vec::new(), Vec::new());
    for (at, (((output, report), (template, origin, units)), files)) in
        targets.iter().zip(templates).zip(&stretches).enumerate()
    {
        let path = &args.template[at].path;
        let stretch =
            Stretching { args, path, person: person.as_ref(), cage: args.cage.get(at), origin, units, files, output };
        beside.report = report.clone().map(AtomicFile::create).transpose()?;
        done.push(stretch.recover(template, std::mem::take(&mut beside))?);
        listed.push(Stretch {
            file: output.path().file_name().unwrap_or_default().into(),
            first_frame: files.numbers.as_ref().map_or(0.0, |numbers| numbers[0]),
            frames: files.files.len(),
            frame_rate: args.timing.fps,
        });
    }
    let mut written: Vec<AtomicFile> = done.iter_mut().flat_map(|done| std::mem::take(&mut done.files)).collect();
    if let Some(mut file) = list {
        file.write_all(&json_file(&StretchList::new(listed))?)?;
        // The list last: it is there when what it names is.
        written.push(file);
    }
    commit_together(written)?;
    for Done { warnings, summary, .. } in done {
        warn(&warnings);
        tell(&summary)?;
    }
    Ok(())
}

/// What goes with one template alone.
fn refuse_several(args: &RecoverArgs) -> Result<()> {
    let (templates, cages) = (args.template.len(), args.cage.len());
    if cages > 0 && cages != templates {
        bail!(
            "--cage: there are {templates} templates and {cages} cages; give one for each template in their order, or \
             none"
        );
    }
    if templates > 1 {
        for (given, option, why) in [
            (args.rig.is_some(), "--rig", "is made for one template"),
            (args.service.server.is_some(), "--server", "follows one template"),
            (args.output.as_os_str() == "-", "-", "standard output cannot hold a file for each template"),
        ] {
            if given {
                bail!("{option}: {why}; recover each stretch of frames on its own, or here, into files");
            }
        }
    }
    Ok(())
}

/// A template, checked, its origin, and what its positions mean where it is not brought to those of the frames.
fn template(args: &RecoverArgs, path: &Path) -> Result<(Model, Option<Point>, Units)> {
    let ReadModel { model: mut template, units: said, dropped, .. } = read_without_pictures(path)?;
    if template.faces.is_empty() {
        bail!("{}: has no faces, and a template is a mesh; give one with faces", path.display());
    }
    let placing = [args.align, args.scale].map(|placing| placing == Align::Auto);
    let units = placed_units(said, args.up, placing).or(args.coding.units());
    let is_coded = goal(&args.coding, units, true, &template, 1)?.is_some();
    warn(dropped.sentence(path, is_coded && !args.coding.exact_rest && template.surface.is_empty()).as_slice());
    let origin = own_origin(&template.points);
    if origin.is_some() && args.rig.is_some() {
        bail!(
            "{}: lies far away from the origin, where rigs are not exact; move it and the frames there",
            path.display()
        );
    }
    move_to(origin, &mut template.points);
    Ok((template, origin, units))
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

fn joints_target(outputs: &mut Outputs, path: &Path) -> Result<(Target, JointsKind)> {
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    let kind = match extension.as_deref() {
        Some("csv") => JointsKind::Csv,
        Some("bvh") => JointsKind::Bvh,
        _ => bail!("{}: joints are written as .csv or .bvh; name a file that ends so", path.display()),
    };
    Ok((outputs.text(path)?, kind))
}

fn picture_target(outputs: &mut Outputs, path: &Path) -> Result<Target> {
    if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("svg")) {
        bail!("{}: gait curves are drawn as .svg; name a file that ends so", path.display());
    }
    outputs.text(path)
}

/// The files of the frames; the template and the cage are none unless they are called like these.
fn frames(args: &RecoverArgs) -> Result<MeshSequence> {
    let no_frames: Vec<_> = args.template.iter().map(|key| &key.path).chain(&args.cage).cloned().collect();
    let mut files = mesh_sequence(&args.frames, &no_frames)?;
    warn(&files.notes);
    if let Some(missing) = files.numbers.as_deref().and_then(missing_frames) {
        let what = "what follows a gap is recovered as if it came next";
        warn(&[format!("{}: missing frames: {missing}; {what}", args.frames.display())]);
    }
    warn(dropped_of_first(&files).as_slice());
    if let Some(start) = args.timing.start {
        files.numbers = Some((0..files.files.len()).map(|frame| start + frame as f64).collect());
    }
    Ok(files)
}

/// The look of the surfaces that the template does not get, by the first of them; what is wrong
/// with it is told when it is followed. Their colours are asked for by an option, and their normals
/// are followed.
fn dropped_of_first(files: &MeshSequence) -> Option<String> {
    let path = files.files.first()?;
    let dropped = read_mesh(path, &[]).ok()?.dropped_with_appearance().appearance();
    let frames = if files.files.len() > 1 { ", nor those of other frames" } else { "" };
    dropped.sentence(path, false).map(|sentence| sentence + frames)
}
