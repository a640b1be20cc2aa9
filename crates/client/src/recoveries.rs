//! Recoveries: requesting one, sending its frames, following it and fetching what it made.

use crate::body::json;
use crate::client::Client;
use crate::create::{MeshFile, part};
use crate::error::{ClientError, Failure};
use crate::events::{Events, EventsOf};
use crate::jobs::finite;
use cager_proto::recovery_messages::{CompleteRecovery, PostedFrames, Recovery, RecoveryOptions, RecoveryProgress};
use futures_util::stream::BoxStream;
use reqwest::Method;
use reqwest::multipart::Form;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// What an animation is recovered from, beside its frames.
#[derive(Clone, Debug, PartialEq)]
pub struct NewRecovery {
    /// The mesh that is to move.
    pub template: MeshFile,
    /// A cage around it; without one the service makes one.
    pub cage: Option<MeshFile>,
    /// The rig and the usual poses of a person, in place of a cage.
    pub person: Option<[MeshFile; 2]>,
    /// Choices; what is left out has the service's default.
    pub options: RecoveryOptions,
    /// Makes the request idempotent; random if not given.
    pub idempotency_key: Option<String>,
}

impl NewRecovery {
    /// A recovery of a template with the service's defaults.
    pub fn new(template: MeshFile) -> Self {
        Self { template, cage: None, person: None, options: RecoveryOptions::default(), idempotency_key: None }
    }
}

impl Client {
    /// Creates a recovery, which takes frames at once.
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] for an option that is NaN or infinite, [`ClientError::Refused`] for bad input, and those of the
    /// connection.
    pub async fn create_recovery(&self, new: &NewRecovery) -> Result<Recovery, ClientError> {
        let RecoveryOptions { frame_rate, start, max_error, mean_error, .. } = &new.options;
        let numbers =
            [("frame_rate", frame_rate), ("start", start), ("max_error", max_error), ("mean_error", mean_error)];
        finite(numbers)?;
        let person = new.person.iter().flat_map(|person| ["rig", "manifold"].into_iter().zip(person));
        let others = new.cage.iter().map(|cage| ("cage", cage)).chain(person);
        let files = std::iter::once(("template", &new.template)).chain(others).collect();
        self.create_job("recoveries", files, &new.options, new.idempotency_key.clone()).await
    }

    /// A recovery as it is now.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn recovery(&self, id: &str) -> Result<Recovery, ClientError> {
        self.fetch(Method::GET, &["v1", "recoveries", id], &[]).await
    }

    /// Sends frames, the first of which has the number `first`. When it returns they are on disk there; sending them again changes nothing.
    ///
    /// # Errors
    /// [`ClientError::Refused`] for a frame that holds no surface, and those of the connection.
    pub async fn post_recovery_frames(
        &self,
        id: &str,
        first: u32,
        frames: &[MeshFile],
    ) -> Result<PostedFrames, ClientError> {
        let bytes = frames.iter().map(|file| file.bytes.len() as u64).sum();
        self.retrying(|| async {
            let sent = Arc::new(AtomicU64::new(0));
            let form = frames.iter().fold(Form::new(), |form, file| form.part("frame", part(file, &sent)));
            let path = ["v1", "recoveries", id, "frames"];
            let request = self.request(Method::POST, &path, &[("first", first.to_string())]).await?;
            let posted: PostedFrames =
                json(self, self.send_for_work(request.multipart(form), &sent, bytes).await?).await?;
            Ok::<_, Failure>(posted)
        })
        .await
    }

    /// Says that there are so many frames, all of which were sent. The recovery is then finished in the background.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 where frames are missing, and those of the connection.
    pub async fn complete_recovery(&self, id: &str, frames: u32) -> Result<Recovery, ClientError> {
        self.retrying(|| async {
            let request = self.request(Method::POST, &["v1", "recoveries", id, "complete"], &[]).await?;
            json(self, self.send(request.json(&CompleteRecovery { frames })).await?).await
        })
        .await
    }

    /// Progress of a recovery as it happens, with each frame as it is followed, until it is completed or has failed; that is the last item. A broken
    /// connection is taken up again after the last event.
    ///
    /// An error, such as [`ClientError::Refused`] for a recovery that was deleted, ends the stream.
    pub fn recovery_events(&self, id: &str) -> BoxStream<'static, Result<RecoveryProgress, ClientError>> {
        let is_last = |progress: &RecoveryProgress| progress.state.is_final();
        Events::stream(self, EventsOf { resource: "recoveries", id: id.to_owned() }, is_last)
    }

    /// Writes a result of a completed recovery to `out`, `capture.cager`, `report`, `joints.csv` or `joints.bvh`, and returns its length in bytes, as
    /// [`Client::download`] does.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 where the recovery is not completed, [`ClientError::Output`] where `out` cannot be written, and those
    /// of the connection.
    pub async fn download_recovered(
        &self,
        id: &str,
        name: &str,
        out: &mut (impl Write + Send),
    ) -> Result<u64, ClientError> {
        self.download_file(&["v1", "recoveries", id, name], out).await
    }

    /// Deletes a recovery; what runs for it stops.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn delete_recovery(&self, id: &str) -> Result<(), ClientError> {
        self.delete_job("recoveries", id).await
    }
}
