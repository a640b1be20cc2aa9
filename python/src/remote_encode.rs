//! Encodes on a service: the container is that of [`crate::encode`] of the same frames in single precision.

use crate::arrays::{frame_arrays, frame_views};
use crate::call::{Call, Stop, blocking};
use crate::capture::Capture;
use crate::encode::{Asked, cage_of, design_options};
use crate::fault::{Fault, computing, of};
use crate::geometry::of_rest;
use crate::kept_frames::KeptFrames;
use crate::loop_progress::LoopProgress;
use crate::own_file::{OwnFile, temporary};
use crate::watch::Watch;
use cager_cages::{Goal, Style};
use cager_client::cage_messages::{CageOptions, CageState, CageStyle};
use cager_client::messages::{CageSource, FrameResult, SessionOptions};
use cager_client::{Client, ClientError, ClientOptions, FrameSource, MeshFile, NewCage, NewSession, UploadOptions};
use cager_formats::obj_bytes;
use cager_geometry::mesh::{Model, TriMesh};
use cager_geometry::units::Units;
use cager_proto::container::{self, ContainerReader, ContainerWriter};
use futures_util::StreamExt as _;
use pyo3::prelude::*;
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::sync::Arc;
use std::time::Duration;

/// Longest wait for a session or a cage.
const READY_TIMEOUT: Duration = Duration::from_secs(3600);

/// Longest wait for what is deleted in the end.
const CLEAN_UP_TIMEOUT: Duration = Duration::from_secs(5);

/// What is encoded, and how.
pub(crate) struct Encoding {
    pub(crate) client: Client,
    /// The address as it was given.
    pub(crate) url: String,
    pub(crate) rest: Model,
    pub(crate) mesh: Option<TriMesh>,
    pub(crate) frames: KeptFrames,
    /// The number of each frame.
    pub(crate) numbers: Arc<[f64]>,
    pub(crate) asked: Asked,
    pub(crate) name: Option<String>,
    /// Whether the session stays on the service.
    pub(crate) keep: bool,
}

/// What is on the service.
#[derive(Default)]
struct Left {
    design: Option<String>,
    session: Option<String>,
}

/// Encodes; what is left on the service is deleted, whatever happens.
pub(crate) async fn encode(
    job: Encoding,
    callback: Option<Py<PyAny>>,
    call: Call,
) -> Result<impl FnOnce(Python<'_>) -> Result<Py<PyAny>, Fault> + Send + 'static, Fault> {
    let Call { post, mut stop } = call;
    let progress = LoopProgress::new(callback, post);
    let (client, url, keep) = (job.client.clone(), job.url.clone(), job.keep);
    let mut left = Left::default();
    let result = run(job, &mut stop, &progress, &mut left).await.map_err(|fault| fault.of_service(&url));
    progress.end();
    if keep {
        left.session = None;
    }
    left.delete(client).await;
    Ok(move |py: Python<'_>| {
        let capture = progress.unless_raised(result)?;
        // To whoever awaits it.
        capture.warn(py, 2)?;
        Ok(Py::new(py, capture)?.into_any())
    })
}

async fn run(job: Encoding, stop: &mut Stop, progress: &Arc<LoopProgress>, left: &mut Left) -> Result<Capture, Fault> {
    let (client, asked, name) = (job.client.clone(), job.asked, job.name.clone());
    let numbers = Arc::clone(&job.numbers);
    let preparing = Arc::clone(progress);
    let prepared = stop.or(progress.or(blocking(move || prepare(job, &preparing)))).await?;
    let frames = prepared.frames;
    let mut session = NewSession {
        rest: prepared.rest,
        cage: prepared.cage,
        regularizer_matrix: None,
        options: SessionOptions {
            name,
            coordinates: Some(asked.system.name().to_owned()),
            frame_rate: asked.frame_rate,
            frames: frames.frames(),
            max_error: asked.max_error,
            mean_error: asked.mean_error.filter(|_| prepared.design.is_none()),
            ..SessionOptions::default()
        },
        idempotency_key: None,
    };
    // What is created is awaited even where the call is cancelled, so that it can be deleted.
    let mut warnings = Vec::new();
    if let Some(new) = prepared.design {
        let id = client.design_cage(&new).await?.id;
        left.design = Some(id.clone());
        warnings = stop.or(progress.or(designed(&client, &id, progress))).await?;
        session.options.cage = Some(CageSource { id: Some(id), ..CageSource::default() });
    }
    progress.tell("preparing", 0.0);
    let id = client.create(&session).await?.id;
    left.session = Some(id.clone());
    drop(session);
    let mut capture = stop.or(progress.or(filled(&client, &id, frames, (asked.units, numbers), progress))).await?;
    capture.warnings.extend(warnings);
    Ok(capture)
}

/// What is sent.
struct Prepared {
    rest: MeshFile,
    cage: Option<MeshFile>,
    /// Of a cage, where none was given.
    design: Option<NewCage>,
    frames: KeptFrames,
}

/// Checks all that was given, as [`crate::encode`] does, before anything is sent.
fn prepare(job: Encoding, progress: &Arc<LoopProgress>) -> Result<Prepared, Fault> {
    let Encoding { mut rest, mesh, frames: mut kept, asked, .. } = job;
    let watch = Watch::on_loop(Arc::clone(progress));
    let found = Python::try_attach(|py| {
        let given = frame_arrays(kept.arrays(py), "frames")?;
        let views = frame_views(&given)?;
        computing(py, || {
            let mut frames = of_rest(&mut rest, &views, &watch);
            frames.check(&rest, asked.force)?;
            let (mut all, mut frame) = (frames.open(), Vec::new());
            while cager_formats::FrameReader::read_next(&mut all, &mut frame)? {}
            let cage = mesh.map(|mesh| cage_of(&rest, mesh, frames.origin, asked.force)).transpose()?;
            let goal = asked.goal(cage.is_some())?;
            let design = match cage {
                Some(_) => None,
                None => Some(design_options(&rest, &frames, asked, goal, &watch)?),
            };
            Ok((frames.origin, cage, design))
        })
    });
    let (origin, cage, design) = found.unwrap_or_else(|| Err(Fault::Told("Python has ended".to_owned())))?;
    kept.origin = origin;
    let rest = MeshFile::new("rest.obj", obj_bytes(&rest));
    let design = design.map(|options| {
        let new = NewCage::of_frames(rest.clone(), &mut kept)?;
        let (vertices, mean_error) = match options.goal {
            Goal::Vertices(vertices) => (Some(u32::try_from(vertices).unwrap_or(u32::MAX)), None),
            Goal::MeanError(error) => (None, Some(error)),
        };
        let style = match options.style {
            Style::Free => CageStyle::Free,
            Style::Editable => CageStyle::Editable,
        };
        let options =
            CageOptions { vertices, mean_error, style: Some(style), seed: Some(options.seed), ..new.options.clone() };
        Ok::<_, ClientError>(NewCage { options, ..new })
    });
    let cage = cage.map(|cage| MeshFile::new("cage.obj", obj_bytes(&Model::from(cage.mesh().clone()))));
    Ok(Prepared { rest, cage, design: design.transpose()?, frames: kept })
}

/// Waits until a cage is designed. What the user should know of it.
async fn designed(client: &Client, id: &str, progress: &Arc<LoopProgress>) -> Result<Vec<String>, Fault> {
    let mut events = client.cage_events(id);
    while let Some(told) = events.next().await {
        let told = told?;
        progress.tell(told.stage.as_deref().unwrap_or("designing the cage"), told.fraction);
        if told.state == CageState::Completed {
            break;
        }
    }
    // The final state, with the reason if the design failed.
    Ok(client.wait_cage(id, READY_TIMEOUT).await?.warnings)
}

/// Sends the frames to a session, and fetches the container.
async fn filled(
    client: &Client,
    id: &str,
    frames: KeptFrames,
    (units, numbers): (Units, Arc<[f64]>),
    progress: &Arc<LoopProgress>,
) -> Result<Capture, Fault> {
    let ready = client.wait_ready(id, READY_TIMEOUT).await?;
    let (origin, total) = (frames.origin, frames.frames().unwrap_or(0).max(1));
    let mut done = 0_u32;
    let mut on_frame = |_: FrameResult| {
        done += 1;
        progress.tell("encoding", f64::from(done) / f64::from(total));
    };
    let options = UploadOptions { on_frame: Some(&mut on_frame), ..UploadOptions::default() };
    let uploaded = client.upload(&ready, frames, options).await?;
    client.complete(id, uploaded.frames).await?;
    let mut file = temporary()?;
    client.download(id, file.as_file_mut()).await?;
    blocking(move || {
        let mut container = checked(file.reopen().map_err(ClientError::Output)?)?;
        if origin.is_none() && units == Units::UNKNOWN && container::counted_from_zero(&numbers) {
            return Capture::of_encoding(OwnFile::new(file.into_temp_path()));
        }
        // The service was sent positions about an origin, and knows neither that nor what they mean.
        let placed = temporary()?;
        let out = BufWriter::new(placed.reopen().map_err(ClientError::Output)?);
        let out = ContainerWriter::copy_placed(&mut container, (origin, units), &numbers, out)
            .map_err(|error| damaged(&error))?;
        out.into_inner().map_err(|error| ClientError::Output(error.into_error()))?;
        Capture::of_encoding(OwnFile::new(placed.into_temp_path()))
    })
    .await
}

/// A container that a service has sent, unless it is damaged.
pub(crate) fn checked(file: File) -> Result<ContainerReader<BufReader<File>>, Fault> {
    let mut container = ContainerReader::open(BufReader::new(file)).map_err(|error| damaged(&error))?;
    container.verify().map_err(|error| damaged(&error))?;
    Ok(container)
}

fn damaged(error: &container::Error) -> Fault {
    of(
        "the container from the service",
        format!("cannot be read ({error}); try again, and look at the service's log if that gives the same"),
    )
}

impl Left {
    /// Within a short time, and again where the service is busy.
    async fn delete(self, client: Client) {
        let client = client.with_options(ClientOptions { retries: 3, ..ClientOptions::default() });
        let all = async {
            if let Some(session) = self.session {
                let _ = client.delete(&session).await;
            }
            if let Some(design) = self.design {
                let _ = client.delete_cage(&design).await;
            }
        };
        let _ = tokio::time::timeout(CLEAN_UP_TIMEOUT, all).await;
    }
}
