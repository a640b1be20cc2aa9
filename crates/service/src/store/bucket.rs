//! The bucket of a service, and how it and the data folder know each other: by the number that the folder and the database have, which the bucket has too.

use super::database::{LIMIT, NUMBER};
use super::files::Files;
use super::mirrored::{FOLDERS, MirroredDisk};
use super::records::has_objects;
use super::{CATALOG, StoreError};
use cager_store::Blobs;
use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::sync::Arc;

/// Has the address of the bucket where the folder's files are in one.
pub(super) const MARKER: &str = "catalog.bucket";

/// An opened bucket, and the folder that is a cache of it.
pub(super) struct Bucket {
    pub(super) files: Files,
    blobs: Arc<Blobs>,
}

/// Opens the bucket at `url` for the process that has taken the database as the so-manieth, and makes the folder a cache of it. The first time the bucket gets
/// what the folder has.
pub(super) fn open(files: &Files, url: &str, taken: i64, kept_bytes: u64) -> Result<Bucket, StoreError> {
    let text = |(name, value): (OsString, OsString)| Some((name.into_string().ok()?, value.into_string().ok()?));
    let blobs = Blobs::open(url, taken, std::env::vars_os().filter_map(text)).map_err(|error| StoreError::Catalog {
        path: "the bucket".into(),
        action: "reach",
        what: error.to_string(),
    })?;
    let root = &files.root;
    let elsewhere =
        |what: &str| StoreError::Elsewhere { what: format!("the data folder {} and {url}: {what}", root.display()) };
    // A folder that knows its bucket is a cache of it, or was being sent there.
    let is_known = files.exists(&root.join(MARKER))?;
    let own = files.read(&root.join(NUMBER), LIMIT)?;
    if blobs.bytes(NUMBER).is_none() {
        if !blobs.is_empty() && !is_known {
            return Err(elsewhere(
                "there are files in the bucket, of something else or of a folder that was not sent as a whole; start the service with that folder first, or name another path in the bucket by --blobs",
            ));
        }
        note(files, url)?;
        send_all(files, &blobs)?;
    } else {
        let there = number(files, &blobs)?;
        let is_used = || Ok(files.exists(&root.join(CATALOG))? || has_objects(files)?);
        if own.as_ref().is_some_and(|own| *own != there) || (!is_known && (own.is_some() || is_used()?)) {
            return Err(elsewhere(
                "they do not belong together; name the right ones by --data and --blobs, or a folder that is new",
            ));
        }
        note(files, url)?;
        if own.is_none() {
            files.replace(&root.join(NUMBER), &there)?;
        }
    }
    // What a process before this one has left may be old.
    for folder in FOLDERS {
        let (folder, away) =
            (root.join(folder), files.trash.join(format!("{folder}.{}", uuid::Uuid::now_v7().simple())));
        let emptied = files.disk.rename(&folder, &away).and_then(|()| files.disk.create_dir(&folder));
        emptied.map_err(|error| StoreError::of(&folder, "empty", error))?;
    }
    let (trash, disk) = (files.trash.clone(), Arc::clone(&files.disk));
    let root_of = root.clone();
    let clearing = std::thread::Builder::new().name("emptying".to_owned());
    // What is left goes with the next start.
    let _ = clearing.spawn(move || Files::new(&root_of, disk).clear(&trash));
    let blobs = Arc::new(blobs);
    let disk = MirroredDisk::new(Arc::clone(&files.disk), Arc::clone(&blobs), root, kept_bytes);
    Ok(Bucket { files: Files::new(root, Arc::new(disk)), blobs })
}

impl Bucket {
    /// Notes that the folder's files and records are all where they belong: other machines may go on with them from now on.
    pub(super) fn completed(self) -> Result<Files, StoreError> {
        if self.blobs.bytes(NUMBER).is_none() {
            put(&self.blobs, &self.files.root.join(NUMBER), NUMBER)?;
        }
        Ok(self.files)
    }
}

/// The folder's number that the bucket has.
fn number(files: &Files, blobs: &Blobs) -> Result<Vec<u8>, StoreError> {
    let staging = files.temporary("number");
    let failed = |error| StoreError::of(&staging, "fetch", error);
    let fetched = files.create(&staging).and_then(|_| {
        let file = std::fs::File::options().write(true).open(&staging).map_err(failed)?;
        blobs.fetch(NUMBER, &file).map_err(failed)?;
        files.read(&staging, LIMIT)
    });
    files.discard(&staging);
    Ok(fetched?.unwrap_or_default())
}

/// Whether the folder has its files itself, and is no cache of a bucket.
pub(super) fn is_own(files: &Files) -> Result<bool, StoreError> {
    let there = |name| files.exists(&files.root.join(name));
    Ok(!there(MARKER)? && (there(NUMBER)? || there(CATALOG)?))
}

/// Refuses a folder whose files are in a bucket.
pub(super) fn refuse(files: &Files) -> Result<(), StoreError> {
    let Some(url) = files.read(&files.root.join(MARKER), LIMIT)? else { return Ok(()) };
    let url = String::from_utf8_lossy(&url).trim().to_owned();
    let root = files.root.display();
    Err(StoreError::Elsewhere {
        what: format!("the files of the data folder {root} are in a bucket: name it by --blobs {url}"),
    })
}

fn note(files: &Files, url: &str) -> Result<(), StoreError> {
    let path = files.root.join(MARKER);
    let line = format!("{url}\n");
    if files.read(&path, LIMIT)?.is_some_and(|there| there == line.as_bytes()) {
        return Ok(());
    }
    files.replace(&path, line.as_bytes())
}

/// Stores all files of the folder in the bucket.
fn send_all(files: &Files, blobs: &Blobs) -> Result<(), StoreError> {
    let mut sent = 0_u64;
    for folder in FOLDERS {
        sent += send(files, blobs, &files.root.join(folder), folder)?;
    }
    if sent > 0 {
        tracing::info!(files = sent, bucket = blobs.name(), "the folder's files are in the bucket now");
    }
    Ok(())
}

fn send(files: &Files, blobs: &Blobs, folder: &Path, name: &str) -> Result<u64, StoreError> {
    let mut sent = 0;
    for entry in files.list(folder)? {
        let path = folder.join(&entry.name);
        let file =
            entry.name.to_str().ok_or_else(|| StoreError::of(&path, "send", io::ErrorKind::InvalidFilename.into()))?;
        let name = format!("{name}/{file}");
        if entry.is_dir {
            sent += send(files, blobs, &path, &name)?;
        } else if blobs.bytes(&name) != Some(entry.bytes) {
            // An earlier start may have sent it; what is there has not changed since, as nobody has used the folder.
            put(blobs, &path, &name)?;
            sent += 1;
        }
    }
    Ok(sent)
}

fn put(blobs: &Blobs, path: &Path, name: &str) -> Result<(), StoreError> {
    blobs.put_file(name, path).map_err(|error| StoreError::of(path, "send", error))
}
