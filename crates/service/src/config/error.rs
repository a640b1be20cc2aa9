//! Where settings come from, and why they cannot be used.

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Where a setting came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A configuration file.
    File(PathBuf),
    /// An environment variable.
    Environment(String),
    /// A flag of the command line.
    Flag(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "file {}", path.display()),
            Self::Environment(name) => write!(f, "environment {name}"),
            Self::Flag(flag) => write!(f, "flag {flag}"),
        }
    }
}

/// Why settings cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {why}; name another file with --config", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        why: std::io::Error,
    },
    /// The file is not TOML.
    #[error("{}: line {line}: {why}", file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong there.
        why: String,
    },
    /// No setting has this name.
    #[error("{origin}: unknown setting {key}{hint}; --check-config shows all settings")]
    Unknown {
        /// Where it stands.
        origin: Origin,
        /// The name.
        key: String,
        /// A name like it.
        hint: String,
    },
    /// The value is not possible.
    #[error("{origin}: {key} = {value}: {why}")]
    Value {
        /// Where it stands.
        origin: Origin,
        /// The setting.
        key: String,
        /// What was given.
        value: String,
        /// What would be possible.
        why: String,
    },
    /// A generic flag that is not `key=value`.
    #[error("--set {text}: write --set KEY=VALUE, for example --set max_streams=64")]
    Set {
        /// What was given.
        text: String,
    },
    /// An address that others can reach, without tokens.
    #[error(
        "listening on {listen} lets everyone in; listen on 127.0.0.1, or create a tokens file and name it with --tokens: \
         T=$(openssl rand -hex 32); printf '[[token]]\\nname = \"me\"\\ntenant = \"me\"\\nsha256 = \"%s\"\\n' \"$(printf %s \"$T\" | \
         sha256sum | cut -c1-64)\" > tokens.toml; clients then send the header Authorization: Bearer $T"
    )]
    Open {
        /// The address.
        listen: SocketAddr,
    },
    /// Two listeners at one address.
    #[error("listen and admin_listen are both {listen}; give the operators' listener another port")]
    SamePort {
        /// The address.
        listen: SocketAddr,
    },
    /// A model of the largest size would never find room.
    #[error(
        "upload_bytes is {upload_bytes}, of which one of several tenants gets two thirds, so a model of max_rest_bytes, {max_rest_bytes}, would never find room; raise the one or lower the other"
    )]
    UploadRoom {
        /// Memory for uploads of models.
        upload_bytes: u64,
        /// Largest model.
        max_rest_bytes: u64,
    },
    /// One of two settings that need each other.
    #[error("{given} is set but {missing} is not; set both or neither")]
    Half {
        /// What is there.
        given: &'static str,
        /// What is not.
        missing: &'static str,
    },
}
