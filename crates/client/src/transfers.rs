//! Transfers: requesting one, following it and fetching what it made.

use crate::client::Client;
use crate::create::MeshFile;
use crate::error::ClientError;
use crate::events::{Events, EventsOf};
use crate::jobs::finite;
use cager_proto::transfer_messages::{Transfer, TransferOptions, TransferProgress};
use futures_util::stream::BoxStream;
use reqwest::Method;
use std::io::Write;

/// Whose motion is moved.
#[derive(Clone, Debug, PartialEq)]
pub enum TransferSource {
    /// A rest pose with faces, and frames: a file whose name ends in `.npy`, `.pc2` or `.mdd`, or raw little-endian f32, whose number
    /// [`TransferOptions::frames`] says.
    Files([MeshFile; 2]),
    /// A container.
    Container(MeshFile),
    /// What [`TransferOptions::source_session`] says.
    Session,
}

/// What a motion is moved from and to.
#[derive(Clone, Debug, PartialEq)]
pub struct NewTransfer {
    /// Whose motion it is.
    pub source: TransferSource,
    /// The model that is to move.
    pub target: MeshFile,
    /// A cage around the source, or with the methods `public` and `rigid` around both; without one the service makes one.
    pub cage: Option<MeshFile>,
    /// Vertices that correspond, as `cager transfer --pairs` reads them.
    pub pairs: Option<MeshFile>,
    /// Choices; what is left out has the service's default.
    pub options: TransferOptions,
    /// Makes the request idempotent; random if not given.
    pub idempotency_key: Option<String>,
}

impl NewTransfer {
    /// A transfer with the service's defaults.
    pub fn new(source: TransferSource, target: MeshFile) -> Self {
        Self { source, target, cage: None, pairs: None, options: TransferOptions::default(), idempotency_key: None }
    }

    /// All files, by the names of their parts.
    pub fn files(&self) -> Vec<(&'static str, &MeshFile)> {
        let source = match &self.source {
            TransferSource::Files([rest, frames]) => vec![("source_rest", rest), ("source_frames", frames)],
            TransferSource::Container(container) => vec![("source", container)],
            TransferSource::Session => Vec::new(),
        };
        let named = [("cage", &self.cage), ("pairs", &self.pairs)];
        let others = named.into_iter().filter_map(|(part, file)| Some((part, file.as_ref()?)));
        others.chain([("target", &self.target)]).chain(source).collect()
    }
}

impl Client {
    /// Requests a transfer, which runs in the background.
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] for an option that is NaN or infinite, [`ClientError::Refused`] for bad input, and those of the
    /// connection.
    pub async fn create_transfer(&self, new: &NewTransfer) -> Result<Transfer, ClientError> {
        let TransferOptions { rigidity, frame_rate, start, max_error, mean_error, .. } = &new.options;
        let timing = [("frame_rate", frame_rate), ("start", start)];
        finite(
            [("rigidity", rigidity), ("max_error", max_error), ("mean_error", mean_error)].into_iter().chain(timing),
        )?;
        self.create_job("transfers", new.files(), &new.options, new.idempotency_key.clone()).await
    }

    /// A transfer as it is now.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn transfer(&self, id: &str) -> Result<Transfer, ClientError> {
        self.fetch(Method::GET, &["v1", "transfers", id], &[]).await
    }

    /// Progress of a transfer as it happens, until it is completed or has failed; that is the last item. A broken connection is taken up again after the
    /// last event.
    ///
    /// An error, such as [`ClientError::Refused`] for a transfer that was deleted, ends the stream.
    pub fn transfer_events(&self, id: &str) -> BoxStream<'static, Result<TransferProgress, ClientError>> {
        let is_last = |progress: &TransferProgress| progress.state.is_final();
        Events::stream(self, EventsOf { resource: "transfers", id: id.to_owned() }, is_last)
    }

    /// Writes a result of a completed transfer to `out`, `capture.cager` or `report`, and returns its length in bytes, as [`Client::download`] does.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 where the transfer is not completed, [`ClientError::Output`] where `out` cannot be written, and those of
    /// the connection.
    pub async fn download_transferred(
        &self,
        id: &str,
        name: &str,
        out: &mut (impl Write + Send),
    ) -> Result<u64, ClientError> {
        self.download_file(&["v1", "transfers", id, name], out).await
    }

    /// Deletes a transfer; what runs for it stops.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn delete_transfer(&self, id: &str) -> Result<(), ClientError> {
        self.delete_job("transfers", id).await
    }
}
