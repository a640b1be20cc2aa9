//! Encoding by a service: another machine computes, from frames in single precision, the container
//! that [`mod@cager_capture::encode`] gives of such frames.

mod cage;
mod error;
mod frames;
mod recover;
mod same;
mod transfer;

pub use cage::RemoteCage;
pub use error::{Difference, RemoteError};
pub use frames::FileFrames;
pub use recover::{RemoteRecovery, RemoteRecoveryProgress, recover_remotely};
pub use transfer::{RemoteTransfer, transfer_remotely};

use cager_capture::encode::Encoded;
use cager_client::cage_messages::CageProgress;
use cager_client::messages::{CageSource, FrameResult, PreparationSeconds, SessionOptions};
use cager_client::{Client, ClientError, ClientOptions, FrameSource, MeshFile, NewSession, UploadOptions};
use cager_formats::{Action, AtomicFile, Target};
use cager_proto::container::ContainerReader;
use cager_proto::report::Seconds;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest wait for a session to be prepared.
const READY_TIMEOUT: Duration = Duration::from_secs(3600);

/// Longest wait for cleaning up on the service after a failure.
const CLEAN_UP_TIMEOUT: Duration = Duration::from_secs(5);

/// Everything an encoding by a service needs.
pub struct RemoteJob<'a, F> {
    /// Address of the service.
    pub address: &'a str,
    /// Token to show there.
    pub token: Option<&'a str>,
    /// The model in its rest pose, as a file.
    pub rest: MeshFile,
    /// The cage around it.
    pub cage: RemoteCage<'a>,
    /// A session whose upload broke, to go on with; rest pose, cage, options and frames that it has must be these.
    pub session: Option<&'a str>,
    /// File with the matrix of the regularizer `matrix`.
    pub matrix: Option<&'a Path>,
    /// The capture.
    pub frames: F,
    /// Where to write.
    pub output: &'a Target,
    /// Choices for the session.
    pub options: SessionOptions,
    /// Connections that send frames at the same time.
    pub connections: usize,
}

/// How far an encoding by a service is.
#[derive(Clone, Copy, Debug)]
pub enum RemoteProgress<'a> {
    /// The design of this id is on the service, which goes on with it whatever happens here.
    Design(&'a str),
    /// The session of this id is on the service, and can be gone on with.
    Session(&'a str),
    /// The cage is being designed.
    Designing(&'a CageProgress),
    /// So many frames are done.
    Frames(usize),
}

/// A capture that a service has encoded.
#[derive(Debug)]
pub struct EncodedRemotely {
    /// Report and container, as of an encoding on this machine. Of its times `invert` is that of
    /// uploading and solving, which overlap, and `write` that of completing and downloading.
    pub encoded: Encoded,
    /// The session, which stays on the service.
    pub session: String,
    /// How long its steps took.
    pub steps: Steps,
}

/// How long the steps of an encoding by a service took, as its client saw them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Steps {
    /// Sending rest pose and cage, and waiting until the session is ready.
    pub prepare: Duration,
    /// Sending the frames and receiving what was solved, which overlap.
    pub upload: Duration,
    /// Having the container written.
    pub complete: Duration,
    /// Fetching the container.
    pub download: Duration,
}

/// Encodes a capture on a service, which also designs the cage if there is none.
///
/// # Errors
/// See [`RemoteError`]. What is on the service stays there, and the error says how to go on with
/// it, or how to look at it.
pub fn encode_remotely<F: FrameSource + 'static>(
    job: RemoteJob<'_, F>,
    progress: &mut (dyn FnMut(RemoteProgress<'_>) + Send),
) -> Result<EncodedRemotely, RemoteError> {
    // One thread for the network; frames are read on another.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(RemoteError::Runtime)?;
    runtime.block_on(encode(job, progress))
}

async fn encode<F: FrameSource + 'static>(
    mut job: RemoteJob<'_, F>,
    progress: &mut (dyn FnMut(RemoteProgress<'_>) + Send),
) -> Result<EncodedRemotely, RemoteError> {
    let clock = Instant::now();
    let mut client = Client::new(job.address)?;
    if let Some(token) = job.token {
        client = client.with_token(token);
    }
    // First, so that an unwritable output fails before the work.
    let file = AtomicFile::create(job.output)?;
    let mut new = NewSession {
        rest: job.rest,
        cage: None,
        regularizer_matrix: job.matrix.map(mesh_file).transpose()?,
        options: job.options,
        idempotency_key: None,
    };
    let mut designed = None;
    let mut design_time = Duration::ZERO;
    let session = match (job.session, job.cage) {
        (Some(session), cage) => {
            new.cage = match cage {
                RemoteCage::File(path) => Some(mesh_file(path)?),
                RemoteCage::Mesh(file) => Some(file.clone()),
                RemoteCage::Designed(_) => None,
            };
            let compared = same::check(&client, session, &new, &mut job.frames).await;
            compared.map_err(|error| error.with_session(session, job.address))?;
            session.to_owned()
        }
        (None, RemoteCage::File(path)) => {
            new.cage = Some(mesh_file(path)?);
            client.create(&new).await?.id
        }
        (None, RemoteCage::Mesh(file)) => {
            new.cage = Some(file.clone());
            client.create(&new).await?.id
        }
        (None, RemoteCage::Designed(options)) => {
            let clock_design = Instant::now();
            let design = cage::design(&client, job.address, &new.rest, &mut job.frames, options, progress).await?;
            design_time = clock_design.elapsed();
            new.options.cage = Some(CageSource { id: Some(design.id.clone()), ..CageSource::default() });
            let created = client.create(&new).await;
            let created = created.map_err(|cause| RemoteError::of_design(cause.into(), &design.id, job.address))?;
            // The session has its own copy of the cage.
            clean_up(&client, async |client| client.delete_cage(&design.id).await).await;
            designed = Some((cage::report_of_job(&design, options), design.warnings));
            created.id
        }
    };
    progress(RemoteProgress::Session(&session));
    let (mut encoded, mut steps) = run(&client, &session, job.frames, job.connections, file, clock, progress)
        .await
        .map_err(|error| error.with_session(&session, job.address))?;
    steps.prepare = steps.prepare.saturating_sub(design_time);
    encoded.report.seconds.design = design_time.as_secs_f64();
    if let Some((report, warnings)) = designed {
        encoded.report.design = Some(report);
        encoded.report.warnings.extend(warnings);
    }
    Ok(EncodedRemotely { encoded, session, steps })
}

/// Removes an object from the service, within a short time and without retries.
async fn clean_up(client: &Client, remove: impl AsyncFnOnce(Client) -> Result<(), ClientError>) {
    let hasty = client.clone().with_options(ClientOptions { retries: 0, ..ClientOptions::default() });
    let _ = tokio::time::timeout(CLEAN_UP_TIMEOUT, remove(hasty)).await;
}

async fn run(
    client: &Client,
    session: &str,
    frames: impl FrameSource + 'static,
    connections: usize,
    mut file: AtomicFile,
    clock: Instant,
    progress: &mut (dyn FnMut(RemoteProgress<'_>) + Send),
) -> Result<(Encoded, Steps), RemoteError> {
    let ready = client.wait_ready(session, READY_TIMEOUT).await?;
    let mut steps = Steps { prepare: clock.elapsed(), ..Steps::default() };
    let clock_upload = Instant::now();
    let mut done = 0;
    let mut on_frame = |_: FrameResult| {
        done += 1;
        progress(RemoteProgress::Frames(done));
    };
    let options = UploadOptions { on_frame: Some(&mut on_frame), connections, ..UploadOptions::default() };
    let uploaded = client.upload(&ready, frames, options).await?;
    steps.upload = clock_upload.elapsed();

    let clock_complete = Instant::now();
    client.complete(session, uploaded.frames).await?;
    steps.complete = clock_complete.elapsed();
    let clock_download = Instant::now();
    client.download(session, &mut file).await.map_err(name_output)?;
    file.complete()?;
    // Validated before it gets its name.
    let mut reader = ContainerReader::open(BufReader::new(file.reader()?)).map_err(RemoteError::Container)?;
    reader.verify().map_err(RemoteError::Container)?;
    let mut report = reader.report().map_err(RemoteError::Container)?;
    // Coded files do not hold them.
    if report.handle_indices.is_empty() {
        report.handle_indices = client.handles(session).await?;
    }
    steps.download = clock_download.elapsed();
    report.seconds = seconds(&ready.seconds, &steps, clock.elapsed());
    Ok((Encoded { report, container: file }, steps))
}

fn seconds(preparation: &PreparationSeconds, steps: &Steps, total: Duration) -> Seconds {
    Seconds {
        read: preparation.read,
        design: 0.0,
        coordinates: preparation.coordinates,
        maxvol: preparation.maxvol,
        svd: preparation.svd,
        invert: steps.upload.as_secs_f64(),
        measure: 0.0,
        code: 0.0,
        write: (steps.complete + steps.download).as_secs_f64(),
        total: total.as_secs_f64(),
    }
}

/// Errors of `AtomicFile` that pass through `io::Write` contain the path already.
fn name_output(error: ClientError) -> RemoteError {
    match error {
        ClientError::Output(cause) => match cause.downcast() {
            Ok(named) => RemoteError::Formats(named),
            Err(cause) => ClientError::Output(cause).into(),
        },
        error => error.into(),
    }
}

/// The bytes of a file, for a service.
///
/// # Errors
/// A file that cannot be read; it is named.
pub fn mesh_file(path: &Path) -> Result<MeshFile, cager_formats::Error> {
    let bytes = std::fs::read(path).map_err(|cause| cager_formats::Error::Io {
        path: PathBuf::from(path),
        action: Action::Read,
        cause,
    })?;
    Ok(MeshFile::new(path.file_name().unwrap_or_default().to_string_lossy(), bytes))
}
