//! Identifiers that become parts of paths.

use super::StoreError;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;
use std::str::FromStr;

/// BLAKE3 digest of the inputs of some work and their tenant: the key of stored content and of its prepared solver; also identifies the inputs of a
/// cage job or of a cage that the service made.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ContentKey(pub [u8; 32]);

impl ContentKey {
    /// Digest of these parts and of where each begins.
    pub(crate) fn of<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in parts {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
        Self(*hasher.finalize().as_bytes())
    }
}

impl fmt::Display for ContentKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ContentKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for ContentKey {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let lower_case = !text.bytes().any(|c| c.is_ascii_uppercase());
        let hash = blake3::Hash::from_hex(text).ok().filter(|_| lower_case);
        let hash = hash.ok_or_else(|| format!("{text:?} is not 64 lower-case hexadecimal digits"))?;
        Ok(Self(*hash.as_bytes()))
    }
}

impl Serialize for ContentKey {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for ContentKey {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

/// Whether `id` is a valid id: 1 to 64 of 0-9, a-z and -. Only valid ids are used in paths.
pub fn is_session_id(id: &str) -> bool {
    (1..=64).contains(&id.len()) && id.bytes().all(|c| matches!(c, b'0'..=b'9' | b'a'..=b'z' | b'-'))
}

pub(crate) fn check_id(id: &str) -> Result<(), StoreError> {
    if is_session_id(id) { Ok(()) } else { Err(StoreError::BadId { id: id.chars().take(80).collect() }) }
}
