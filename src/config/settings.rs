//! What each setting may be, and how the layers of settings lie on each other.

use super::{GIB, KIB, MIB, ServeConfig};
use std::collections::BTreeMap;
use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// What names of environment variables begin with.
pub(super) const ENVIRONMENT: &str = "CAGER_";
/// Variables that are not settings of the service: the file itself, and those of the client commands.
const OTHER_VARIABLES: [&str; 3] = ["config", "token", "server"];
const DAY: u64 = 86_400;

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
    #[error("{}: cannot be read: {source}; name another file with --config", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
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
    /// One half of what TLS needs.
    #[error("{given} is set but {missing} is not; TLS needs both")]
    HalfTls {
        /// What is there.
        given: &'static str,
        /// What is not.
        missing: &'static str,
    },
}

/// What a setting may be.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Address,
    File,
    Format,
    Filter,
    Number { least: u64, most: u64 },
    Bytes { least: u64, most: u64 },
}

/// Every setting, in the order in which it is shown.
const SETTINGS: &[(&str, Kind)] = &[
    ("listen", Kind::Address),
    ("data", Kind::File),
    ("tokens", Kind::File),
    ("tls_certificate", Kind::File),
    ("tls_key", Kind::File),
    ("log", Kind::Format),
    ("log_filter", Kind::Filter),
    ("workers", Kind::Number { least: 0, most: 4096 }),
    ("cache_bytes", Kind::Bytes { least: 0, most: 1 << 50 }),
    ("prepared_disk_bytes", Kind::Bytes { least: 0, most: 1 << 50 }),
    ("frame_bytes", Kind::Bytes { least: MIB, most: 1 << 50 }),
    ("upload_bytes", Kind::Bytes { least: MIB, most: 1 << 50 }),
    ("max_rest_bytes", Kind::Bytes { least: KIB, most: 16 * GIB }),
    ("max_connections", Kind::Number { least: 1, most: 1_000_000 }),
    ("max_requests", Kind::Number { least: 1, most: 1_000_000 }),
    ("max_streams", Kind::Number { least: 1, most: 1_000_000 }),
    ("max_preparing", Kind::Number { least: 1, most: 4096 }),
    ("max_prepare_queue", Kind::Number { least: 0, most: 1_000_000 }),
    ("max_queue_frames", Kind::Number { least: 16, most: 1 << 30 }),
    ("header_timeout_s", Kind::Number { least: 1, most: DAY }),
    ("body_timeout_s", Kind::Number { least: 1, most: DAY }),
    ("idle_timeout_s", Kind::Number { least: 1, most: DAY }),
    ("write_timeout_s", Kind::Number { least: 1, most: DAY }),
    ("request_timeout_s", Kind::Number { least: 1, most: DAY }),
    ("drain_timeout_s", Kind::Number { least: 0, most: DAY }),
    ("max_header_bytes", Kind::Bytes { least: KIB, most: MIB }),
    ("tenant_max_sessions", Kind::Number { least: 1, most: 1 << 40 }),
    ("tenant_max_bytes", Kind::Bytes { least: MIB, most: 1 << 60 }),
    ("tenant_max_age_s", Kind::Number { least: 0, most: 1 << 40 }),
    ("tenant_max_streams", Kind::Number { least: 1, most: 1_000_000 }),
];

/// Names of all settings, in the order in which they are shown.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SETTINGS.iter().map(|(name, _)| *name)
}

/// Whether sizes may be given in units.
pub(super) fn is_bytes(name: &str) -> bool {
    SETTINGS.iter().any(|(known, kind)| *known == name && matches!(kind, Kind::Bytes { .. }))
}

impl Kind {
    /// The value as the configuration wants it, or what would be possible.
    fn read(self, value: &Value) -> Result<Value, String> {
        let text = value.as_str();
        match self {
            Self::Address => {
                let text = text.map(|text| text.replace("localhost:", "127.0.0.1:"));
                let address = text.as_deref().and_then(|text| text.parse::<SocketAddr>().ok());
                let why = "write ADDRESS:PORT, for example 127.0.0.1:8080 or [::1]:8080";
                address.map(|address| Value::String(address.to_string())).ok_or_else(|| why.to_owned())
            }
            Self::File => match text {
                None | Some("") => Err("write the path of a file or folder, in quotation marks".to_owned()),
                Some(text) => Ok(Value::String(text.to_owned())),
            },
            Self::Format => match text {
                Some("human" | "json") => Ok(value.clone()),
                _ => Err("write \"human\" or \"json\"".to_owned()),
            },
            Self::Filter => {
                let wrong = |why: String| format!("{why}; write a level such as info, or info,cager::http=debug");
                let text = text.ok_or_else(|| wrong("not a text".to_owned()))?;
                match tracing_subscriber::EnvFilter::try_new(text) {
                    Ok(_) => Ok(value.clone()),
                    Err(error) => Err(wrong(error.to_string())),
                }
            }
            Self::Number { least, most } => {
                let number = value.as_integer().or_else(|| text?.trim().parse().ok());
                let number = number.and_then(|number| u64::try_from(number).ok());
                in_range(number, least, most).ok_or_else(|| format!("write a whole number from {least} to {most}"))
            }
            Self::Bytes { least, most } => {
                let number = match text {
                    Some(text) => bytes(text),
                    None => value.as_integer().and_then(|number| u64::try_from(number).ok()),
                };
                in_range(number, least, most).ok_or_else(|| {
                    let (least, most) = (show_bytes(least), show_bytes(most));
                    format!("write a size from {least} to {most}: a number of bytes, or a text such as \"512 MiB\"")
                })
            }
        }
    }
}

fn in_range(number: Option<u64>, least: u64, most: u64) -> Option<Value> {
    let number = number.filter(|number| (least..=most).contains(number))?;
    i64::try_from(number).ok().map(Value::Integer)
}

/// A size: digits and, after an optional space, a unit.
fn bytes(text: &str) -> Option<u64> {
    let text = text.trim();
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '_').unwrap_or(text.len());
    let number: u64 = text[..end].replace('_', "").parse().ok()?;
    let unit = match text[end..].trim() {
        "" | "B" => 1,
        "kB" | "KB" => 1000,
        "MB" => 1_000_000,
        "GB" => 1_000_000_000,
        "TB" => 1_000_000_000_000,
        "KiB" => KIB,
        "MiB" => MIB,
        "GiB" => GIB,
        "TiB" => GIB << 10,
        _ => return None,
    };
    number.checked_mul(unit)
}

/// A size in the largest unit in which it is whole.
pub(super) fn show_bytes(number: u64) -> String {
    let units = [(GIB << 10, "TiB"), (GIB, "GiB"), (MIB, "MiB"), (KIB, "KiB")];
    let unit = units.into_iter().find(|(size, _)| number >= *size && number.is_multiple_of(*size));
    unit.map_or_else(|| format!("{number} B"), |(size, unit)| format!("{} {unit}", number / size))
}

/// Settings on their way to a configuration; what is added later lies on top.
#[derive(Debug, Default)]
pub(super) struct Layers {
    values: Table,
    origins: BTreeMap<String, Origin>,
}

impl Layers {
    pub(super) fn add_file(&mut self, file: &Path) -> Result<(), ConfigError> {
        let read = |source| ConfigError::Read { file: file.to_owned(), source };
        let text = std::fs::read_to_string(file).map_err(read)?;
        let table: Table = text.parse().map_err(|error: toml::de::Error| {
            let line = line_of(&text, error.span().map_or(0, |span| span.start));
            ConfigError::Syntax { file: file.to_owned(), line, why: error.message().to_owned() }
        })?;
        let folder = file.parent().unwrap_or(Path::new(""));
        for (key, value) in &table {
            self.add(key, value, Origin::File(file.to_owned()))?;
            if SETTINGS.iter().any(|(name, kind)| name == key && matches!(kind, Kind::File))
                && let Some(path) = value.as_str()
            {
                // Relative to the file, so that it means the same wherever the service is started. `join` keeps absolute paths.
                let path = folder.join(path).to_string_lossy().into_owned();
                self.values.insert(key.clone(), Value::String(path));
            }
        }
        Ok(())
    }

    pub(super) fn add_environment(&mut self, variables: &[(String, String)]) -> Result<(), ConfigError> {
        for (name, value) in variables {
            let key = name.trim_start_matches(ENVIRONMENT).to_lowercase();
            let known = names().any(|known| known == key);
            // Others set variables with this prefix too, Kubernetes for a service named so: only near misses are mistakes.
            if known || (!OTHER_VARIABLES.contains(&key.as_str()) && near(&key).is_some()) {
                self.add(&key, &Value::String(value.clone()), Origin::Environment(name.clone()))?;
            }
        }
        Ok(())
    }

    pub(super) fn add(&mut self, key: &str, value: &Value, origin: Origin) -> Result<(), ConfigError> {
        let Some((name, kind)) = SETTINGS.iter().find(|(name, _)| *name == key) else {
            let hint = near(key).map(|name| format!(", did you mean {name}?")).unwrap_or_default();
            return Err(ConfigError::Unknown { origin, key: key.to_owned(), hint });
        };
        let value = kind.read(value).map_err(|why| ConfigError::Value {
            origin: origin.clone(),
            key: key.to_owned(),
            value: super::show::value(value),
            why,
        })?;
        self.values.insert((*name).to_owned(), value);
        self.origins.insert((*name).to_owned(), origin);
        Ok(())
    }

    pub(super) fn build(self) -> Result<ServeConfig, ConfigError> {
        let config: Result<ServeConfig, _> = self.values.try_into();
        // Each value was checked, so this says that the table above and the struct do not agree.
        let mut config = config.map_err(|error: toml::de::Error| ConfigError::Syntax {
            file: PathBuf::from("settings"),
            line: 1,
            why: error.message().to_owned(),
        })?;
        config.origins = self.origins;
        Ok(config)
    }
}

/// The line of a place in a text, from 1.
pub(crate) fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count()
}

/// The setting that was probably meant.
fn near(key: &str) -> Option<&'static str> {
    let key = key.replace('-', "_");
    let (distance, name) = names().map(|name| (distance(&key, name), name)).min()?;
    (distance <= 2 && distance < key.len() / 2).then_some(name)
}

/// Number of letters to insert, delete or change.
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.bytes().enumerate() {
            let changed = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
