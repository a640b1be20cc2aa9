//! The container: a header, a chunk of JSON and a chunk of binary data.

use std::ops::Range;

use gltf::json::Root;

use super::lenient;
use crate::error::Fault;
use crate::text::quoted;

pub(super) struct Chunks<'a> {
    pub(super) json: &'a [u8],
    /// Where the other chunk is in the file.
    pub(super) binary: Range<usize>,
}

pub(super) fn split(bytes: &[u8]) -> Result<Chunks<'_>, Fault> {
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
    Ok(Chunks { json, binary: binary.unwrap_or(end..end) })
}

/// Objects that any document may have, and bytes of JSON for each one beyond: real ones take twenty and more, where `{}` takes three to make some hundred.
const MAX_OBJECTS_OF_ANY_FILE: usize = 100_000;
const BYTES_PER_OBJECT: usize = 12;

/// Parses the JSON; the indices in it are not checked.
pub(super) fn document(json: &[u8]) -> Result<Root, Fault> {
    /// Characters of the reason that are shown.
    const SHOWN: usize = 160;
    let json = without_padding(json);
    // Before any is made.
    let most = MAX_OBJECTS_OF_ANY_FILE + json.len() / BYTES_PER_OBJECT;
    if json.iter().filter(|&&b| b == b'{').count() > most {
        return Err(Fault::unsupported(format!(
            "describes more than {most} objects; export the mesh alone, without its scene"
        )));
    }
    let parsed = match gltf::json::deserialize::from_slice(json) {
        Ok(root) => Ok(root),
        Err(cause) => lenient::parse(json)?.unwrap_or(Err(cause)),
    };
    let root: Root = parsed.map_err(|cause| {
        // It may repeat a text of the file, of any length.
        let cause = cause.to_string();
        let shown: String = cause.chars().take(SHOWN).collect();
        let more = if shown.len() < cause.len() { "…" } else { "" };
        Fault::damaged(format!("has JSON that is not glTF 2.0 ({shown}{more}); export the mesh again"))
    })?;
    match root.extensions_required.iter().find(|name| !is_read(name)) {
        Some(name) if name == DRACO => Err(draco()),
        Some(name) => {
            let name = quoted(name.as_bytes());
            Err(Fault::unsupported(format!(
                "needs the extension {name}, which is not read; export the mesh without it"
            )))
        }
        None => Ok(root),
    }
}

/// JSON without a byte order mark and zeros behind it, which some programs write.
fn without_padding(json: &[u8]) -> &[u8] {
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let end = json.iter().rposition(|&byte| byte != 0 && !byte.is_ascii_whitespace()).map_or(0, |last| last + 1);
    &json[..end]
}

pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Whether files that require an extension are read: it is understood, or changes no shape.
fn is_read(extension: &str) -> bool {
    /// Parts of the names of extensions for appearance, sound, behaviour and notes.
    const OTHER: [&str; 12] = [
        "_materials_",
        "_texture_",
        "_light",
        "_xmp",
        "_audio",
        "_animation_pointer",
        "_interactivity",
        "_node_visibility",
        "_node_selectability",
        "_node_hoverability",
        "_mesh_features",
        "_structural_metadata",
    ];
    matches!(extension, "KHR_mesh_quantization" | "EXT_meshopt_compression" | "KHR_meshopt_compression")
        || OTHER.iter().any(|part| extension.contains(part))
}

pub(super) fn draco() -> Fault {
    Fault::unsupported(format!(
        "is compressed by Draco ({DRACO}), which is not read; export it without compression, or open it in Blender and do so there"
    ))
}

fn word(bytes: &[u8], offset: usize) -> Option<u32> {
    bytes.get(offset..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

fn truncated(promised: u64, found: usize) -> Fault {
    Fault::damaged(format!("promises {promised} bytes where {found} are left; copy or export the file again"))
}
