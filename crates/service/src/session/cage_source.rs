//! The cage of a new session: as it was sent, designed before, or made around the rest pose.

use crate::admission::Permit;
use crate::preparation::{CAGE_NAME, Enclosed, refuse_cage};
use crate::problem::ApiError;
use crate::service::Service;
use crate::store::{Content, ContentKey, NamedFile};
use crate::tasks::blocking;
use cager_proto::messages::{CageSource, SessionOptions};
use std::sync::Arc;

/// The files of a request that creates a session.
pub(crate) struct UploadedFiles {
    pub(crate) rest: NamedFile,
    pub(crate) cage: Option<NamedFile>,
    pub(crate) matrix: Option<NamedFile>,
}

impl Service {
    /// The content of a new session, whose memory `room` permits, with its cage; and, where the cage was made here, the digest of the inputs that it was made from.
    ///
    /// # Errors
    /// Options that contradict each other or the cage, a design that is unknown or not completed, a rest pose that cannot be enclosed.
    pub(crate) async fn resolve_cage(
        &self,
        tenant: &str,
        uploaded: UploadedFiles,
        options: &SessionOptions,
        room: &Arc<Permit>,
    ) -> Result<(Content, Option<ContentKey>), ApiError> {
        let UploadedFiles { rest, cage, matrix } = uploaded;
        let (rest, cage, made) = match (cage, options.cage.clone()) {
            (Some(cage), None) => (rest, cage, None),
            (Some(_), Some(_)) => {
                return Err(refuse_cage("a cage is sent as well; leave out the part or the option"));
            }
            (None, Some(CageSource { vertices: Some(_), id: Some(_) })) => {
                return Err(refuse_cage("give vertices to make a cage, or id to take a designed one, not both"));
            }
            (None, Some(CageSource { id: Some(id), .. })) => (rest, self.designed_cage(tenant, &id).await?, None),
            (None, source) => {
                let vertices = source.and_then(|source| source.vertices);
                let stored = async |made| {
                    let (store, key) = (self.store.clone(), self.registry.made_cage(tenant, &made)?);
                    // One that cannot be read is made again, whatever the reason.
                    blocking(move || store.content_cage(&key)).await.ok()?.ok()?
                };
                let Enclosed { rest, cage, made } =
                    self.cage_maker.enclose(tenant, rest, vertices, room, stored).await?;
                (rest, cage, Some(made))
            }
        };
        Ok((Content { rest, cage, matrix }, made))
    }

    async fn designed_cage(&self, tenant: &str, id: &str) -> Result<NamedFile, ApiError> {
        let job = self.cage_jobs.find(tenant, id).map_err(|_| {
            refuse_cage(&format!("id: there is no cage design {:?}; list yours at /v1/cages", shortened(id)))
        })?;
        let store = self.store.clone();
        let bytes = blocking(move || job.completed_cage(&store)).await??;
        Ok(NamedFile { name: CAGE_NAME.to_owned(), bytes: bytes.to_vec() })
    }
}

fn shortened(id: &str) -> String {
    id.chars().take(80).collect()
}
