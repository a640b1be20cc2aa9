//! The settings as text.

use super::{ServeConfig, settings};
use std::fmt::Write as _;
use toml::Value;

impl ServeConfig {
    /// All settings as a TOML file, each with its origin as a comment. Tokens and keys are named by their files only.
    pub fn check_config(&self) -> String {
        let table = toml::Table::try_from(self).unwrap_or_default();
        let mut text = String::new();
        for name in settings::names() {
            let origin = self.origins.get(name).map_or_else(|| "default".to_owned(), ToString::to_string);
            let line = match table.get(name) {
                None => format!("# {name} is not set"),
                Some(Value::Integer(number)) if settings::is_bytes(name) => {
                    let size = u64::try_from(*number).map(settings::show_bytes).unwrap_or_default();
                    format!("{name} = {}", value(&Value::String(size)))
                }
                Some(Value::String(address)) if settings::is_secret(name) => {
                    format!("{name} = {}", value(&Value::String(without_password(address))))
                }
                Some(other) => format!("{name} = {}", value(other)),
            };
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{line:<44} # {origin}");
        }
        text
    }
}

/// An address with `***` for its password.
fn without_password(address: &str) -> String {
    let shown = address.split_once("://").and_then(|(scheme, rest)| {
        let (user, host) = rest.rsplit_once('@')?;
        let (name, _) = user.split_once(':')?;
        Some(format!("{scheme}://{name}:***@{host}"))
    });
    let shown = shown.unwrap_or_else(|| address.to_owned());
    match shown.split_once("password=") {
        Some((before, _)) => format!("{before}password=***"),
        None => shown,
    }
}

/// A value as TOML has it. Texts are escaped as in JSON, which TOML understands.
pub(super) fn value(value: &Value) -> String {
    match value {
        Value::String(text) => serde_json::to_string(text).unwrap_or_default(),
        Value::Integer(number) => number.to_string(),
        Value::Float(number) => number.to_string(),
        Value::Boolean(truth) => truth.to_string(),
        Value::Datetime(_) => "a date".to_owned(),
        Value::Array(items) => format!("[{}]", items.iter().map(self::value).collect::<Vec<_>>().join(", ")),
        Value::Table(_) => "a table".to_owned(),
    }
}
