//! The container: a header, a chunk of JSON and a chunk of binary data.

use std::ops::Range;

use crate::error::Fault;

/// The chunk of JSON, and where the other one is in the file.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Range<usize>), Fault> {
    let (Some(b"glTF"), Some(version), Some(length)) = (bytes.get(..4), word(bytes, 4), word(bytes, 8)) else {
        return Err(Fault::damaged("does not begin as a .glb file does; export the mesh again"));
    };
    if version != 2 {
        return Err(Fault::unsupported(format!("is glTF {version}.0; export the mesh as glTF 2.0")));
    }
    let mut rest = bytes.get(12..length as usize).ok_or_else(|| truncated(length.into(), bytes.len()))?;
    let (end, mut json, mut binary) = (length as usize, None, None);
    while !rest.is_empty() {
        let (Some(length), Some(kind)) = (word(rest, 0), rest.get(4..8)) else {
            return Err(truncated(8, rest.len()));
        };
        let chunk = rest[8..].get(..length as usize).ok_or_else(|| truncated(length.into(), rest.len() - 8))?;
        match kind {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if binary.is_none() => {
                let start = end - rest.len() + 8;
                binary = Some(start..start + chunk.len());
            }
            // The format asks readers to skip what they do not know.
            _ => {}
        }
        rest = &rest[8 + chunk.len()..];
    }
    let json = json.ok_or_else(|| Fault::damaged("has no JSON chunk; export the mesh again"))?;
    Ok((json, binary.unwrap_or(end..end)))
}

fn word(bytes: &[u8], offset: usize) -> Option<u32> {
    bytes.get(offset..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

fn truncated(promised: u64, found: usize) -> Fault {
    Fault::damaged(format!("promises {promised} bytes where {found} are left; copy or export the file again"))
}
