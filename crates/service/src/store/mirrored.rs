//! A data folder whose files are in a bucket: the folder is a cache of it, emptied at each start, and what is put in place, replaced or removed there is so in
//! the bucket first. Temporary files and prepared solvers are on this machine alone.

use super::disk::{Disk, DiskFile, Entry, FILE_MODE};
use super::evicted::Cached;
use cager_store::{Blobs, Catalog, CatalogError};
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Weak};
use std::time::SystemTime;

use crate::sync::lock;

/// Folders whose files are in the bucket.
pub(super) const FOLDERS: [&str; 6] = ["sessions", "cages", "recoveries", "transfers", "contents", "quarantine"];
/// Those of records: what is removed there does not come back.
const RECORDS: [&str; 4] = ["sessions", "cages", "recoveries", "transfers"];
/// Paths in use from which on those are forgotten that no longer are.
const TURNS: usize = 256;

#[derive(Debug)]
pub(super) struct MirroredDisk {
    disk: Arc<dyn Disk>,
    blobs: Arc<Blobs>,
    root: PathBuf,
    /// Who changes or fetches a file takes its turn.
    turns: Mutex<HashMap<PathBuf, Weak<Mutex<()>>>>,
    cached: Cached,
}

impl MirroredDisk {
    /// The folder `root`, with at most so many bytes of the bucket's files in it.
    pub(super) fn new(disk: Arc<dyn Disk>, blobs: Arc<Blobs>, root: &Path, bytes: u64) -> Self {
        Self { disk, blobs, root: root.to_owned(), turns: Mutex::default(), cached: Cached::new(bytes) }
    }

    /// What a path is called in the bucket; `None` for what is on this machine alone.
    fn name<'a>(&self, path: &'a Path) -> Option<&'a str> {
        let name = path.strip_prefix(&self.root).ok()?.to_str()?;
        FOLDERS.contains(&name.split('/').next()?).then_some(name)
    }

    fn turn(&self, path: &Path) -> Arc<Mutex<()>> {
        let mut turns = lock(&self.turns);
        if let Some(turn) = turns.get(path).and_then(Weak::upgrade) {
            return turn;
        }
        if turns.len() >= TURNS {
            turns.retain(|_, turn| turn.strong_count() > 0);
        }
        let turn = Arc::default();
        turns.insert(path.to_owned(), Arc::downgrade(&turn));
        turn
    }

    fn make_parents(&self, path: &Path) -> io::Result<()> {
        let Some(above) = path.parent().filter(|above| above.starts_with(&self.root)) else { return Ok(()) };
        match self.disk.create_dir(above) {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                self.make_parents(above)?;
                unless_there(self.disk.create_dir(above))
            }
            made => unless_there(made),
        }
    }

    /// Fetches a file, or makes a folder, that the bucket has and this machine has not.
    fn bring_missing(&self, path: &Path, name: &str) -> io::Result<()> {
        let turn = self.turn(path);
        let _turn = lock(&turn);
        if self.disk.open(path).is_ok() {
            return Ok(());
        }
        if self.blobs.bytes(name).is_none() {
            if !self.blobs.has_folder(name) {
                return Err(ErrorKind::NotFound.into());
            }
            self.make_parents(path)?;
            return unless_there(self.disk.create_dir(path));
        }
        let staging = self.root.join("tmp").join(format!("fetched-{}", uuid::Uuid::now_v7().simple()));
        let file = File::options().write(true).create_new(true).mode(FILE_MODE).open(&staging);
        let placed = file.and_then(|file| self.blobs.fetch(name, &file)).and_then(|bytes| {
            self.make_parents(path)?;
            self.disk.rename(&staging, path)?;
            self.keep(path, bytes);
            Ok(())
        });
        placed.inspect_err(|_| drop(self.disk.remove_file(&staging)))
    }

    /// Does something with a file; where that is not on this machine, after it has been fetched.
    fn having<T>(&self, path: &Path, work: impl Fn() -> io::Result<T>) -> io::Result<T> {
        match work() {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let Some(name) = self.name(path) else { return Err(error) };
                self.bring_missing(path, name)?;
                work()
            }
            done => {
                self.cached.used(path);
                done
            }
        }
    }

    /// Notes a file of the bucket on this machine, and removes those that were not used for longest where they are too many.
    fn keep(&self, path: &Path, bytes: u64) {
        for old in self.cached.keep(path, bytes) {
            if let Err(error) = self.disk.remove_file(&old)
                && error.kind() != ErrorKind::NotFound
            {
                tracing::warn!(%error, path = %old.display(), "a file that is in the bucket too cannot be removed here");
            }
        }
    }

    /// Stores a file or all files in a folder of this machine under the name in the bucket. Gives their places below `to`, and their bytes.
    fn send(&self, from: &Path, to: &Path, name: &str) -> io::Result<Vec<(PathBuf, u64)>> {
        let entries = match self.disk.list(from) {
            Ok(entries) => entries,
            Err(error) if error.kind() == ErrorKind::NotADirectory => {
                self.blobs.put_file(name, from)?;
                return Ok(vec![(to.to_owned(), self.blobs.bytes(name).unwrap_or(0))]);
            }
            Err(error) => return Err(error),
        };
        let mut sent = Vec::new();
        for entry in entries {
            let file = entry.name.to_str().ok_or(ErrorKind::InvalidFilename)?;
            sent.extend(self.send(&from.join(file), &to.join(file), &format!("{name}/{file}"))?);
        }
        Ok(sent)
    }

    /// Puts a temporary file or folder in place.
    fn publish(&self, from: &Path, to: &Path, name: &str) -> io::Result<()> {
        let turn = self.turn(to);
        let _turn = lock(&turn);
        let is_folder = self.disk.list(from).is_ok();
        // As on a disk.
        if is_folder && self.blobs.has_folder(name) {
            return Err(ErrorKind::DirectoryNotEmpty.into());
        }
        let sent = self.send(from, to, name).inspect_err(|_| {
            if is_folder {
                // What of it was sent is of no use.
                let _ = self.blobs.remove(name);
            }
        })?;
        let placed = self.make_parents(to).and_then(|()| self.disk.rename(from, to));
        if let Err(error) = placed {
            // The bucket has the new one: what is here would be taken for that.
            return match self.disk.remove_file(to) {
                Err(gone) if !is_folder && gone.kind() == ErrorKind::NotFound => Ok(()),
                Ok(()) if !is_folder => Ok(()),
                _ => Err(error),
            };
        }
        sent.iter().for_each(|(path, bytes)| self.keep(path, *bytes));
        Ok(())
    }

    /// Removes what the bucket has of a path. In the folder of a record nothing is stored any more afterwards.
    fn remove_there(&self, path: &Path, name: &str) -> io::Result<()> {
        self.cached.forget(path);
        let mut names = name.split('/');
        let is_record =
            names.next().is_some_and(|first| RECORDS.contains(&first)) && names.nth(1).is_none() && name.contains('/');
        if is_record { self.blobs.remove_for_good(name) } else { self.blobs.remove(name) }
    }
}

fn unless_there(made: io::Result<()>) -> io::Result<()> {
    made.or_else(|error| if error.kind() == ErrorKind::AlreadyExists { Ok(()) } else { Err(error) })
}

impl Disk for MirroredDisk {
    fn create_new(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        let name = self.name(path);
        if name.is_some_and(|name| self.blobs.bytes(name).is_some()) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        if name.is_some() {
            self.make_parents(path)?;
        }
        Ok(Arc::new(self.written(self.disk.create_new(path)?, path, name)))
    }

    fn open(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        self.having(path, || self.disk.open(path))
    }

    fn open_for_writing(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        let file = self.having(path, || self.disk.open_for_writing(path))?;
        Ok(Arc::new(self.written(file, path, self.name(path))))
    }

    fn create_dir(&self, path: &Path) -> io::Result<()> {
        self.disk.create_dir(path)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        match (self.name(from), self.name(to)) {
            (None, None) => self.disk.rename(from, to),
            (None, Some(name)) => self.publish(from, to, name),
            (Some(name), None) => {
                let turn = self.turn(from);
                let _turn = lock(&turn);
                // Here first: where the bucket does not answer it is gone all the same.
                let moved = self.disk.rename(from, to);
                self.remove_there(from, name)?;
                moved
            }
            (Some(was), Some(is)) => {
                let turn = self.turn(from);
                let _turn = lock(&turn);
                self.blobs.rename(was, is)?;
                self.cached.forget(from);
                match self.make_parents(to).and_then(|()| self.disk.rename(from, to)) {
                    // Not all of it was here.
                    Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
                    renamed => renamed,
                }
            }
        }
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        let Some(name) = self.name(path) else { return self.disk.remove_file(path) };
        let turn = self.turn(path);
        let _turn = lock(&turn);
        if self.blobs.bytes(name).is_none() {
            let is_folder = self.blobs.has_folder(name);
            return if is_folder { Err(ErrorKind::IsADirectory.into()) } else { self.disk.remove_file(path) };
        }
        let removed = self.disk.remove_file(path);
        self.remove_there(path, name)?;
        match removed {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            removed => removed,
        }
    }

    fn remove_dir(&self, path: &Path) -> io::Result<()> {
        match self.name(path).is_some_and(|name| self.blobs.has_folder(name)) {
            true => Err(ErrorKind::DirectoryNotEmpty.into()),
            false => self.disk.remove_dir(path),
        }
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Entry>> {
        let Some(name) = self.name(path) else { return self.disk.list(path) };
        let listed = self.blobs.list(name);
        let mut entries = match self.disk.list(path) {
            // Folders without files are made when there are some.
            Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
            entries => entries?,
        };
        // What was written and is not in the bucket yet is told as it is here.
        let names: HashSet<&str> = listed.iter().map(|there| &there.name[..]).collect();
        entries.retain(|entry| entry.name.to_str().is_none_or(|name| !names.contains(name)));
        entries.extend(listed.into_iter().map(|there| Entry {
            name: there.name.into(),
            is_dir: there.is_folder,
            bytes: there.bytes,
            modified: SystemTime::UNIX_EPOCH,
        }));
        Ok(entries)
    }

    fn sync_dir(&self, path: &Path) -> io::Result<()> {
        // Durable is what the bucket has.
        if self.name(path).is_some() { Ok(()) } else { self.disk.sync_dir(path) }
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        self.disk.touch(path)
    }

    fn lock(&self, path: &Path) -> io::Result<Option<File>> {
        self.disk.lock(path)
    }

    fn free_bytes(&self, path: &Path) -> io::Result<u64> {
        self.disk.free_bytes(path)
    }

    fn catalog(&self, path: &Path) -> Result<Arc<dyn Catalog>, CatalogError> {
        self.disk.catalog(path)
    }

    fn bring(&self, path: &Path) -> io::Result<()> {
        if let Some(name) = self.name(path) {
            for there in self.blobs.list(name) {
                self.bring(&path.join(there.name))?;
            }
        }
        self.open(path).map(drop)
    }

    fn is_elsewhere(&self) -> bool {
        true
    }

    fn probe(&self) -> io::Result<()> {
        self.blobs.probe()
    }
}

impl MirroredDisk {
    fn written(&self, file: Arc<dyn DiskFile>, path: &Path, name: Option<&str>) -> Written {
        let place =
            name.map(|name| Place { blobs: Arc::clone(&self.blobs), name: name.to_owned(), path: path.to_owned() });
        Written { file, place, ranges: Mutex::default() }
    }
}

/// Where a file is in the bucket.
#[derive(Debug)]
struct Place {
    blobs: Arc<Blobs>,
    name: String,
    path: PathBuf,
}

/// A file that is written to. Syncing sends what was written; a temporary one is sent when it is put in place.
#[derive(Debug)]
struct Written {
    file: Arc<dyn DiskFile>,
    place: Option<Place>,
    /// What was written and not sent, from byte to byte.
    ranges: Mutex<Vec<(u64, u64)>>,
}

impl DiskFile for Written {
    fn write_at(&self, bytes: &[u8], offset: u64) -> io::Result<usize> {
        let written = self.file.write_at(bytes, offset)?;
        if self.place.is_some() {
            let (mut ranges, end) = (lock(&self.ranges), offset + written as u64);
            match ranges.last_mut() {
                Some((_, last)) if *last == offset => *last = end,
                _ => ranges.push((offset, end)),
            }
        }
        Ok(written)
    }

    fn read_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
        self.file.read_at(bytes, offset)
    }

    fn sync_data(&self) -> io::Result<()> {
        let Some(place) = &self.place else { return self.file.sync_data() };
        let mut ranges = lock(&self.ranges);
        while let Some((start, end)) = ranges.first().copied() {
            let mut bytes = vec![0; (end - start) as usize];
            self.file.read_exact_at(&mut bytes, start)?;
            place.blobs.put_piece(&place.name, start, &bytes)?;
            ranges.remove(0);
        }
        Ok(())
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        match &self.place {
            // Nothing does so; the bucket would have the rest yet.
            Some(place) => Err(io::Error::other(format!("{} cannot be cut in the bucket", place.path.display()))),
            None => self.file.set_len(bytes),
        }
    }

    fn length(&self) -> io::Result<u64> {
        self.file.length()
    }
}
