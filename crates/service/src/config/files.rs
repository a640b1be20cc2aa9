//! The files that settings name, looked at before the service starts.

use super::ServeConfig;
use crate::auth::Access;
use crate::http::listen::tls_config;
use crate::webhooks;
use anyhow::{Context as _, Result, bail};
use std::path::Path;

impl ServeConfig {
    /// Reads the files that the service reads at its start, and changes nothing.
    ///
    /// # Errors
    /// One that cannot be used.
    pub fn check_files(&self) -> Result<()> {
        Access::open(self.tokens.as_deref(), self.tenant_limits())?;
        if let Some(file) = &self.webhooks {
            webhooks::check(file)?;
        }
        if let Some(tls) = self.tls() {
            tls_config(&tls)?;
        }
        let Some(audit) = &self.audit else { return Ok(()) };
        let folder = audit.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let there =
            std::fs::metadata(folder).with_context(|| format!("audit: {}: cannot be written", audit.display()))?;
        if !there.is_dir() || audit.is_dir() {
            bail!("audit: {}: is no file in a folder; name one", audit.display());
        }
        Ok(())
    }
}
