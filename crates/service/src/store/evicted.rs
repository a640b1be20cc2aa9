//! Which files of the bucket are on this machine, and which of them go when they are too many.

use crate::sync::lock;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// So long after its last use a file stays in any case: whoever has asked for it may be about to open it.
const REST: Duration = Duration::from_secs(60);

/// Files that are written to stay, so that nobody fetches one meanwhile.
const WRITTEN: &str = "frames-";

#[derive(Debug)]
pub(super) struct Cached {
    most: u64,
    files: Mutex<Files>,
}

#[derive(Debug, Default)]
struct Files {
    bytes: u64,
    /// Bytes and last use.
    known: HashMap<PathBuf, (u64, Instant)>,
}

impl Cached {
    pub(super) fn new(most: u64) -> Self {
        Self { most, files: Mutex::default() }
    }

    /// Notes that a file is used.
    pub(super) fn used(&self, path: &Path) {
        if let Some((_, last)) = lock(&self.files).known.get_mut(path) {
            *last = Instant::now();
        }
    }

    /// Notes a file; gives those that are to be removed.
    pub(super) fn keep(&self, path: &Path, bytes: u64) -> Vec<PathBuf> {
        self.keep_at(path, bytes, Instant::now())
    }

    fn keep_at(&self, path: &Path, bytes: u64, now: Instant) -> Vec<PathBuf> {
        let mut files = lock(&self.files);
        let before = files.known.insert(path.to_owned(), (bytes, now)).map_or(0, |(bytes, _)| bytes);
        files.bytes = files.bytes + bytes - before;
        let mut gone = Vec::new();
        if files.bytes > self.most {
            let may_go = |path: &Path| {
                path.file_name().and_then(|name| name.to_str()).is_some_and(|name| !name.starts_with(WRITTEN))
            };
            let rested =
                files.known.iter().filter(|(path, (_, last))| now.duration_since(*last) >= REST && may_go(path));
            let mut rested: Vec<_> = rested.map(|(path, (bytes, last))| (*last, path.clone(), *bytes)).collect();
            rested.sort();
            // Down to nine tenths, so that this is not done for each file.
            for (_, path, bytes) in rested {
                if files.bytes <= self.most / 10 * 9 {
                    break;
                }
                files.known.remove(&path);
                files.bytes -= bytes;
                gone.push(path);
            }
        }
        gone
    }

    /// Forgets a file that is gone, or all in a folder.
    pub(super) fn forget(&self, path: &Path) {
        let mut files = lock(&self.files);
        match files.known.remove(path) {
            Some((bytes, _)) => files.bytes -= bytes,
            None => {
                let gone: Vec<PathBuf> = files.known.keys().filter(|known| known.starts_with(path)).cloned().collect();
                let bytes: u64 = gone.iter().filter_map(|path| files.known.remove(path)).map(|(bytes, _)| bytes).sum();
                files.bytes -= bytes;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: [&Path; 0] = [];

    #[test]
    fn files_that_were_not_used_for_longest_go_first_and_none_that_was_just_used() {
        let (cached, start) = (Cached::new(100), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        assert_eq!(cached.keep_at(Path::new("s/a"), 40, at(0)), NONE);
        assert_eq!(cached.keep_at(Path::new("s/b"), 40, at(10)), NONE);
        assert_eq!(cached.keep_at(Path::new("s/c"), 40, at(20)), NONE, "all were just used");
        assert_eq!(cached.keep_at(Path::new("s/d"), 10, at(75)), [Path::new("s/a")], "down to nine tenths");
        // A file that is replaced counts once; one that waits to be coded stays.
        assert_eq!(cached.keep_at(Path::new("s/d"), 60, at(76)), [Path::new("s/b")]);
        assert_eq!(cached.keep_at(Path::new("s/frames-0000000000"), 1, at(77)), NONE);
        assert_eq!(cached.keep_at(Path::new("s/f"), 1, at(200)), [Path::new("s/c")]);
        cached.forget(Path::new("s"));
        assert_eq!(cached.keep_at(Path::new("s/e"), 100, at(300)), NONE);
    }
}
