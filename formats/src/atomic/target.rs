//! Where an output goes.

use std::path::{Path, PathBuf};

/// Where an output goes, and whether it may replace what is there.
///
/// A path alone stands for [`Target::replacing`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Replacing,
    New,
    StandardOutput,
}

impl Target {
    /// This path, in place of what has that name.
    pub fn replacing(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), kind: Kind::Replacing }
    }

    /// This path, where there must be nothing, neither now nor when the output is complete.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), kind: Kind::New }
    }

    /// Standard output: a file without a name, in the system's folder for temporary files, is copied there once it is
    /// complete.
    pub fn standard_output() -> Self {
        Self { path: "standard output".into(), kind: Kind::StandardOutput }
    }

    /// The path as it was given; words that say what it is for standard output.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether this is standard output.
    pub fn is_standard_output(&self) -> bool {
        self.kind == Kind::StandardOutput
    }

    /// Whether what is there may be replaced.
    pub fn replaces(&self) -> bool {
        self.kind == Kind::Replacing
    }
}

impl<P: AsRef<Path> + ?Sized> From<&P> for Target {
    fn from(path: &P) -> Self {
        Self::replacing(path.as_ref())
    }
}

impl From<PathBuf> for Target {
    fn from(path: PathBuf) -> Self {
        Self::replacing(path)
    }
}

impl From<&Self> for Target {
    fn from(target: &Self) -> Self {
        target.clone()
    }
}
