//! A transfer by a service: the same files in, the same container out.

use super::{RemoteError, clean_up};
use cager_client::transfer_messages::{Transfer, TransferProgress};
use cager_client::{Client, NewTransfer};
use cager_formats::AtomicFile;
use futures_util::StreamExt as _;
use std::io::Write;

/// Everything a transfer by a service needs.
pub struct RemoteTransfer<'a> {
    /// Address of the service.
    pub address: &'a str,
    /// Token to show there.
    pub token: Option<&'a str>,
    /// What is moved; its key is made of it, so that the same again goes on.
    pub new: NewTransfer,
    /// Where results are written, by their names.
    pub outputs: Vec<(&'static str, &'a mut AtomicFile)>,
}

/// Moves a motion on a service, where it stays with its results when it is completed.
///
/// # Errors
/// See [`RemoteError`]. Where the connection broke, the service goes on, and the same call finds what it did.
pub fn transfer_remotely(
    job: RemoteTransfer<'_>,
    progress: &mut dyn FnMut(&TransferProgress),
) -> Result<Transfer, RemoteError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(RemoteError::Runtime)?;
    runtime.block_on(transfer(job, progress))
}

async fn transfer(
    mut job: RemoteTransfer<'_>,
    progress: &mut dyn FnMut(&TransferProgress),
) -> Result<Transfer, RemoteError> {
    let mut client = Client::new(job.address)?;
    if let Some(token) = job.token {
        client = client.with_token(token);
    }
    job.new.idempotency_key = Some(key(&job.new));
    let id = client.create_transfer(&job.new).await?.id;
    let mut events = client.transfer_events(&id);
    while let Some(told) = events.next().await {
        progress(&told?);
    }
    let ended = client.transfer(&id).await?;
    if let Some(problem) = ended.problem {
        clean_up(&client, async |client| client.delete_transfer(&id).await).await;
        return Err(RemoteError::Failed(problem.detail));
    }
    for (name, out) in job.outputs {
        client.download_transferred(&id, name, out).await?;
    }
    Ok(ended)
}

/// What stands for a transfer of these files.
fn key(new: &NewTransfer) -> String {
    let mut digest = blake3::Hasher::new();
    // Whatever else is written, a digest takes it.
    let _ = write!(digest, "{:?}", new.options);
    for (name, part) in new.files() {
        let _ = write!(digest, "{name} {:?} {} ", part.name, part.bytes.len());
        digest.update(&part.bytes);
    }
    digest.finalize().to_hex().to_string()
}
