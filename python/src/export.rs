//! Writes the frames of a container in formats of other programs, as `cager decode` does.

use crate::fault::{Fault, of};
use cager_capture::decode::{Decoding, decode};
use cager_formats::atomic::destination;
use cager_formats::{Target, frames_path};
use cager_geometry::units::Units;
use std::path::{Path, PathBuf};

/// Writes the frames of the container at `from` to `path`, which appears whole or not at all; what it loses is returned in words.
pub(crate) fn export(
    from: &Path,
    path: PathBuf,
    overwrite: bool,
    with_cage: bool,
    units: Units,
) -> Result<Vec<String>, Fault> {
    let place = destination(frames_path(&path));
    if place.is_ok_and(|place| from.canonicalize().is_ok_and(|from| from.starts_with(place))) {
        return Err(of(path.display(), "is the capture itself, or a folder that holds it; name another"));
    }
    let output = if overwrite { Target::Replacing } else { Target::New }(path);
    let what = Decoding { with_cage, units, ..Decoding::default() };
    let notes = decode(from, output, what, &mut |_| ())?.notes;
    Ok(notes
        .iter()
        .map(|note| note.replace("(--up y turns", "(up=\"y\" turns").replace("--up and --unit", "up and unit"))
        .collect())
}
