//! Validation of output paths.

use super::{global_args, interrupt, warn};
use anyhow::{Result, bail};
use cager_formats::atomic::destination;
use cager_formats::{
    AtomicFile, CacheFormat, MeshFormat, Target, frame_files, frames_path, is_numbered_in_vain, names_beside_others,
};
use clap::Args;
use std::fs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

/// What holds for every output of a command.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct OutputArgs {
    /// Replace outputs that are there already.
    #[arg(long)]
    pub(super) overwrite: bool,

    /// Check files and options, say what would be written, and write nothing.
    #[arg(long)]
    pub(super) dry_run: bool,
}

/// The outputs of a command, each checked when it is named: before the work, so that one that
/// cannot be written costs no waiting.
pub(super) struct Outputs {
    overwrite: bool,
    inputs: Vec<PathBuf>,
    taken: Vec<PathBuf>,
}

impl Outputs {
    /// Outputs that may not be in place of these inputs, files or captures.
    pub(super) fn new<'a>(args: OutputArgs, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<Self> {
        interrupt::remove_temporaries_on_signal()?;
        let inputs = inputs.into_iter().flat_map(frame_files).filter_map(|path| path.canonicalize().ok()).collect();
        Ok(Self { overwrite: args.overwrite, inputs, taken: Vec::new() })
    }

    /// A file of text.
    pub(super) fn text(&mut self, path: &Path) -> Result<Target> {
        let target = self.target(path, path)?;
        // Whether it can be written; dropped at once, which leaves nothing.
        drop(AtomicFile::create(&target)?);
        Ok(target)
    }

    /// A container, refused on a terminal with a hint to redirect it as in `example`, and under the
    /// name of another format.
    pub(super) fn container(&mut self, path: &Path, example: &str) -> Result<Target> {
        refuse_terminal(path, example)?;
        let target = self.text(path)?;
        if CacheFormat::from_path(path).is_some() || MeshFormat::from_path(path).is_ok() {
            bail!(
                "{}: what is written is a container; name it {}, and write other formats of it with `cager decode`",
                path.display(),
                path.with_extension("cager").display()
            );
        }
        Ok(target)
    }

    /// Frames in any of their formats.
    pub(super) fn frames(&mut self, path: &Path) -> Result<Target> {
        refuse_terminal(path, "walk.npy")?;
        if let Some(is_one) = names_beside_others(path) {
            return self.beside_others(path, is_one);
        }
        let place = frames_path(path);
        let target = self.target(path, place)?;
        if is_numbered_in_vain(path) {
            warn(&[format!(
                "{}: a file of this format holds all frames, so one of just this name is written; end the name in .obj \
                 or .ply for one of each frame",
                path.display()
            )]);
        }
        let here = std::env::current_dir().and_then(|here| here.canonicalize());
        if place.canonicalize().is_ok_and(|folder| here.is_ok_and(|here| here.starts_with(folder))) {
            bail!(
                "{}: is the folder that cager runs in, or holds it, and would be replaced as a whole; name another",
                path.display()
            );
        }
        if !self.overwrite && fs::read_dir(place).is_ok_and(|mut files| files.next().is_some()) {
            bail!(
                "{}: is a folder that is not empty; name another, or give --overwrite to replace it as a whole, where \
                 it holds only such frames",
                path.display()
            );
        }
        Ok(target)
    }

    /// Files of a numbered name in a folder that holds others.
    fn beside_others(&mut self, path: &Path, is_one: impl Fn(&Path) -> bool) -> Result<Target> {
        let shown = path.display();
        let inputs = self.inputs.iter().chain(&self.taken);
        if let Some(other) = inputs.filter(|other| is_one(other)).min() {
            bail!("{shown}: names {}, which is an input or another output; name other files", other.display());
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let there = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        if let Some(file) = there.filter(|file| is_one(file)).min().filter(|_| !self.overwrite) {
            let file = file.strip_prefix(".").unwrap_or(&file);
            bail!(
                "{}: is there already; name other files than {shown}, or give --overwrite to replace those that are \
                 written",
                file.display()
            );
        }
        self.taken.push(path.to_owned());
        Ok(self.target_of(path))
    }

    fn target_of(&self, path: &Path) -> Target {
        if self.overwrite { Target::Replacing(path.to_owned()) } else { Target::New(path.to_owned()) }
    }

    fn target(&mut self, path: &Path, place: &Path) -> Result<Target> {
        let shown = path.display();
        if path.as_os_str() == "-" {
            if !global_args::take_stdout() {
                bail!("-: standard output cannot hold two outputs; name a file for one of them");
            }
            return Ok(Target::StandardOutput);
        }
        if let Ok(at) = destination(place) {
            if self.taken.contains(&at) {
                bail!("{shown}: cannot hold two outputs; name two files");
            }
            match self.inputs.iter().find(|input| input.starts_with(&at)) {
                Some(input) if *input == at => {
                    bail!("{shown}: is an input, so it cannot be an output; name another file")
                }
                // It would be replaced as a whole.
                Some(_) => bail!("{shown}: is a folder with an input in it, so it cannot be an output; name another"),
                None => self.taken.push(at),
            }
        }
        match fs::metadata(place) {
            Ok(found) if found.is_dir() => {}
            Ok(found) if !found.is_file() => {
                bail!("{shown}: is not a regular file; name one, or give - for standard output")
            }
            Ok(_) if !self.overwrite => {
                bail!("{shown}: is there already; name another file, or give --overwrite to replace it")
            }
            _ => {}
        }
        Ok(self.target_of(path))
    }
}

/// The folder that an output is to lie in, where there is room for what is on its way.
pub(super) fn folder_of(output: &Target) -> &Path {
    let folder = match output {
        Target::StandardOutput => None,
        output => output.path().parent().filter(|folder| !folder.as_os_str().is_empty()),
    };
    folder.unwrap_or(Path::new("."))
}

fn refuse_terminal(path: &Path, example: &str) -> Result<()> {
    if path.as_os_str() == "-" && std::io::stdout().is_terminal() {
        bail!("-: standard output is a terminal; redirect it, as in -o - > {example}");
    }
    Ok(())
}
