//! Names of sessions, which can be changed.

use super::Session;
use crate::preparation::check_told;
use crate::problem::ApiError;
use crate::store::{SessionMeta, StoreError};
use crate::sync::lock;
use crate::tasks::blocking;
use std::sync::Arc;

/// The name that was given last.
pub(super) fn name_of(meta: &SessionMeta) -> Option<String> {
    meta.renamed.as_ref().or(meta.options.name.as_ref()).filter(|name| !name.is_empty()).cloned()
}

impl Session {
    /// What it is called.
    pub(crate) fn name(&self) -> Option<String> {
        lock(&self.name).clone()
    }

    /// Gives it another name, for good; an empty name removes it. Options stay as they were sent.
    ///
    /// # Errors
    /// A name that is too long, a session that was deleted, and those of the store.
    pub(crate) async fn rename(self: &Arc<Self>, name: String) -> Result<(), ApiError> {
        check_told(Some(&name), None, None)?;
        let session = Arc::clone(self);
        blocking(move || session.write_name(name)).await?
    }

    /// What was stored, with the name: what is in memory has the options that an earlier version meant. Blocks.
    fn write_name(&self, name: String) -> Result<(), ApiError> {
        let failed = |error: StoreError| self.storage_error(error);
        let _alone = lock(&self.renaming);
        let stored = self.store.reload_meta::<SessionMeta>(&self.meta.id).map_err(failed)?;
        let meta = SessionMeta { renamed: Some(name), ..stored.ok_or_else(super::gone)? };
        self.store.change_session(&meta).map_err(failed)?;
        *lock(&self.name) = name_of(&meta);
        self.touch();
        Ok(())
    }
}
