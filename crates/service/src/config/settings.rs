//! What each setting may be.

use super::{GIB, KIB, MIB, SETTINGS};
use crate::telemetry::{log_filter, parts};
use std::net::SocketAddr;
use toml::Value;

/// What a setting may be.
#[derive(Clone, Copy, Debug)]
pub(super) enum SettingKind {
    Address,
    File,
    Text,
    /// Address of a database, in which a password may be.
    Secret,
    Format,
    Filter,
    /// A list of names of hosts.
    Hosts,
    /// A list of origins of pages.
    Origins,
    Number {
        least: u64,
        most: u64,
    },
    Bytes {
        least: u64,
        most: u64,
    },
}

/// Names of all settings, in the order in which they are shown.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SETTINGS.iter().map(|(name, _)| *name)
}

/// Reads a setting: its value as the configuration wants it, or what would be possible. `None` for an unknown setting.
pub(super) fn read(name: &str, value: &Value) -> Option<Result<Value, String>> {
    SETTINGS.iter().find(|(known, _)| *known == name).map(|(_, kind)| kind.read(value))
}

/// Whether it names a file or folder.
pub(super) fn is_file(name: &str) -> bool {
    SETTINGS.iter().any(|(known, kind)| *known == name && matches!(kind, SettingKind::File))
}

/// Whether a password may be in it.
pub(super) fn is_secret(name: &str) -> bool {
    SETTINGS.iter().any(|(known, kind)| *known == name && matches!(kind, SettingKind::Secret))
}

/// Whether sizes may be given in units.
pub(super) fn is_bytes(name: &str) -> bool {
    SETTINGS.iter().any(|(known, kind)| *known == name && matches!(kind, SettingKind::Bytes { .. }))
}

impl SettingKind {
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
            Self::Text => match text.map(str::trim) {
                None | Some("") => Err("write a text, in quotation marks".to_owned()),
                Some(text) => Ok(Value::String(text.to_owned())),
            },
            Self::Secret => {
                let is_database = |text: &&str| text.starts_with("postgres://") || text.starts_with("postgresql://");
                let why = "write the address of a database, such as postgres://USER:PASSWORD@HOST:5432/DATABASE";
                let text = text.map(str::trim).filter(is_database);
                text.map(|text| Value::String(text.to_owned())).ok_or_else(|| why.to_owned())
            }
            Self::Format => match text {
                Some("human" | "json") => Ok(value.clone()),
                _ => Err("write \"human\" or \"json\"".to_owned()),
            },
            Self::Filter => {
                let wrong =
                    |why: String| format!("{why}; write a level such as info, or info,cager_service::http=debug");
                let text = text.ok_or_else(|| wrong("not a text".to_owned()))?;
                // It would be taken for the name of a module, of which everything is logged.
                if let Some((word, level)) = parts(text).find_map(|part| Some((part, meant_level(part)?))) {
                    return Err(wrong(format!("{word} is no level, did you mean {level}?")));
                }
                match log_filter(text) {
                    Ok(_) => Ok(value.clone()),
                    Err(error) => Err(wrong(error.to_string())),
                }
            }
            Self::Hosts => {
                let items = items(value)?;
                if let Some(other) = items.iter().find(|item| !is_host(item)) {
                    let why = "is no name of a host: write one such as cager.studio, without a scheme or a path";
                    return Err(format!("{other} {why}"));
                }
                Ok(Value::Array(items.into_iter().map(Value::String).collect()))
            }
            Self::Origins => {
                let items = items(value)?;
                if let Some(other) = items.iter().find(|item| !is_origin(item)) {
                    let why = "is no origin: write one such as https://tools.studio, without a path or a slash behind";
                    return Err(format!("{other} {why}"));
                }
                Ok(Value::Array(items.into_iter().map(Value::String).collect()))
            }
            Self::Number { least, most } => {
                let number = value.as_integer().or_else(|| text?.trim().parse().ok());
                let number = number.and_then(|number| u64::try_from(number).ok());
                in_range(number, least, most).ok_or_else(|| format!("write a whole number from {least} to {most}"))
            }
            Self::Bytes { least, most } => {
                let number = match text {
                    Some(text) => cager_capture::sizes::bytes(text),
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

/// The level that a word is almost.
fn meant_level(word: &str) -> Option<&'static str> {
    let is_level = word.parse::<tracing_subscriber::filter::LevelFilter>().is_ok();
    let word = word.to_ascii_lowercase();
    let is_almost =
        |level: &&str| distance(&word, level) <= 2 || word.starts_with(*level) && word.len() <= level.len() + 3;
    ["error", "warn", "info", "debug", "trace"].into_iter().find(is_almost).filter(|_| !is_level)
}

/// The texts of a list.
fn items(value: &Value) -> Result<Vec<String>, String> {
    let items: Option<Vec<String>> = match value.as_array() {
        Some(items) => items.iter().map(|item| item.as_str().map(str::to_owned)).collect(),
        None => value.as_str().map(|text| text.split(',').map(str::to_owned).collect()),
    };
    let items = items.ok_or_else(|| "write a list of texts, or one text with commas between them".to_owned())?;
    Ok(items.iter().map(|item| item.trim().to_owned()).filter(|item| !item.is_empty()).collect())
}

/// Whether a request can be for this host, at one port or any.
fn is_host(text: &str) -> bool {
    let name = text.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok()).map_or(text, |(name, _)| name);
    !name.is_empty() && !name.contains(|c: char| "/?#@*:".contains(c) || c.is_whitespace())
}

/// Whether a browser can say that a page has this origin.
fn is_origin(text: &str) -> bool {
    text.split_once("://").is_some_and(|(scheme, host)| {
        !scheme.is_empty() && !host.is_empty() && !host.contains(|c: char| "/?#@*".contains(c) || c.is_whitespace())
    })
}

fn in_range(number: Option<u64>, least: u64, most: u64) -> Option<Value> {
    let number = number.filter(|number| (least..=most).contains(number))?;
    i64::try_from(number).ok().map(Value::Integer)
}

/// A size in the largest unit in which it is whole.
pub(super) fn show_bytes(number: u64) -> String {
    let units = [(GIB << 10, "TiB"), (GIB, "GiB"), (MIB, "MiB"), (KIB, "KiB")];
    let unit = units.into_iter().find(|(size, _)| number >= *size && number.is_multiple_of(*size));
    unit.map_or_else(|| format!("{number} B"), |(size, unit)| format!("{} {unit}", number / size))
}

/// The setting that was probably meant.
pub(super) fn near(key: &str) -> Option<&'static str> {
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
