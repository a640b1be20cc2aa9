//! Recovery by a service: the same files in, the same container out.

use super::{RemoteError, clean_up, mesh_file};
use cager_client::recovery_messages::{Recovery, RecoveryProgress, RecoveryState};
use cager_client::{Client, NewRecovery};
use cager_formats::AtomicFile;
use futures_util::StreamExt as _;
use std::io::Write;
use std::path::PathBuf;
use std::time::UNIX_EPOCH;

/// Everything a recovery by a service needs.
pub struct RemoteRecovery<'a> {
    /// Address of the service.
    pub address: &'a str,
    /// Token to show there.
    pub token: Option<&'a str>,
    /// What is recovered; its key is made of it and of the files, so that the same again goes on.
    pub new: NewRecovery,
    /// The frames.
    pub files: &'a [PathBuf],
    /// Where results are written, by their names.
    pub outputs: Vec<(&'static str, &'a mut AtomicFile)>,
}

/// How far a recovery by a service is.
#[derive(Clone, Copy, Debug)]
pub enum RemoteRecoveryProgress<'a> {
    /// So many frames are there.
    Sent(usize),
    /// What the service does.
    Told(&'a RecoveryProgress),
}

/// Recovers an animation on a service, where it stays with its results when it is completed.
///
/// # Errors
/// See [`RemoteError`]. Where the connection broke, the service keeps what it has, and the same call goes on.
pub fn recover_remotely(
    job: RemoteRecovery<'_>,
    progress: &mut dyn FnMut(RemoteRecoveryProgress<'_>),
) -> Result<Recovery, RemoteError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(RemoteError::Runtime)?;
    runtime.block_on(recover(job, progress))
}

async fn recover(
    mut job: RemoteRecovery<'_>,
    progress: &mut dyn FnMut(RemoteRecoveryProgress<'_>),
) -> Result<Recovery, RemoteError> {
    let mut client = Client::new(job.address)?;
    if let Some(token) = job.token {
        client = client.with_token(token);
    }
    job.new.idempotency_key = Some(key(&job.new, job.files));
    let begun = client.create_recovery(&job.new).await?;
    let id = begun.id.clone();
    let followed = follow(&client, begun, job.files, progress).await;
    if followed.as_ref().is_err_and(is_refusal) {
        // The same again would be refused again.
        clean_up(&client, async |client| client.delete_recovery(&id).await).await;
    }
    let ended = followed?;
    if let Some(problem) = ended.problem {
        clean_up(&client, async |client| client.delete_recovery(&id).await).await;
        return Err(RemoteError::Failed(problem.detail));
    }
    for (name, out) in job.outputs {
        client.download_recovered(&id, name, out).await?;
    }
    Ok(ended)
}

/// Whether the service refuses what was sent, so that what it has is of no use. A proxy's limit can
/// be raised, and the same call goes on then.
fn is_refusal(error: &RemoteError) -> bool {
    match error {
        RemoteError::Client(error) if error.is_body_limit() => false,
        RemoteError::Client(error) => {
            error.status().is_some_and(|status| (400..500).contains(&status) && ![408, 429].contains(&status))
        }
        _ => false,
    }
}

/// Sends the frames that are not there and waits for the end.
async fn follow(
    client: &Client,
    begun: Recovery,
    files: &[PathBuf],
    progress: &mut dyn FnMut(RemoteRecoveryProgress<'_>),
) -> Result<Recovery, RemoteError> {
    let id = begun.id;
    if !begun.state.is_final() && begun.frames.declared.is_none() {
        let there = begun.frames.missing.first().map_or(begun.frames.received, |range| range[0]);
        for (frame, path) in files.iter().enumerate().skip(there as usize) {
            let sent = client.post_recovery_frames(&id, frame as u32, &[mesh_file(path)?]).await;
            if let Err(error) = sent {
                // It may have failed meanwhile, which says more.
                let now = client.recovery(&id).await?;
                if now.state == RecoveryState::Failed {
                    return Ok(now);
                }
                return Err(error.into());
            }
            progress(RemoteRecoveryProgress::Sent(frame + 1));
        }
        client.complete_recovery(&id, files.len() as u32).await?;
    }
    let mut events = client.recovery_events(&id);
    while let Some(told) = events.next().await {
        progress(RemoteRecoveryProgress::Told(&told?));
    }
    Ok(client.recovery(&id).await?)
}

/// What stands for a recovery of these files.
fn key(new: &NewRecovery, files: &[PathBuf]) -> String {
    let mut digest = blake3::Hasher::new();
    // Whatever else is written, a digest takes it.
    let _ = write!(digest, "{:?}", new.options);
    let person = new.person.iter().flat_map(|[rig, manifold]| [("rig", rig), ("manifold", manifold)]);
    let cage = new.cage.iter().map(|cage| ("cage", cage));
    for (name, part) in [("template", &new.template)].into_iter().chain(cage).chain(person) {
        let _ = write!(digest, "{name} {:?} {} ", part.name, part.bytes.len());
        digest.update(&part.bytes);
    }
    for path in files {
        let found = std::fs::metadata(path).ok();
        let changed = found.as_ref().and_then(|found| found.modified().ok()?.duration_since(UNIX_EPOCH).ok());
        let _ = write!(digest, "{} {:?} {changed:?}", path.display(), found.map(|found| found.len()));
    }
    digest.finalize().to_hex().to_string()
}
