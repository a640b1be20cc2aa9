//! Settings from the command line.

use super::layers::Layers;
use super::{ConfigError, Origin};
use crate::telemetry::LogFormat;
use std::path::PathBuf;
use toml::Value;

/// Run the service: the jobs of this program over HTTP, for several users and programs at once.
///
/// Without access tokens it listens to this machine alone. Example: cager serve --data /srv/cager
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ServeFlags {
    /// Address and port to listen on [default: 127.0.0.1:8080].
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub listen: Option<String>,

    /// Address and port for operators: health, metrics, tenants, sessions of all [default: none; without a value 127.0.0.1:8081].
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8081")]
    pub admin_listen: Option<String>,

    /// Folder of sessions and prepared solvers [default: cager-data].
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,

    /// PostgreSQL database for what is known of sessions [default: a file in the data folder]. A password is safer in the variable CAGER_CATALOG.
    #[arg(long, value_name = "URL")]
    pub catalog: Option<String>,

    /// S3 bucket for files, s3://BUCKET/PATH [default: the data folder]. Needs --catalog; keys are in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY.
    #[arg(long, value_name = "URL")]
    pub blobs: Option<String>,

    /// File of settings, TOML.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,

    /// File of access tokens, TOML; needed on other than loopback addresses.
    #[arg(long, value_name = "FILE")]
    pub tokens: Option<PathBuf>,

    /// Certificate for TLS, PEM.
    #[arg(long, value_name = "FILE")]
    pub tls_certificate: Option<PathBuf>,

    /// Private key of the certificate, PEM.
    #[arg(long, value_name = "FILE")]
    pub tls_key: Option<PathBuf>,

    /// Form of log lines [default: human].
    #[arg(long, value_enum, value_name = "FORM")]
    pub log: Option<LogFormat>,

    /// Which log lines appear: error, warn, info, debug, or by module [default: info].
    #[arg(long, value_name = "FILTER")]
    pub log_filter: Option<String>,

    /// Threads that solve; 0 for one per processor [default: 0].
    #[arg(long, value_name = "N")]
    pub workers: Option<usize>,

    /// Any other setting, for example --set max_streams=64; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Print all settings and where they come from, and stop.
    #[arg(long)]
    pub check_config: bool,
}

impl ServeFlags {
    /// Lays the flags that were given on top. Named flags override `--set`.
    pub(super) fn add_to(&self, layers: &mut Layers) -> Result<(), ConfigError> {
        for text in &self.set {
            let Some((key, value)) = text.split_once('=') else {
                return Err(ConfigError::Set { text: text.clone() });
            };
            let key = key.trim().replace('-', "_");
            layers.add(&key, &Value::String(value.trim().to_owned()), Origin::Flag(format!("--set {key}")))?;
        }
        let path = |path: &Option<PathBuf>| path.as_ref().map(|path| path.to_string_lossy().into_owned());
        let named = [
            ("listen", self.listen.clone()),
            ("admin_listen", self.admin_listen.clone()),
            ("data", path(&self.data)),
            ("catalog", self.catalog.clone()),
            ("blobs", self.blobs.clone()),
            ("tokens", path(&self.tokens)),
            ("tls_certificate", path(&self.tls_certificate)),
            ("tls_key", path(&self.tls_key)),
            ("log", self.log.map(|log| log.name().to_owned())),
            ("log_filter", self.log_filter.clone()),
            ("workers", self.workers.map(|workers| workers.to_string())),
        ];
        for (key, value) in named {
            if let Some(value) = value {
                let flag = Origin::Flag(format!("--{}", key.replace('_', "-")));
                layers.add(key, &Value::String(value), flag)?;
            }
        }
        Ok(())
    }
}
