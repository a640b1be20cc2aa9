//! `cager recover --server`.

use super::cage_file::cage_file;
use super::coding_args::goal;
use super::encode_remote::{coding_options, session_name};
use super::recover_args::{Align, JointsKind, PersonMethod, RecoverArgs};
use super::{counted, grouped, human_bytes, is_container, plain, progress, tell, warn};
use crate::remote::{RemoteRecovery, RemoteRecoveryProgress, mesh_file, recover_remotely};
use anyhow::Result;
use cager_client::NewRecovery;
use cager_client::messages::SessionOptions;
use cager_client::recovery_messages::{Placing, RecoveryOptions, RecoveryState};
use cager_formats::{AtomicFile, MeshSequence, Target, commit_together};
use cager_geometry::mesh::Model;
use cager_geometry::units::{Units, Up};
use std::path::PathBuf;

/// Has a service recover what the arguments say.
pub(super) fn run(
    args: &RecoverArgs,
    address: &str,
    template: (&Model, Units),
    files: &MeshSequence,
    output: &Target,
    report: Option<Target>,
    joints: Option<(Target, JointsKind)>,
) -> Result<()> {
    let mut container = AtomicFile::create(output)?;
    let mut report = report.map(AtomicFile::create).transpose()?;
    let mut joints = joints
        .map(|(target, kind)| Ok::<_, anyhow::Error>((kind.result(), AtomicFile::create(target)?)))
        .transpose()?;
    let file = |path: Option<&PathBuf>| path.map(|path| mesh_file(path)).transpose();
    let person = file(args.rig.as_ref())?.zip(file(args.manifold.as_ref())?).map(|(rig, manifold)| [rig, manifold]);
    let options = options(args, template, files.files.len(), person.is_some())?;
    let cage = match args.cage.first() {
        Some(path) if is_container(path) => Some(cage_file(path, Units::UNKNOWN)?),
        given => file(given)?,
    };
    let template_file = mesh_file(&args.template[0].path)?;
    let new = NewRecovery { cage, person, options, ..NewRecovery::new(template_file) };
    let mut outputs = vec![("capture.cager", &mut container)];
    outputs.extend(report.as_mut().map(|file| ("report", file)));
    outputs.extend(joints.as_mut().map(|(name, file)| (*name, file)));
    let token = args.service.token();
    let job = RemoteRecovery { address, token: token.as_deref(), new, files: &files.files, outputs };
    let bar = progress::frames("sending", files.files.len());
    let result = recover_remotely(job, &mut |told| match told {
        RemoteRecoveryProgress::Sent(sent) => bar.set_position(sent as u64),
        RemoteRecoveryProgress::Told(told) => {
            bar.set_message(if told.refined > 0 { "refining" } else { "following" });
            let done = if told.refined > 0 { told.refined } else { told.followed };
            bar.set_position(if told.state == RecoveryState::Completed { 0 } else { u64::from(done) });
        }
    });
    bar.finish_and_clear();
    let done = result?;
    let bytes = container.complete()?;
    commit_together(report.into_iter().chain(joints.map(|(_, file)| file)).chain([container]).collect())?;
    warn(&done.warnings);
    tell(&format!(
        "{}: {} of {} as cages of {} vertices\n  frames  {} lost\n  size    {}\n  service {}/v1/recoveries/{}\n",
        output.path().display(),
        counted(done.frames.received as usize, "frame"),
        counted(done.points as usize, "point"),
        grouped(done.cage_vertices.unwrap_or(0) as usize),
        grouped(done.frames.lost as usize),
        human_bytes(bytes),
        plain(address),
        done.id,
    ))
}

fn options(
    args: &RecoverArgs,
    (template, units): (&Model, Units),
    frames: usize,
    has_rig: bool,
) -> Result<RecoveryOptions> {
    let goal = goal(&args.coding, units, true, template, frames)?;
    let SessionOptions { max_error, mean_error, target_size, quality, exact_rest, .. } =
        coding_options(goal, args.coding.exact_rest);
    let placing = |align| (align == Align::Auto).then_some(Placing::Auto);
    let method = match args.method {
        PersonMethod::Robust => "robust",
        PersonMethod::Paper => "paper",
    };
    Ok(RecoveryOptions {
        name: session_name(&args.output),
        align: placing(args.align),
        scale: placing(args.scale),
        up: args.up.map(|up| if up == Up::Z { "z" } else { "y" }.to_owned()),
        offsets: args.offsets,
        force: args.force,
        points: Some(args.points),
        method: has_rig.then(|| method.to_owned()),
        frame_rate: args.timing.fps,
        start: args.timing.start,
        frames: u32::try_from(frames).ok(),
        max_error,
        mean_error,
        target_size,
        quality,
        exact_rest,
    })
}
