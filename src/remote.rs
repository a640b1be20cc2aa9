//! Encoding by a service: another machine computes, from frames in single precision, the container that [`crate::encode`]
//! gives of such frames.

mod cage;
mod frames;

pub use cage::RemoteCage;
pub use frames::FileFrames;

use crate::design;
use crate::encode::Encoded;
use cager_client::cage_messages::CageProgress;
use cager_client::messages::{CageSource, FrameResult, PreparationSeconds, SessionOptions};
use cager_client::{Client, ClientError, ClientOptions, FrameSource, MeshFile, NewSession, UploadOptions};
use cager_formats::{Action, AtomicFile, Target};
use cager_proto::container::{self, ContainerReader};
use cager_proto::report::Seconds;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest wait for a session to be prepared.
const READY_TIMEOUT: Duration = Duration::from_secs(3600);

/// Longest wait for cleaning up on the service after a failure.
const CLEAN_UP_TIMEOUT: Duration = Duration::from_secs(5);

/// Why encoding by a service stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum RemoteError {
    /// The service refused, or cannot be reached.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// A file cannot be read or written.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// What the service sent is not a container.
    #[error(
        "the container from the service cannot be read ({0}); encode again, and look at the service's log if that gives the same"
    )]
    Container(container::Error),
    /// It broke off, and the service keeps what it has.
    #[error("{cause}; session {session} keeps what was sent: the same command with --session {session} goes on")]
    Kept {
        /// The session.
        session: String,
        /// Why it broke off.
        cause: Box<Self>,
    },
    /// The network runtime cannot be started.
    #[error("the network cannot be used ({0}); free some memory or files and try again")]
    Runtime(io::Error),
}

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
    /// A session whose upload broke, to go on with; it has rest pose, cage and options already.
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
    /// The cage is being designed.
    Designing(&'a CageProgress),
    /// So many frames are done.
    Frames(usize),
}

/// A capture that a service has encoded.
#[derive(Debug)]
pub struct EncodedRemotely {
    /// Report and container, as of an encoding on this machine. Of its times `invert` is that of uploading and solving, which
    /// overlap, and `write` that of completing and downloading.
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
/// See [`RemoteError`]. The session is deleted only where it is of no use: it cannot be prepared, or the frames are refused.
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
        (Some(session), _) => session.to_owned(),
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
            let design = cage::design(&client, &new.rest, &mut job.frames, options, progress).await?;
            design_time = clock_design.elapsed();
            new.options.cage = Some(CageSource { id: Some(design.id.clone()), ..CageSource::default() });
            let created = client.create(&new).await;
            // The session has its own copy of the cage.
            clean_up(&client, async |client| client.delete_cage(&design.id).await).await;
            designed = Some((design::report_of_job(&design, options), design.warnings));
            created?.id
        }
    };
    match run(&client, &session, job.frames, job.connections, file, clock, progress).await {
        Ok((mut encoded, mut steps)) => {
            steps.prepare = steps.prepare.saturating_sub(design_time);
            encoded.report.seconds.design = design_time.as_secs_f64();
            if let Some((report, warnings)) = designed {
                encoded.report.design = Some(report);
                encoded.report.warnings.extend(warnings);
            }
            Ok(EncodedRemotely { encoded, session, steps })
        }
        Err(error) if is_final(&error) => {
            clean_up(&client, async |client| client.delete(&session).await).await;
            Err(error)
        }
        Err(cause) => Err(RemoteError::Kept { session, cause: Box::new(cause) }),
    }
}

/// Whether the session is of no use any more: trying again would end the same way.
fn is_final(error: &RemoteError) -> bool {
    use ClientError::{Failed, Mismatch, NotReady, Refused, Source};
    let RemoteError::Client(error) = error else { return false };
    matches!(error, Failed(_) | Mismatch(_) | NotReady { .. } | Refused(_) | Source { .. })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_goes_only_where_trying_again_would_end_the_same_way() {
        let broken = || ClientError::Broken { address: String::new(), cause: String::new() };
        let kept = [broken(), ClientError::GaveUp { attempts: 9, last: Box::new(broken()) }];
        let refused = [
            ClientError::Mismatch("another mesh".to_owned()),
            ClientError::Source { frame: 7, cause: io::Error::other("NaN") },
        ];
        assert!(kept.into_iter().all(|error| !is_final(&error.into())));
        assert!(refused.into_iter().all(|error| is_final(&error.into())));
        assert!(!is_final(&RemoteError::Client(ClientError::Output(io::Error::other("full")))), "it is all there");
    }
}
