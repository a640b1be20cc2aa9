//! `cager encode --server`.

use super::args::{EncodeArgs, SolverArgs, SpectrumArg};
use super::coding_args::goal;
use super::encode_shared::{Targets, checked_options, design_options, finish, name_files, sized_design};
use super::solver_options::{check_inversion, designed_spectrum, matrix, spectrum_bound};
use super::{interrupt, is_container, is_scene, plain, progress, tell, warn};
use crate::remote::{EncodedRemotely, FileFrames, RemoteCage, RemoteJob, RemoteProgress, encode_remotely, mesh_file};
use anyhow::{Context, Result, anyhow, bail};
use cager_cages::DesignOptions;
use cager_capture::coding::Goal;
use cager_capture::design::{PerPart, read_frames};
use cager_capture::encode::Encoded;
use cager_capture::frames::CaptureFiles;
use cager_client::messages::SessionOptions;
use cager_client::{FrameSource, MeshFile};
use cager_core::cage::Cage;
use cager_formats::{AtomicFile, Target, Units, obj_bytes};
use cager_geometry::mesh::{Model, Point};
use cager_proto::container::{ContainerReader, ContainerWriter, counted_from_zero, pack_model};
use std::io::{BufReader, BufWriter};
use std::path::Path;
use std::time::Instant;

/// Bytes of an origin and of units in a container, rather too many.
const PLACEMENT_BYTES: u64 = 256;

/// The files are read and the options checked here as well, so that what is wrong with them is told
/// before anything is sent, in words that name them.
pub(super) fn run(
    args: &EncodeArgs,
    targets: &Targets,
    address: &str,
    files: &CaptureFiles,
    rest: &Model,
    cage: Option<&Cage>,
    clock: Instant,
) -> Result<()> {
    if cage.is_none() {
        design_options(args, rest.points.len())?;
    }
    if args.design.per_part == PerPart::Yes {
        bail!("--per-part: a service makes one cage for all parts; encode here for a component for each part");
    }
    if let (Some(path), Some(false)) = (&args.cage, cage.map(|cage| cage.carriers().is_empty())) {
        bail!(
            "{}: its cage has components that carry a part of the model each, which a service does not know; encode here",
            path.display()
        );
    }
    let units = files.open()?.units();
    let is_placed = files.origin.is_some() || units != Units::UNKNOWN;
    let frames = FileFrames::open(files.clone())?;
    if !counted_from_zero(&frames.numbers()) {
        warn(&["a service numbers frames from 0; encode here to keep the numbers of the files".to_owned()]);
    }
    let read_seconds = clock.elapsed().as_secs_f64();
    let matrix = matrix(&args.solver)?;
    spectrum_bound(&args.solver)?;
    refuse_choosing(&args.solver)?;
    let spectrum = match cage {
        Some(cage) => {
            let options = checked_options(args, rest, cage, matrix.as_ref())?;
            // The threshold was checked above; regularizers without one ignore it.
            args.solver.spectrum.map(|_| u32::try_from(options.spectrum).unwrap_or(u32::MAX))
        }
        None => {
            check_inversion(&args.solver)?;
            designed_spectrum(&args.solver)?
        }
    };
    let handle_count = args.solver.handle_count.map(u32::try_from).transpose();
    let report_file = targets.begin_report()?;

    let token = args.token.clone().or_else(|| std::env::var("CAGER_TOKEN").ok()).filter(|token| !token.is_empty());
    // As it was read: welded, turned around and in the units of the rest pose.
    let is_sent_as_read = is_placed || args.cage.as_deref().is_some_and(is_container);
    let moved_cage = cage
        .filter(|_| is_sent_as_read)
        .map(|cage| MeshFile::new("cage.obj", obj_bytes(&Model::from(cage.mesh().clone()))));
    let mut options = SessionOptions {
        name: session_name(&args.output),
        coordinates: Some(args.solver.coordinates.name().to_owned()),
        handles: args.solver.handles.map(|handles| handles.name().to_owned()),
        handle_count: handle_count.context("--handle-count: is larger than any number of points")?,
        regularizer: Some(args.solver.regularizer.name().to_owned()),
        spectrum,
        lambda: args.solver.lambda,
        flip_cage: args.flip_cage && moved_cage.is_none(),
        frame_rate: frames.frame_rate(),
        frames: frames.frames(),
        ..coding_options(
            goal(&args.coding, args.coding.units(), args.cage.is_some(), rest, frames.frames().unwrap_or(1) as usize)?,
            args.coding.exact_rest,
        )
    };
    // A service does not know of the origin and of the units, which are added to what it sends.
    if is_placed {
        options.target_size = options.target_size.map(|bytes| bytes.saturating_sub(PLACEMENT_BYTES));
    }
    // Here, since a service designs before it sees what the frames cost.
    let clock_size = Instant::now();
    let design = match cage {
        Some(_) => DesignOptions::default(),
        // A session has its cage.
        None if args.session.is_some() => DesignOptions::default(),
        None => {
            let frames = read_frames(files).map_err(|error| name_files(error, args))?;
            sized_design(args, files, rest, None, &frames)?
        }
    };
    let size_seconds = clock_size.elapsed().as_secs_f64();
    let bar = progress::frames("encoding", frames.frames().unwrap_or(0) as usize);
    let job = RemoteJob {
        address,
        token: token.as_deref(),
        // A service reads a rest pose as it is, with the doubles along seams, and where it is; of
        // an archive it would get all meshes and all frames, and of a file without those beside it
        // neither materials nor pictures.
        rest: if !rest.surface.is_empty() {
            MeshFile::new("rest.cager", pack_model(rest, Units::UNKNOWN)?)
        } else if args.capture.weld
            || files.origin.is_some()
            || !args.capture.checks.prim.is_empty()
            || is_scene(&args.rest)
        {
            MeshFile::new("rest.obj", obj_bytes(rest))
        } else {
            mesh_file(&args.rest)?
        },
        cage: match (&args.cage, &moved_cage) {
            (Some(_), Some(cage)) => RemoteCage::Mesh(cage),
            (Some(path), None) => RemoteCage::File(path),
            (None, _) => RemoteCage::Designed(&design),
        },
        session: args.session.as_deref(),
        matrix: args.solver.regularizer_matrix.as_deref(),
        frames,
        output: &targets.output,
        options,
        connections: usize::from(args.connections),
    };
    let designing = progress::steps();
    let goes_on = |session: &str| {
        format!("session {session} keeps what was sent: the same command with --session {session} goes on")
    };
    let result = encode_remotely(job, &mut |told| match told {
        RemoteProgress::Design(id) => interrupt::set_last_words(format!(
            "the service goes on designing the cage: fetch it from {}/v1/cages/{} and give it with --cage",
            plain(address.trim_end_matches('/')),
            plain(&format!("{id}/cage.obj")),
        )),
        RemoteProgress::Session(id) => interrupt::set_last_words(goes_on(&plain(id))),
        RemoteProgress::Designing(told) => progress::design(&designing, told),
        RemoteProgress::Frames(done) => {
            designing.finish_and_clear();
            bar.set_position(done as u64);
        }
    });
    designing.finish_and_clear();
    bar.finish_and_clear();
    let EncodedRemotely { mut encoded, session, .. } = result?;
    encoded.report.seconds.read += read_seconds;
    encoded.report.seconds.design += size_seconds;
    let placed = if is_placed { placed(encoded, (files.origin, units), &targets.output) } else { Ok(encoded) };
    placed
        .and_then(|encoded| finish(targets, encoded, report_file, clock))
        .map_err(|error| anyhow!("{error:#}; {}", goes_on(&plain(&session))))?;
    interrupt::set_last_words(String::new());
    tell(&format!("  service {}, session {}\n", plain(address), plain(&session)))
}

/// The container of a service, which was sent positions about an origin and knows neither it nor what they mean.
fn placed(encoded: Encoded, (origin, units): (Option<Point>, Units), output: &Target) -> Result<Encoded> {
    let Encoded { mut report, container: mut from } = encoded;
    let mut reader = ContainerReader::open(BufReader::new(from.reader()?))?;
    let out = BufWriter::new(AtomicFile::create(output)?);
    let mut container = ContainerWriter::copy_placed(&mut reader, (origin, units), &[], out)?
        .into_inner()
        .map_err(std::io::IntoInnerError::into_error)?;
    report.origin = origin;
    report.set_units(units);
    report.set_output(container.complete()?);
    Ok(Encoded { report, container })
}

/// What a service calls what is written there.
pub(super) fn session_name(output: &Path) -> Option<String> {
    let name = output.file_stem().filter(|&name| name != "-")?;
    Some(name.to_string_lossy().chars().take(200).collect())
}

/// What the container is to meet, as a session is asked for it.
pub(super) fn coding_options(goal: Option<Goal>, exact_rest: bool) -> SessionOptions {
    let options = SessionOptions { exact_rest, ..SessionOptions::default() };
    match goal {
        None => SessionOptions::default(),
        Some(Goal::MaxError(error)) => SessionOptions { max_error: Some(error), ..options },
        Some(Goal::MeanError(error)) => SessionOptions { mean_error: Some(error), ..options },
        Some(Goal::Size(bytes)) => SessionOptions { target_size: Some(bytes), ..options },
        Some(Goal::Preview) => SessionOptions { quality: Some("preview".to_owned()), ..options },
        Some(Goal::Standard) => SessionOptions { quality: Some("standard".to_owned()), ..options },
    }
}

pub(super) fn refuse_choosing(args: &SolverArgs) -> Result<()> {
    if args.spectrum == Some(SpectrumArg::Auto) {
        bail!(
            "--spectrum auto: a service prepares before it sees a frame to measure; give a number, or encode without \
             --server"
        );
    }
    Ok(())
}
