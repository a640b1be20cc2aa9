//! The files that settings name, looked at before the service starts.

use super::ServeConfig;
use crate::auth::Access;
use crate::http::listen::tls_config;
use crate::webhooks;
use anyhow::{Context as _, Result, bail};
use cager_formats::ScratchDir;
use cager_store::{Blobs, PostgresCatalog};
use rustix::fs::{Access as Right, access};
use std::path::Path;

impl ServeConfig {
    /// Reads the files that the service reads at its start, looks at the addresses of what it uses without asking there, and leaves everything as it was.
    ///
    /// # Errors
    /// One that cannot be used.
    pub fn check_files(&self) -> Result<()> {
        let tokens = Access::open(self.tokens.as_deref(), self.tenant_limits())?;
        if let Some(trust) = self.trust() {
            tokens.with_provider(trust)?;
        }
        if let Some(url) = &self.catalog {
            PostgresCatalog::check_address(url).context("catalog")?;
        }
        if let Some(url) = &self.blobs {
            Blobs::check_address(url, std::env::vars()).context("blobs")?;
        }
        check_folder("data", &self.data)?;
        if let Some(folder) = self.blobs.as_deref().and_then(|url| url.strip_prefix("file://")) {
            check_folder("blobs", Path::new(folder))?;
        }
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
        let written = if audit.exists() { audit } else { folder };
        access(written, Right::WRITE_OK).with_context(|| format!("audit: {}: cannot be written", audit.display()))
    }
}

/// Refuses what cannot be a folder to write into, or be made one.
fn check_folder(setting: &str, folder: &Path) -> Result<()> {
    let there = folder.ancestors().find(|path| path.exists()).unwrap_or(Path::new("."));
    if !there.is_dir() {
        bail!("{setting}: {}: {} is no folder; name another one", folder.display(), there.display());
    }
    let may = access(there, Right::WRITE_OK | Right::EXEC_OK);
    let refused = || format!("{setting}: {}: cannot be written by this user", folder.display());
    may.with_context(refused)?;
    // Some file systems refuse all the same what rights allow.
    if there != folder {
        ScratchDir::create(there).with_context(refused)?;
    }
    Ok(())
}
