//! Where an output goes.

use std::path::{Path, PathBuf};

/// Where an output goes. A path alone stands for [`Target::Replacing`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// This path, in place of what has that name.
    Replacing(PathBuf),
    /// This path, where there must be nothing, neither now nor when the output is complete.
    New(PathBuf),
    /// Standard output, which gets a copy of the file once that is complete.
    StandardOutput,
}

impl Target {
    /// The path as it was given; words that say what it is for standard output.
    pub fn path(&self) -> &Path {
        match self {
            Self::Replacing(path) | Self::New(path) => path,
            Self::StandardOutput => Path::new("standard output"),
        }
    }

    /// The file beside this one that has another extension.
    pub(crate) fn beside(&self, extension: &str) -> Self {
        let path = self.path().with_extension(extension);
        if self.replaces() { Self::Replacing(path) } else { Self::New(path) }
    }

    /// Whether what is there may be replaced.
    pub fn replaces(&self) -> bool {
        matches!(self, Self::Replacing(_))
    }
}

impl<P: AsRef<Path> + ?Sized> From<&P> for Target {
    fn from(path: &P) -> Self {
        Self::Replacing(path.as_ref().to_owned())
    }
}

impl From<PathBuf> for Target {
    fn from(path: PathBuf) -> Self {
        Self::Replacing(path)
    }
}

impl From<&Self> for Target {
    fn from(target: &Self) -> Self {
        target.clone()
    }
}
