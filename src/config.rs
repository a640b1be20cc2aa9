//! The service's settings: defaults, then a file, then the environment, then flags, each overriding the one before.

pub(crate) mod entries;
mod error;
mod flags;
mod layers;
mod settings;
mod show;
#[cfg(test)]
mod tests;

pub use entries::EntriesError;
pub use error::{ConfigError, Origin};
pub use flags::ServeFlags;
pub(crate) use layers::line_of;
pub(crate) use settings::bytes;

use crate::admission::Budget;
use crate::auth::{TenantLimits, Trust};
use crate::http::listen::{Limits, Tls};
use crate::telemetry::LogFormat;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

const KIB: u64 = 1 << 10;
const MIB: u64 = 1 << 20;
const GIB: u64 = 1 << 30;

/// Bytes of an upload beside rest pose and cage.
pub(crate) const ENVELOPE_BYTES: u64 = MIB;

/// Settings of the service. Names are those of the file's keys; in the environment they are in capitals after `CAGER_`.
/// Sizes in a file or the environment may be numbers or texts such as `"512 MiB"`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct ServeConfig {
    /// Address and port to listen on. Other than loopback addresses need tokens.
    pub listen: SocketAddr,
    /// Address and port for operators: on a loopback address what they see and do, elsewhere health and metrics.
    pub admin_listen: Option<SocketAddr>,
    /// Folder of sessions and prepared solvers; made if it is not there.
    pub data: PathBuf,
    /// File of access tokens; without one everyone on this machine is tenant `local`.
    pub tokens: Option<PathBuf>,
    /// Address of an OpenID Connect provider whose tokens are taken as well.
    pub oidc_issuer: Option<String>,
    /// What the provider's tokens for this service have in `aud`.
    pub oidc_audience: Option<String>,
    /// Address of the provider's key set, where its description does not say it.
    pub oidc_keys: Option<String>,
    /// The claim of the provider's tokens that names the tenant.
    pub oidc_tenant: String,
    /// File of addresses that are told when sessions are completed or fail.
    pub webhooks: Option<PathBuf>,
    /// PEM file of the certificate, for TLS.
    pub tls_certificate: Option<PathBuf>,
    /// PEM file of the certificate's private key.
    pub tls_key: Option<PathBuf>,
    /// Form of log lines: `human` or `json`.
    pub log: LogFormat,
    /// Which log lines appear: a level, or levels by module such as `info,cager::http=debug`.
    pub log_filter: String,
    /// Threads that solve; 0 for one per processor.
    pub workers: usize,
    /// Bytes of prepared solvers kept in memory.
    pub cache_bytes: u64,
    /// Bytes of prepared solvers kept on disk.
    pub prepared_disk_bytes: u64,
    /// Bytes of frames held in memory between arrival and disk, all streams together.
    pub frame_bytes: u64,
    /// Bytes of rest poses and cages held in memory while sessions are created, all together.
    pub upload_bytes: u64,
    /// Memory for downloads on their way to slow clients, in bytes.
    pub download_bytes: u64,
    /// Disk space for cages that wait to be decoded, in bytes.
    pub spool_bytes: u64,
    /// Bytes of one rest pose or cage.
    pub max_rest_bytes: u64,
    /// Connections that are served; a few more get health and otherwise 503.
    pub max_connections: usize,
    /// Requests at work.
    pub max_requests: usize,
    /// Frame, cage, event and decode streams at work.
    pub max_streams: usize,
    /// Sessions prepared at the same time.
    pub max_preparing: usize,
    /// Names by which a service without tokens may be asked, beside `localhost` and addresses.
    pub allowed_hosts: Vec<String>,
    /// Origins of pages that may ask, beside the service's own.
    pub allowed_origins: Vec<String>,
    /// Memory that preparing one session may take, in bytes; larger ones are refused.
    pub max_prepare_bytes: u64,
    /// Sessions waiting to be prepared.
    pub max_prepare_queue: usize,
    /// Cages designed at the same time.
    pub max_designs: usize,
    /// Cage designs of a tenant waiting for their turn.
    pub max_design_queue: usize,
    /// Seconds that a design may take; then the best cage so far is the result.
    pub max_design_seconds: u64,
    /// Memory that the frames of one design may take, in bytes: so many of those that were sent are looked at.
    pub max_design_bytes: u64,
    /// Bytes of the frames that a cage is designed from.
    pub max_frames_bytes: u64,
    /// Frames waiting to be solved.
    pub max_queue_frames: usize,
    /// Seconds for a request's header to arrive.
    pub header_timeout_s: u64,
    /// Seconds that a request body may pause.
    pub body_timeout_s: u64,
    /// Seconds that a connection without requests stays open.
    pub idle_timeout_s: u64,
    /// Seconds in which a response's reader may take nothing.
    pub write_timeout_s: u64,
    /// Seconds for a request that is not a stream.
    pub request_timeout_s: u64,
    /// Seconds for open requests after a stop signal.
    pub drain_timeout_s: u64,
    /// Bytes of a request's header.
    pub max_header_bytes: usize,
    /// Sessions of a tenant, where its token says nothing else.
    pub tenant_max_sessions: u64,
    /// Bytes of a tenant's sessions on disk, where its token says nothing else.
    pub tenant_max_bytes: u64,
    /// Seconds after which a tenant's sessions are deleted, where its token says nothing else; 0 for never.
    pub tenant_max_age_s: u64,
    /// Streams of a tenant at work, where its token says nothing else.
    pub tenant_max_streams: u64,
    /// Where each setting that is not a default came from.
    #[serde(skip)]
    pub origins: BTreeMap<String, Origin>,
}

impl Default for ServeConfig {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 8080)),
            admin_listen: None,
            data: PathBuf::from("cager-data"),
            tokens: None,
            oidc_issuer: None,
            oidc_audience: None,
            oidc_keys: None,
            oidc_tenant: "tenant".to_owned(),
            webhooks: None,
            tls_certificate: None,
            tls_key: None,
            allowed_hosts: Vec::new(),
            allowed_origins: Vec::new(),
            log: LogFormat::Human,
            log_filter: "info".to_owned(),
            workers: 0,
            cache_bytes: 2 * GIB,
            prepared_disk_bytes: 20 * GIB,
            frame_bytes: 256 * MIB,
            upload_bytes: GIB,
            download_bytes: 128 * MIB,
            spool_bytes: 2 * GIB,
            max_rest_bytes: 512 * MIB,
            max_connections: 1024,
            max_requests: 512,
            max_streams: 256,
            max_preparing: 2,
            max_prepare_bytes: 8 * GIB,
            max_prepare_queue: 64,
            max_designs: 1,
            max_design_queue: 16,
            max_design_seconds: 120,
            max_design_bytes: 512 * MIB,
            max_frames_bytes: 4 * GIB,
            max_queue_frames: 4096,
            header_timeout_s: 10,
            body_timeout_s: 30,
            idle_timeout_s: 75,
            write_timeout_s: 300,
            request_timeout_s: 60,
            drain_timeout_s: 20,
            max_header_bytes: 32 << 10,
            tenant_max_sessions: 1000,
            tenant_max_bytes: 100 * GIB,
            tenant_max_age_s: 0,
            tenant_max_streams: 64,
            origins: BTreeMap::new(),
        }
    }
}

impl ServeConfig {
    /// Puts the settings together. `env` may be the whole environment; `file` overrides the flag `--config` and `CAGER_CONFIG`
    /// where it is given. Relative paths in the file are relative to the file.
    ///
    /// # Errors
    /// A file that cannot be read, unknown keys, values that are not possible, and combinations that are unsafe.
    pub fn load(
        file: Option<&Path>,
        env: impl Iterator<Item = (String, String)>,
        flags: &ServeFlags,
    ) -> Result<Self, ConfigError> {
        let mut layers = layers::Layers::default();
        let env: Vec<_> = env.filter(|(name, _)| name.starts_with(layers::ENVIRONMENT)).collect();
        let from_env = env.iter().find(|(name, _)| name == "CAGER_CONFIG").map(|(_, path)| Path::new(path));
        if let Some(file) = file.or(flags.config.as_deref()).or(from_env) {
            layers.add_file(file)?;
        }
        layers.add_environment(&env)?;
        flags.add_to(&mut layers)?;
        let config = layers.build()?;
        config.check()?;
        Ok(config)
    }

    /// Refuses combinations that cannot work or are not safe.
    fn check(&self) -> Result<(), ConfigError> {
        if !self.is_guarded() && !self.listen.ip().is_loopback() {
            return Err(ConfigError::Open { listen: self.listen });
        }
        let (upload_bytes, max_rest_bytes) = (self.upload_bytes, self.max_rest_bytes);
        // Of what tenants share, one gets two thirds.
        let fits = match self.is_guarded() {
            true => upload_bytes / 3 * 2 >= max_rest_bytes + ENVELOPE_BYTES,
            false => upload_bytes >= max_rest_bytes,
        };
        if !fits {
            return Err(ConfigError::UploadRoom { upload_bytes, max_rest_bytes });
        }
        let pairs = [
            ("tls_certificate", self.tls_certificate.is_some(), "tls_key", self.tls_key.is_some()),
            ("oidc_issuer", self.oidc_issuer.is_some(), "oidc_audience", self.oidc_audience.is_some()),
        ];
        for (a, has_a, b, has_b) in pairs {
            if has_a != has_b {
                let (given, missing) = if has_a { (a, b) } else { (b, a) };
                return Err(ConfigError::Half { given, missing });
            }
        }
        if self.oidc_keys.is_some() && self.oidc_issuer.is_none() {
            return Err(ConfigError::Half { given: "oidc_keys", missing: "oidc_issuer" });
        }
        Ok(())
    }

    /// Whether requests need tokens.
    fn is_guarded(&self) -> bool {
        self.tokens.is_some() || self.oidc_issuer.is_some()
    }

    /// The provider of tokens that is trusted, if one is.
    pub fn trust(&self) -> Option<Trust> {
        Some(Trust {
            issuer: self.oidc_issuer.clone()?,
            audience: self.oidc_audience.clone()?,
            keys: self.oidc_keys.clone(),
            tenant: self.oidc_tenant.clone(),
        })
    }

    /// A budget of so much that tenants share: where tokens name them, none gets all of it.
    pub(crate) fn budget(&self, total: u64) -> Arc<Budget> {
        Budget::new(total, self.is_guarded())
    }

    /// The listener's limits.
    pub fn limits(&self) -> Limits {
        Limits {
            header_timeout: Duration::from_secs(self.header_timeout_s),
            body_timeout: Duration::from_secs(self.body_timeout_s),
            idle_timeout: Duration::from_secs(self.idle_timeout_s),
            write_timeout: Duration::from_secs(self.write_timeout_s),
            drain_timeout: Duration::from_secs(self.drain_timeout_s),
            max_connections: self.max_connections,
            max_header_bytes: self.max_header_bytes,
            ..Limits::default()
        }
    }

    /// Certificate and key, if TLS is wanted.
    pub fn tls(&self) -> Option<Tls> {
        Some(Tls { certificate: self.tls_certificate.clone()?, key: self.tls_key.clone()? })
    }

    /// Limits of tenants whose tokens say nothing else.
    pub fn tenant_limits(&self) -> TenantLimits {
        TenantLimits {
            max_sessions: self.tenant_max_sessions,
            max_bytes: self.tenant_max_bytes,
            max_age_s: self.tenant_max_age_s,
            max_streams: self.tenant_max_streams,
        }
    }

    /// Threads that solve: the setting, or one per processor.
    pub fn worker_threads(&self) -> usize {
        match self.workers {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            workers => workers,
        }
    }
}
