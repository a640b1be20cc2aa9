//! Small JSON files with a checksum. On reading, everything around the body is rebuilt and compared byte by byte, so that any change is detected.

use super::StoreError;
use super::files::Files;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Longest such file, in bytes.
const LIMIT: u64 = 1 << 20;
const TAIL: &str = "}\n";

fn head(kind: &str, body: &[u8]) -> String {
    format!(r#"{{"format":1,"kind":"{kind}","blake3":"{}","body":"#, blake3::hash(body).to_hex())
}

/// The content of a file for `value`.
pub(crate) fn wrap<T: Serialize>(path: &Path, kind: &str, value: &T) -> Result<Vec<u8>, StoreError> {
    let body = serde_json::to_vec(value).map_err(|e| StoreError::of(path, "write", e.into()))?;
    let mut file = head(kind, &body).into_bytes();
    file.extend_from_slice(&body);
    file.extend_from_slice(TAIL.as_bytes());
    if file.len() as u64 > LIMIT {
        let cause = std::io::Error::other(format!("a {kind} of {} bytes is more than {LIMIT}", file.len()));
        return Err(StoreError::of(path, "write", cause));
    }
    Ok(file)
}

/// Reads and verifies a file; `None` if it does not exist.
pub(crate) fn read<T: DeserializeOwned>(files: &Files, path: &Path, kind: &str) -> Result<Option<T>, StoreError> {
    let Some(file) = files.read(path, LIMIT)? else { return Ok(None) };
    if let Some(format) = newer_format(&file) {
        let cause =
            std::io::Error::other(format!("it has format {format}, and this version reads 1: use the newer one"));
        return Err(StoreError::of(path, "read", cause));
    }
    unwrap(&file, kind).map(Some).map_err(|what| StoreError::damaged(path, what))
}

/// The format number of a file that a newer version wrote; such a file is not damaged and stays in place.
fn newer_format(file: &[u8]) -> Option<u32> {
    #[derive(serde::Deserialize)]
    struct Wrapper {
        format: u32,
    }
    let found: Wrapper = serde_json::from_slice(file).ok()?;
    (found.format > 1).then_some(found.format)
}

pub(super) fn unwrap<T: DeserializeOwned>(file: &[u8], kind: &str) -> Result<T, String> {
    let start = head(kind, b"").len();
    let body = file.len().checked_sub(TAIL.len()).and_then(|end| file.get(start..end));
    let body = body.ok_or_else(|| format!("{} bytes are too few", file.len()))?;
    if !file.starts_with(head(kind, body).as_bytes()) || !file.ends_with(TAIL.as_bytes()) {
        return Err("its content does not match its checksum".into());
    }
    serde_json::from_slice(body).map_err(|error| format!("it is not what this version writes: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_and_every_cut_is_found() {
        let value = vec!["Aa".to_owned(), "\"{}".to_owned()];
        let file = wrap(Path::new("x"), "list", &value).unwrap();
        assert_eq!(unwrap::<Vec<String>>(&file, "list").unwrap(), value);
        serde_json::from_slice::<serde_json::Value>(&file).expect("the whole file is JSON");
        assert!(unwrap::<Vec<String>>(&file, "lost").is_err(), "another kind");
        for at in 0..file.len() {
            for bit in 0..8 {
                let mut changed = file.clone();
                changed[at] ^= 1 << bit;
                assert!(unwrap::<Vec<String>>(&changed, "list").is_err(), "bit {bit} of byte {at}");
            }
            assert!(unwrap::<Vec<String>>(&file[..at], "list").is_err(), "cut to {at} bytes");
        }
        let longer = [&file[..], b"}\n"].concat();
        assert!(unwrap::<Vec<String>>(&longer, "list").is_err());
    }
}
