//! Where outputs may not go.

use anyhow::{Result, bail};
use cager_formats::{CacheFormat, MeshFormat};
use std::path::{Path, PathBuf};

/// An output in place of an input, or of the other output, is a slip that would cost the user a file.
pub(super) fn refuse_overwriting<'a>(
    output: &Path,
    report: Option<&Path>,
    inputs: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<()> {
    let inputs: Vec<&PathBuf> = inputs.into_iter().collect();
    for output in [Some(output), report].into_iter().flatten() {
        refuse_input(output, inputs.iter().copied())?;
        // It may be a frame of the folder or pattern; no container or report has such a name.
        if output.exists() && (MeshFormat::from_path(output).is_ok() || CacheFormat::from_path(output).is_some()) {
            bail!("{}: is a mesh or a capture, so it is not replaced; name another file", output.display());
        }
    }
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        path.canonicalize().ok().or_else(|| Some(folder.canonicalize().ok()?.join(path.file_name()?)))
    };
    let second = report.and_then(place);
    if second.is_some() && second == place(output) {
        bail!("{}: cannot hold both outputs; name two files", output.display());
    }
    Ok(())
}

/// An input cannot be written over while it is read.
pub(super) fn refuse_input<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
    let Ok(place) = output.canonicalize() else { return Ok(()) };
    for input in inputs {
        if input.canonicalize().is_ok_and(|input| input == place) {
            bail!("{}: is an input, so it cannot be an output; name another file", output.display());
        }
    }
    Ok(())
}
