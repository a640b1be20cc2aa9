//! The bucket of a service, and how it and the data folder know each other: by the number that the folder and the database have, which the bucket has too.

use super::database::{LIMIT, NUMBER};
use super::files::Files;
use super::import::is_without_records;
use super::mirrored::{FOLDERS, MirroredDisk};
use super::{CATALOG, StoreError};
use cager_store::Blobs;
use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::sync::Arc;

/// Has the address of the bucket where the folder's files are in one.
const MARKER: &str = "catalog.bucket";

/// Opens the bucket at `url` for the process that has taken the database as the so-manieth, and makes the folder a cache of it. The first time the bucket gets
/// what the folder has.
pub(super) fn open(files: &Files, url: &str, taken: i64, kept_bytes: u64) -> Result<Files, StoreError> {
    let text = |(name, value): (OsString, OsString)| Some((name.into_string().ok()?, value.into_string().ok()?));
    let blobs = Blobs::open(url, taken, std::env::vars_os().filter_map(text)).map_err(|error| StoreError::Catalog {
        path: "the bucket".into(),
        action: "reach",
        what: error.to_string(),
    })?;
    let root = &files.root;
    let elsewhere =
        |what: &str| StoreError::Elsewhere { what: format!("the data folder {} and {url}: {what}", root.display()) };
    let is_known = files.exists(&root.join(MARKER))?;
    let own = files.read(&root.join(NUMBER), LIMIT)?;
    let is_new = blobs.bytes(NUMBER).is_none();
    if is_new {
        if !blobs.is_empty() && !is_known {
            return Err(elsewhere("files of something else are in the bucket; name another path in it by --blobs"));
        }
        note(files, url)?;
        send_all(files, &blobs)?;
    } else {
        let staging = files.temporary("number");
        let fetched = files.create(&staging).and_then(|_| {
            let file = std::fs::File::options().write(true).open(&staging);
            let fetched = file.and_then(|file| blobs.fetch(NUMBER, &file));
            fetched.map_err(|error| StoreError::of(&root.join(NUMBER), "fetch", error))?;
            files.read(&staging, LIMIT)
        });
        files.discard(&staging);
        let there = fetched?;
        let has_own = own.is_none() && (files.exists(&root.join(CATALOG))? || is_without_records(files)?);
        if has_own || (own.is_some() && (own != there || !is_known)) {
            return Err(elsewhere(
                "they do not belong together; name the right ones by --data and --blobs, or an empty folder",
            ));
        }
        note(files, url)?;
    }
    // What a process before this one has left may be old.
    for folder in FOLDERS {
        files.clear(&root.join(folder))?;
    }
    if own.is_some() {
        files.remove_file(&root.join(NUMBER))?;
    }
    let disk = MirroredDisk::new(Arc::clone(&files.disk), blobs, root, NUMBER, kept_bytes);
    Ok(Files::new(root, Arc::new(disk)))
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

/// Stores all files of the folder in the bucket, the folder's number last.
fn send_all(files: &Files, blobs: &Blobs) -> Result<(), StoreError> {
    let mut sent = 0_u64;
    for folder in FOLDERS {
        sent += send(files, blobs, &files.root.join(folder), folder)?;
    }
    if files.exists(&files.root.join(NUMBER))? {
        put(blobs, &files.root.join(NUMBER), NUMBER)?;
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
