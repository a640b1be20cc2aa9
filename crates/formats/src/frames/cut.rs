//! Text files that end within a line, as a copy does that was broken off.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use crate::error::{Error, Fault};
use crate::mesh::MeshFormat;

/// Whether the last line of a text file has an end; none for files that are not text.
pub(super) fn last_line_ends(path: &Path) -> io::Result<Option<bool>> {
    let mut file = File::open(path)?;
    let mut head = Vec::new();
    file.by_ref().take(32).read_to_end(&mut head)?;
    let text = match MeshFormat::guess(path) {
        Some(MeshFormat::Obj | MeshFormat::Off) => true,
        Some(MeshFormat::Ply) => head.windows(12).any(|word| word == b"format ascii"),
        _ => false,
    };
    if !text || head.is_empty() {
        return Ok(None);
    }
    let mut last = [0];
    file.seek(SeekFrom::End(-1))?;
    file.read_exact(&mut last)?;
    Ok(Some(matches!(last, [b'\n' | b'\r'])))
}

/// The error of a frame whose file was cut; `why` says what shows it.
pub(super) fn in_last_line(path: &Path, frame: usize, why: &str) -> Error {
    let what = format!("frame {frame}: ends within a line {why}; copy or export it again");
    Fault::damaged(what).at(path)
}
