//! `cager transfer --server`.

use super::cage_file::cage_file;
use super::coding_args::goal;
use super::encode_remote::{coding_options, session_name};
use super::motion_args::TransferMotionArgs;
use super::transfer_source::MotionSource;
use super::{counted, grouped, human_bytes, is_scene, plain, progress, tell, warn};
use crate::remote::{RemoteTransfer, mesh_file, transfer_remotely};
use anyhow::{Result, bail};
use cager_capture::coding::Goal;
use cager_client::messages::SessionOptions;
use cager_client::transfer_messages::{TransferOptions, TransferStage};
use cager_client::{MeshFile, NewTransfer, TransferSource};
use cager_formats::{AtomicFile, FrameReader, Target, commit_together, obj_bytes, read_mesh};
use cager_geometry::mesh::Model;
use cager_geometry::units::Units;
use cager_motion::transfer::MethodChoice;
use std::path::{Path, PathBuf};

/// Has a service move what the arguments say. Frames are read into memory, in double precision.
pub(super) fn run(
    args: &TransferMotionArgs,
    address: &str,
    (source, target, units): (&MotionSource, &Model, Units),
    (output, report): (&Target, Option<Target>),
) -> Result<()> {
    let mut container = AtomicFile::create(output)?;
    let mut report = report.map(AtomicFile::create).transpose()?;
    let file = |path: &PathBuf| mesh_file(path);
    let frames = args.source_rest.as_ref().map(|_| source.frames(Path::new(""))).transpose()?;
    let count = frames.as_ref().map_or_else(|| source.check_frames(), |frames| Ok(frames.frames()))?;
    let mut options = options(args, goal(&args.coding, units, true, target, count)?)?;
    let sent = match (frames, &args.source_rest) {
        (Some(mut frames), Some(rest)) => {
            options.frame_rate = frames.frame_rate();
            options.start = Some(frames.number(0));
            TransferSource::Files([
                model_file(rest, &args.checks.prim)?,
                MeshFile::new("frames.npy", array(frames.as_mut())?),
            ])
        }
        _ => args.source.as_ref().map(file).transpose()?.map_or(TransferSource::Session, TransferSource::Container),
    };
    // Around the source, it is as the source.
    let units = if args.method()? == MethodChoice::Fitted { Units::UNKNOWN } else { units };
    let cage = args.cage.as_ref().map(|path| cage_file(path, units)).transpose()?;
    // Whatever it is called here.
    let pairs = args.pairs.as_ref().map(file).transpose()?.map(|pairs| MeshFile::new("pairs.txt", pairs.bytes));
    let new = NewTransfer { cage, pairs, options, ..NewTransfer::new(sent, model_file(&args.target, &[])?) };
    let mut outputs = vec![("capture.cager", &mut container)];
    outputs.extend(report.as_mut().map(|file| ("report", file)));
    let token = args.service.token();
    let job = RemoteTransfer { address, token: token.as_deref(), new, outputs };
    let bar = progress::frames("sending", count);
    let result = transfer_remotely(job, &mut |told| {
        bar.set_message(match told.stage {
            Some(TransferStage::Moving) => "moving",
            Some(TransferStage::Designing) => "designing",
            Some(TransferStage::Encoding) => "encoding",
            Some(TransferStage::Preparing) => "preparing",
            None => "waiting",
        });
        bar.set_position(u64::from(told.moved));
    });
    bar.finish_and_clear();
    let done = result?;
    let bytes = container.complete()?;
    commit_together(report.into_iter().chain([container]).collect())?;
    warn(&done.warnings);
    tell(&format!(
        "{}: {} of {} as cages of {} vertices\n  size    {}\n  service {}/v1/transfers/{}\n",
        output.path().display(),
        counted(done.frames as usize, "frame"),
        counted(done.points as usize, "point"),
        grouped(done.cage_vertices.unwrap_or(0) as usize),
        human_bytes(bytes),
        plain(address),
        done.id,
    ))
}

/// A model for a service, which would get all meshes and all frames of a scene: of those, the
/// meshes alone that are named.
fn model_file(path: &Path, prims: &[String]) -> Result<MeshFile> {
    if !is_scene(path) && prims.is_empty() {
        return Ok(mesh_file(path)?);
    }
    let model = read_mesh(path, prims)?.model;
    let name = path.with_extension("obj");
    Ok(MeshFile::new(name.file_name().unwrap_or_default().to_string_lossy(), obj_bytes(&model)))
}

fn options(args: &TransferMotionArgs, goal: Option<Goal>) -> Result<TransferOptions> {
    let SessionOptions { max_error, mean_error, target_size, quality, exact_rest, .. } =
        coding_options(goal, args.coding.exact_rest);
    let (align, matrix) = args.alignment()?;
    Ok(TransferOptions {
        name: session_name(&args.output),
        source_session: None,
        frames: None,
        method: Some(args.method),
        public: args.public,
        coordinates: args.coordinates.map(|system| system.name().to_owned()),
        rigidity: args.rigidity,
        detail: args.detail,
        pose: args.pose,
        align,
        matrix,
        up: args.up,
        cage_vertices: args.cage_vertices,
        frame_rate: args.timing.fps,
        start: args.timing.start,
        max_error,
        mean_error,
        target_size,
        quality,
        exact_rest,
    })
}

/// All frames as a .npy file. Their numbers must go on one by one, since a service is told the first alone.
fn array(frames: &mut dyn FrameReader) -> Result<Vec<u8>> {
    let (count, points) = (frames.frames(), frames.points());
    let first = frames.number(0);
    if let Some(frame) = (1..count).find(|&frame| frames.number(frame) != first + frame as f64) {
        bail!(
            "--server: frame {} follows frame {}, and a service counts frames one by one; number the files so, or \
             leave --server out",
            frames.number(frame),
            frames.number(frame - 1)
        );
    }
    let mut bytes = b"\x93NUMPY\x01\0\x76\0".to_vec();
    let shape = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({count}, {points}, 3), }}");
    bytes.extend_from_slice(format!("{shape:<117}\n").as_bytes());
    let mut frame = Vec::new();
    while frames.read_next(&mut frame)? {
        bytes.extend(frame.iter().flat_map(|x| x.to_le_bytes()));
    }
    Ok(bytes)
}
