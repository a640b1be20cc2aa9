//! Sessions whose frames are coded in groups: frames as they came, until their group is coded, and coded groups.

use super::{Kind, Store, StoreError};
use cager_proto::wire;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io;
use std::path::{Path, PathBuf};

/// Most bytes of a group's file.
const MAX_GROUP_BYTES: usize = 1 << 30;
/// Bytes of the digest that a group's file ends with.
const DIGEST: usize = 32;

const FRAMES: &str = "frames-";
const GROUP: &str = "group-";
/// Groups that belong to a completion: without its mark they are none.
const LAST: &str = "last-";

impl Store {
    fn part(&self, id: &str, kind: &str, first: u32) -> Result<PathBuf, StoreError> {
        Ok(self.folder(Kind::Session, id)?.join(format!("{kind}{first:010}")))
    }

    /// Writes frames, `stride` bytes each, into the file that begins with frame `first`; durable on `Ok`, with `is_known` where the file's name
    /// was durable before. They have no checksum: the catalogue has their digests.
    pub fn put_frames(
        &self,
        id: &str,
        first: u32,
        is_known: bool,
        stride: usize,
        frames: &[(u32, &[u8])],
    ) -> Result<(), StoreError> {
        let (files, path) = (self.files(), self.part(id, FRAMES, first)?);
        let file = match files.disk.open_for_writing(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound && !is_known => files.create(&path)?,
            opened => opened.map_err(|e| StoreError::of(&path, "open", e))?,
        };
        for (frame, bytes) in frames {
            let offset = u64::from(frame - first) * stride as u64;
            file.write_all_at(bytes, offset).map_err(|e| StoreError::of(&path, "write", e))?;
        }
        files.sync_file(&*file, &path)?;
        if is_known { Ok(()) } else { files.sync_dir(super::files::parent(&path)) }
    }

    /// Reads a frame, as long as `bytes`, from the file that begins with frame `first`.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where it is gone.
    pub fn read_frame(&self, id: &str, first: u32, frame: u32, bytes: &mut [u8]) -> Result<(), StoreError> {
        let path = self.part(id, FRAMES, first)?;
        let offset = u64::from(frame - first) * bytes.len() as u64;
        let read = self.files().disk.open(&path).and_then(|file| file.read_exact_at(bytes, offset));
        read.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::UnexpectedEof => {
                StoreError::damaged(&path, format!("frame {frame} is gone"))
            }
            _ => StoreError::of(&path, "read", error),
        })
    }

    /// Removes all files of frames, or the one that begins with `first`.
    pub fn remove_frames(&self, id: &str, first: Option<u32>) -> Result<(), StoreError> {
        match first {
            Some(first) => self.files().remove_tree(&self.part(id, FRAMES, first)?),
            None => self.remove_parts(id, |name| name.starts_with(FRAMES)),
        }
    }

    /// Stores a coded group, atomically; durable on `Ok`. Returns the bytes of its file. A group that is `last` counts only with the mark of
    /// the completion that it was coded for.
    pub fn put_group<T: Serialize>(&self, id: &str, first: u32, last: bool, group: &T) -> Result<u64, StoreError> {
        let path = self.part(id, if last { LAST } else { GROUP }, first)?;
        let encoded = wire::encode::<_, MAX_GROUP_BYTES>(group);
        let mut bytes = encoded.map_err(|e| StoreError::of(&path, "write", io::Error::other(e)))?;
        let digest = blake3::hash(&bytes);
        bytes.extend_from_slice(digest.as_bytes());
        self.files().replace(&path, &bytes)?;
        Ok(bytes.len() as u64)
    }

    /// The coded group that begins with `first`, and the bytes of its file; with `last` also one of a completion. `None` if it has not been
    /// stored.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn group<T: DeserializeOwned>(&self, id: &str, first: u32, last: bool) -> Result<Option<(T, u64)>, StoreError> {
        match self.read_group(&self.part(id, GROUP, first)?)? {
            None if last => self.read_group(&self.part(id, LAST, first)?),
            found => Ok(found),
        }
    }

    fn read_group<T: DeserializeOwned>(&self, path: &Path) -> Result<Option<(T, u64)>, StoreError> {
        let Some(file) = self.files().read(path, (MAX_GROUP_BYTES + DIGEST) as u64)? else { return Ok(None) };
        let damaged = |what: String| StoreError::damaged(path, what);
        let (bytes, _) = file
            .split_last_chunk::<DIGEST>()
            .filter(|(bytes, digest)| blake3::hash(bytes) == **digest)
            .ok_or_else(|| damaged("its content does not match its checksum".to_owned()))?;
        let group = wire::decode::<_, MAX_GROUP_BYTES>(bytes).map_err(|error| damaged(error.to_string()))?;
        Ok(Some((group, file.len() as u64)))
    }

    /// Removes the groups of a completion that did not come about.
    pub fn remove_last_groups(&self, id: &str) -> Result<(), StoreError> {
        self.remove_parts(id, |name| name.starts_with(LAST))
    }

    /// Removes coded groups that begin with `from` or later.
    pub fn remove_groups_from(&self, id: &str, from: u32) -> Result<(), StoreError> {
        let later = |name: &str| {
            let first = name.strip_prefix(GROUP).or_else(|| name.strip_prefix(LAST));
            first.and_then(|n| n.parse().ok()).is_some_and(|n: u32| n >= from)
        };
        self.remove_parts(id, later)
    }

    fn remove_parts(&self, id: &str, is_one: impl Fn(&str) -> bool) -> Result<(), StoreError> {
        let (files, folder) = (self.files(), self.folder(Kind::Session, id)?);
        for entry in files.list(&folder)? {
            if entry.name.to_str().is_some_and(&is_one) {
                files.remove_tree(&folder.join(&entry.name))?;
            }
        }
        Ok(())
    }
}
