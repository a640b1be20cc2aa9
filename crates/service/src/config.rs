//! The service's settings: defaults, then a file, then the environment, then flags, each overriding the one before.

pub(crate) mod entries;
mod error;
mod files;
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
use settings::SettingKind;

use crate::admission::Budget;
use crate::auth::{OidcSettings, TenantLimits};
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
const DAY: u64 = 86_400;

/// Bytes of an upload beside rest pose and cage.
pub(crate) const MULTIPART_OVERHEAD_BYTES: u64 = MIB;

/// Makes the settings' struct, defaults and bounds of one list.
macro_rules! settings {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $default:expr, $kind:expr;)*) => {
        /// Settings of the service. Names are those of the file's keys; in the environment they are in capitals after `CAGER_`.
        /// Sizes in a file or the environment may be numbers or texts such as `"512 MiB"`.
        #[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct ServeConfig {
            $($(#[$doc])* pub $name: $type,)*
            /// Where each setting that is not a default came from.
            #[serde(skip)]
            pub origins: BTreeMap<String, Origin>,
        }

        impl Default for ServeConfig {
            fn default() -> Self {
                Self { $($name: $default,)* origins: BTreeMap::new() }
            }
        }

        /// What each setting may be, in the order in which they are shown.
        const SETTINGS: &[(&str, SettingKind)] = &[$((stringify!($name), $kind),)*];
    };
}

settings! {
    /// Address and port to listen on. Other than loopback addresses need tokens.
    listen: SocketAddr = SocketAddr::from((Ipv4Addr::LOCALHOST, 8080)), SettingKind::Address;
    /// Address and port for operators: on a loopback address what they see and do, elsewhere health and metrics.
    admin_listen: Option<SocketAddr> = None, SettingKind::Address;
    /// Folder of sessions and prepared solvers; made if it is not there.
    data: PathBuf = PathBuf::from("cager-data"), SettingKind::File;
    /// Address of a PostgreSQL database for what is known of sessions, `postgres://USER:PASSWORD@HOST:5432/DATABASE`; without one it is in a file in the data
    /// folder.
    catalog: Option<String> = None, SettingKind::Secret;
    /// Address of an S3 bucket for files, `s3://BUCKET/PATH`, with keys and endpoint in the variables `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`,
    /// `AWS_ENDPOINT_URL` and `AWS_REGION`; the data folder is a cache of it then. Needs `catalog`.
    blobs: Option<String> = None, SettingKind::Text;
    /// Bytes of the bucket's files kept in the data folder.
    blobs_kept_bytes: u64 = 64 * GIB, SettingKind::Bytes { least: 0, most: 1 << 50 };
    /// File of access tokens; without one everyone on this machine is tenant `local`.
    tokens: Option<PathBuf> = None, SettingKind::File;
    /// Address of an OpenID Connect provider whose tokens are taken as well.
    oidc_issuer: Option<String> = None, SettingKind::Text;
    /// What the provider's tokens for this service have in `aud`.
    oidc_audience: Option<String> = None, SettingKind::Text;
    /// Address of the provider's key set, where its description does not say it.
    oidc_keys: Option<String> = None, SettingKind::Text;
    /// The claim of the provider's tokens that names the tenant.
    oidc_tenant: String = "tenant".to_owned(), SettingKind::Text;
    /// File of addresses that are told when sessions are completed or fail.
    webhooks: Option<PathBuf> = None, SettingKind::File;
    /// File that says who changed what, a line of JSON for each change; without it nothing does.
    audit: Option<PathBuf> = None, SettingKind::File;
    /// PEM file of the certificate, for TLS.
    tls_certificate: Option<PathBuf> = None, SettingKind::File;
    /// PEM file of the certificate's private key.
    tls_key: Option<PathBuf> = None, SettingKind::File;
    /// Names by which a service without tokens may be asked, beside `localhost` and addresses.
    allowed_hosts: Vec<String> = Vec::new(), SettingKind::Hosts;
    /// Origins of pages that may ask, beside the service's own.
    allowed_origins: Vec<String> = Vec::new(), SettingKind::Origins;
    /// Form of log lines: `human` or `json`.
    log: LogFormat = LogFormat::Human, SettingKind::Format;
    /// Which log lines appear: a level, or levels by module such as `info,cager_service::http=debug`.
    log_filter: String = "info".to_owned(), SettingKind::Filter;
    /// Threads that solve; 0 for one per processor.
    workers: usize = 0, SettingKind::Number { least: 0, most: 4096 };
    /// Bytes of prepared solvers kept in memory.
    cache_bytes: u64 = 2 * GIB, SettingKind::Bytes { least: 0, most: 1 << 50 };
    /// Bytes of prepared solvers kept on disk.
    prepared_disk_bytes: u64 = 20 * GIB, SettingKind::Bytes { least: 0, most: 1 << 50 };
    /// Bytes of frames held in memory between arrival and disk, all streams together.
    frame_bytes: u64 = 256 * MIB, SettingKind::Bytes { least: MIB, most: 1 << 50 };
    /// Bytes of rest poses and cages held in memory while sessions are created, all together.
    upload_bytes: u64 = GIB, SettingKind::Bytes { least: MIB, most: 1 << 50 };
    /// Memory for downloads on their way to slow clients, in bytes.
    download_bytes: u64 = 128 * MIB, SettingKind::Bytes { least: MIB, most: 1 << 50 };
    /// Disk space for cages that wait to be decoded, in bytes.
    spool_bytes: u64 = 2 * GIB, SettingKind::Bytes { least: MIB, most: 1 << 50 };
    /// Bytes of one rest pose or cage.
    max_rest_bytes: u64 = 512 * MIB, SettingKind::Bytes { least: KIB, most: 16 * GIB };
    /// Connections that are served; a few more get health and otherwise 503.
    max_connections: usize = 1024, SettingKind::Number { least: 1, most: 1_000_000 };
    /// Connections of one address that have shown no token; 0 for a quarter of `max_connections`. Without tokens they are not counted.
    max_connections_per_address: usize = 0, SettingKind::Number { least: 0, most: 1_000_000 };
    /// Requests at work.
    max_requests: usize = 512, SettingKind::Number { least: 1, most: 1_000_000 };
    /// Frame, cage, event and decode streams at work.
    max_streams: usize = 256, SettingKind::Number { least: 1, most: 1_000_000 };
    /// Sessions prepared at the same time.
    max_preparing: usize = 2, SettingKind::Number { least: 1, most: 4096 };
    /// Memory that preparing one session may take, in bytes; larger ones are refused.
    max_prepare_bytes: u64 = 8 * GIB, SettingKind::Bytes { least: MIB, most: 1 << 50 };
    /// Sessions waiting to be prepared.
    max_prepare_queue: usize = 64, SettingKind::Number { least: 0, most: 1_000_000 };
    /// Cages designed at the same time.
    max_designs: usize = 1, SettingKind::Number { least: 1, most: 4096 };
    /// Cage designs of a tenant waiting for their turn.
    max_design_queue: usize = 16, SettingKind::Number { least: 0, most: 1_000_000 };
    /// Seconds that a design may take; then the best cage so far is the result.
    max_design_seconds: u64 = 120, SettingKind::Number { least: 1, most: DAY };
    /// Recoveries that follow frames at the same time.
    max_recoveries: usize = 1, SettingKind::Number { least: 1, most: 4096 };
    /// Recoveries of a tenant whose frames wait for their turn; then no new one is taken.
    max_recovery_queue: usize = 64, SettingKind::Number { least: 0, most: 1_000_000 };
    /// Transfers that run at the same time.
    max_transfers: usize = 1, SettingKind::Number { least: 1, most: 4096 };
    /// Transfers of a tenant waiting for their turn.
    max_transfer_queue: usize = 16, SettingKind::Number { least: 0, most: 1_000_000 };
    /// Memory of shape spaces, in bytes.
    shape_bytes: u64 = GIB, SettingKind::Bytes { least: MIB, most: 1 << 50 };
    /// Seconds without a request after which a shape space is forgotten.
    shape_idle_s: u64 = 900, SettingKind::Number { least: 1, most: DAY };
    /// Memory that the frames of one design may take, in bytes: so many of those that were sent are looked at.
    max_design_bytes: u64 = 512 * MIB, SettingKind::Bytes { least: MIB, most: 1 << 50 };
    /// Bytes of the frames that a cage is designed from.
    max_frames_bytes: u64 = 4 * GIB, SettingKind::Bytes { least: KIB, most: 1 << 50 };
    /// Frames waiting to be solved.
    max_queue_frames: usize = 4096, SettingKind::Number { least: 16, most: 1 << 30 };
    /// Seconds for a request's header to arrive.
    header_timeout_s: u64 = 10, SettingKind::Number { least: 1, most: DAY };
    /// Seconds that a request body may pause.
    body_timeout_s: u64 = 30, SettingKind::Number { least: 1, most: DAY };
    /// Seconds that a connection without requests stays open.
    idle_timeout_s: u64 = 75, SettingKind::Number { least: 1, most: DAY };
    /// Seconds in which a response's reader may take nothing.
    write_timeout_s: u64 = 300, SettingKind::Number { least: 1, most: DAY };
    /// Seconds for a request that is not a stream.
    request_timeout_s: u64 = 60, SettingKind::Number { least: 1, most: DAY };
    /// Seconds for open requests after a stop signal.
    drain_timeout_s: u64 = 20, SettingKind::Number { least: 0, most: DAY };
    /// Bytes of a request's header.
    max_header_bytes: usize = 32 << 10, SettingKind::Bytes { least: KIB, most: MIB };
    /// Sessions of a tenant, where its token says nothing else.
    tenant_max_sessions: u64 = 1000, SettingKind::Number { least: 1, most: 1 << 40 };
    /// Bytes of a tenant's sessions on disk, where its token says nothing else.
    tenant_max_bytes: u64 = 100 * GIB, SettingKind::Bytes { least: MIB, most: 1 << 60 };
    /// Seconds after which a tenant's sessions are deleted, where its token says nothing else; 0 for never.
    tenant_max_age_s: u64 = 0, SettingKind::Number { least: 0, most: 1 << 40 };
    /// Streams of a tenant at work, where its token says nothing else.
    tenant_max_streams: u64 = 64, SettingKind::Number { least: 1, most: 1_000_000 };
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
        let config = Self::put_together(file, env, flags)?;
        config.check()?;
        Ok(config)
    }

    /// As [`Self::load`], for who only looks at what is stored: it is not asked who may use the service.
    ///
    /// # Errors
    /// As there.
    pub fn load_stored(
        file: Option<&Path>,
        env: impl Iterator<Item = (String, String)>,
        flags: &ServeFlags,
    ) -> Result<Self, ConfigError> {
        let config = Self::put_together(file, env, flags)?;
        config.check_stored()?;
        Ok(config)
    }

    fn put_together(
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
        layers.build()
    }

    /// Refuses combinations that cannot work or are not safe.
    fn check(&self) -> Result<(), ConfigError> {
        if !self.is_guarded() && !self.listen.ip().is_loopback() {
            return Err(ConfigError::Open { listen: self.listen });
        }
        let (upload_bytes, max_rest_bytes) = (self.upload_bytes, self.max_rest_bytes);
        // Of what tenants share, one gets two thirds.
        let fits = match self.is_guarded() {
            true => upload_bytes / 3 * 2 >= max_rest_bytes + MULTIPART_OVERHEAD_BYTES,
            false => upload_bytes >= max_rest_bytes,
        };
        if !fits {
            return Err(ConfigError::UploadRoom { upload_bytes, max_rest_bytes });
        }
        if self.listen.port() > 0 && self.admin_listen == Some(self.listen) {
            return Err(ConfigError::SamePort { listen: self.listen });
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
        self.check_stored()?;
        if self.oidc_keys.is_some() && self.oidc_issuer.is_none() {
            return Err(ConfigError::Half { given: "oidc_keys", missing: "oidc_issuer" });
        }
        Ok(())
    }

    /// Refuses places where nothing can be stored.
    fn check_stored(&self) -> Result<(), ConfigError> {
        if self.blobs.is_some() && self.catalog.is_none() {
            return Err(ConfigError::Half { given: "blobs", missing: "catalog" });
        }
        Ok(())
    }

    /// Whether requests need tokens.
    fn is_guarded(&self) -> bool {
        self.tokens.is_some() || self.oidc_issuer.is_some()
    }

    /// The provider of tokens that is trusted, if one is.
    pub fn trust(&self) -> Option<OidcSettings> {
        Some(OidcSettings {
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
            // What waits for a slow reader takes from nobody where there is one tenant.
            paced_readers: self.is_guarded(),
            max_per_address: match self.max_connections_per_address {
                _ if !self.is_guarded() => usize::MAX,
                0 => (self.max_connections / 4).max(1),
                most => most,
            },
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
