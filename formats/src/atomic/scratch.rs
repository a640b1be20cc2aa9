//! A folder that is needed only while the process works.

use std::fs;
use std::path::Path;

use super::temporary::{self, Temporary};
use crate::error::Error;

/// A folder of a temporary name, removed with all that is in it when dropped, or by
/// [`remove_temporaries`](super::remove_temporaries) on a signal.
#[derive(Debug)]
pub struct ScratchDir(Temporary);

impl ScratchDir {
    /// Makes one in `folder`, which must exist.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder is missing or closed to writing.
    pub fn create(folder: impl AsRef<Path>) -> Result<Self, Error> {
        let folder = folder.as_ref();
        let begun = temporary::lock().begin(folder, |path| fs::create_dir(path));
        begun.map(|((), made)| Self(made)).map_err(|cause| Error::write(folder, cause))
    }

    /// Runs what may make the folder anew where it is missing: [`remove_temporaries`](super::remove_temporaries) waits for
    /// it, so it should be short. It must not begin, name or drop an output.
    pub fn undisturbed<T>(&self, work: impl FnOnce() -> T) -> T {
        let _live = temporary::lock();
        work()
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn it_goes_although_others_still_write_into_it() {
        let around = tempfile::tempdir().unwrap();
        let scratch = ScratchDir::create(around.path()).unwrap();
        let inner = scratch.path().join("inner");
        fs::create_dir(&inner).unwrap();
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut k = 0;
                while !stop.load(Ordering::Relaxed) {
                    // Fails from the moment on in which the folder is on its way out.
                    let _ = fs::write(inner.join(k.to_string()), "x");
                    k += 1;
                }
            });
            while fs::read_dir(&inner).unwrap().count() < 20 {}
            drop(scratch);
            stop.store(true, Ordering::Relaxed);
        });
        assert_eq!(fs::read_dir(around.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_is_missing_is_named() {
        let around = tempfile::tempdir().unwrap();
        let missing = around.path().join("missing");
        let error = ScratchDir::create(&missing).unwrap_err().to_string();
        assert!(error.starts_with(&missing.display().to_string()), "{error}");
    }
}
