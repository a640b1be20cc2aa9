//! How the layers of settings lie on each other.

use super::settings::{is_file, is_secret, names, near, read};
use super::{ConfigError, Origin, ServeConfig};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// What names of environment variables begin with.
pub(super) const ENVIRONMENT: &str = "CAGER_";
/// Variables that are not settings of the service: the file itself, and those of the client commands.
const OTHER_VARIABLES: [&str; 3] = ["config", "token", "server"];

/// Settings on their way to a configuration; what is added later lies on top.
#[derive(Debug, Default)]
pub(super) struct Layers {
    values: Table,
    origins: BTreeMap<String, Origin>,
}

impl Layers {
    pub(super) fn add_file(&mut self, file: &Path) -> Result<(), ConfigError> {
        let read = |why| ConfigError::Read { file: file.to_owned(), why };
        let text = std::fs::read_to_string(file).map_err(read)?;
        let table: Table = text.parse().map_err(|error: toml::de::Error| {
            let line = line_of(&text, error.span().map_or(0, |span| span.start));
            ConfigError::Syntax { file: file.to_owned(), line, why: error.message().to_owned() }
        })?;
        let folder = file.parent().unwrap_or(Path::new(""));
        for (key, value) in &table {
            self.add(key, value, Origin::File(file.to_owned()))?;
            if is_file(key)
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
        let Some(read) = read(key, value) else {
            let hint = near(key).map(|name| format!(", did you mean {name}?")).unwrap_or_default();
            return Err(ConfigError::Unknown { origin, key: key.to_owned(), hint });
        };
        let value = read.map_err(|why| ConfigError::Value {
            origin: origin.clone(),
            key: key.to_owned(),
            // What was meant as a password is shown nowhere.
            value: if is_secret(key) { "***".to_owned() } else { super::show::value(value) },
            why,
        })?;
        self.values.insert(key.to_owned(), value);
        self.origins.insert(key.to_owned(), origin);
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
