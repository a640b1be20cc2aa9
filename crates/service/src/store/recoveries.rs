//! Recoveries: what was sent, frame by frame, and what was made of it.

use super::files::Files;
use super::jobs::job_meta;
use super::{Idempotency, Kind, NamedFile, Store, StoreError, StoredPart, meta};
use cager_proto::recovery_messages::RecoveryOptions;
use cager_store::{Change, Key};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Metadata of a recovery, fixed at its creation.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct RecoveryMeta {
    /// Its id; also the name of its folder.
    pub id: String,
    /// Tenant that owns it.
    pub tenant: String,
    /// Creation time, milliseconds since 1970.
    pub created_ms: u64,
    /// Options as requested.
    pub options: RecoveryOptions,
    /// Points of the template.
    pub points: u32,
    /// What is subtracted from all points, where they lie far away.
    pub origin: Option<[f64; 3]>,
    /// The files.
    pub parts: RecoveryParts<StoredPart>,
    /// Idempotency key and fingerprint of the request that created it.
    pub idempotency: Option<Idempotency>,
}

/// What a recovery is made from, beside its frames.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct RecoveryParts<T> {
    /// The template.
    pub template: T,
    /// A cage of its own.
    pub cage: Option<T>,
    /// The rig of a person.
    pub rig: Option<T>,
    /// Its usual poses.
    pub manifold: Option<T>,
}

impl<T> RecoveryParts<T> {
    /// Each with its name.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &T)> {
        let others = [("cage", &self.cage), ("rig", &self.rig), ("manifold", &self.manifold)];
        let others = others.into_iter().filter_map(|(name, part)| Some((name, part.as_ref()?)));
        std::iter::once((TEMPLATE, &self.template)).chain(others)
    }

    /// Something else of each.
    ///
    /// # Errors
    /// The first of `of`.
    pub fn map<U, E>(&self, mut of: impl FnMut(&'static str, &T) -> Result<U, E>) -> Result<RecoveryParts<U>, E> {
        let mut other = |name, part: &Option<T>| part.as_ref().map(|part| of(name, part)).transpose();
        let (cage, rig, manifold) =
            (other("cage", &self.cage)?, other("rig", &self.rig)?, other("manifold", &self.manifold)?);
        Ok(RecoveryParts { template: of(TEMPLATE, &self.template)?, cage, rig, manifold })
    }
}

job_meta!(RecoveryMeta, Kind::Recovery, |meta| meta.parts.named().map(|(_, part)| part.bytes).sum());

const TEMPLATE: &str = "template";
const FRAME: &str = "frame-";
/// Most bytes before the content of a frame's file: a name and a digest.
const HEAD_BYTES: u64 = 4096;

impl Store {
    /// Creates a recovery; durable on `Ok`.
    pub fn create_recovery(&self, meta: &RecoveryMeta, parts: &RecoveryParts<NamedFile>) -> Result<(), StoreError> {
        self.create_job(meta, parts.named().map(|(name, part)| (name, &part.bytes[..])), None)
    }

    /// The files of a recovery that is not over.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn recovery_parts(&self, meta: &RecoveryMeta) -> Result<RecoveryParts<NamedFile>, StoreError> {
        meta.parts.map(|name, part| {
            let bytes = self.job_part(Kind::Recovery, &meta.id, name, part)?;
            Ok(NamedFile { name: part.name.clone(), bytes })
        })
    }

    /// Stores a frame as it was sent; durable on `Ok`.
    ///
    /// # Errors
    /// Not found where the recovery was deleted.
    pub fn put_recovery_frame(
        &self,
        id: &str,
        frame: u32,
        part: &StoredPart,
        content: &[u8],
    ) -> Result<(), StoreError> {
        let (files, place) = (self.files(), self.folder(Kind::Recovery, id)?.join(format!("{FRAME}{frame}")));
        let head = meta::wrap(&place, "frame", part)?;
        let temporary = files.temporary("frame");
        let write = || {
            let file = files.create(&temporary)?;
            let written = file.write_all_at(&head, 0).and_then(|()| file.write_all_at(content, head.len() as u64));
            written.map_err(|e| StoreError::of(&temporary, "write", e))?;
            files.sync_file(&*file, &temporary)?;
            files.publish(&temporary, &place)
        };
        write().inspect_err(|_| files.discard(&temporary))
    }

    /// The frames that are there, by their numbers.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn recovery_frames(&self, id: &str) -> Result<Vec<(u32, StoredPart)>, StoreError> {
        let (files, folder) = (self.files(), self.folder(Kind::Recovery, id)?);
        let mut frames = Vec::new();
        for name in frame_names(files, &folder)? {
            let path = folder.join(&name);
            let frame = name[FRAME.len()..].parse();
            let frame = frame.map_err(|_| StoreError::damaged(&path, "its name has no number of a frame"))?;
            let file = files.open_expected(&path)?;
            let failed = |e| StoreError::of(&path, "read", e);
            let mut head = vec![0; file.length().map_err(failed)?.min(HEAD_BYTES) as usize];
            file.read_exact_at(&mut head, 0).map_err(failed)?;
            frames.push((frame, split(&path, &head)?.0));
        }
        frames.sort_by_key(|(frame, _)| *frame);
        Ok(frames)
    }

    /// The content of a frame.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn recovery_frame(&self, id: &str, frame: u32, part: &StoredPart) -> Result<Vec<u8>, StoreError> {
        let path = self.folder(Kind::Recovery, id)?.join(format!("{FRAME}{frame}"));
        let found = self.files().read(&path, part.bytes + HEAD_BYTES)?;
        let mut found = found.ok_or_else(|| StoreError::damaged(&path, "it is missing"))?;
        let (_, head) = split(&path, &found)?;
        found.drain(..head);
        if found.len() as u64 != part.bytes || blake3::hash(&found).to_hex().as_str() != part.blake3 {
            return Err(StoreError::damaged(&path, "its content does not match its checksum"));
        }
        Ok(found)
    }

    /// Notes durably how many frames a recovery has in all.
    ///
    /// # Errors
    /// Not found where it was deleted.
    pub fn declare_recovery(&self, id: &str, frames: u32) -> Result<(), StoreError> {
        self.change(Key { kind: Kind::Recovery, id }, &[Change::Declared(frames)])
    }

    /// How many frames a recovery has in all, where that was said.
    pub fn declared_recovery(&self, id: &str) -> Result<Option<u32>, StoreError> {
        Ok(self.record(Kind::Recovery, id)?.and_then(|record| record.declared))
    }

    /// How many frames of a recovery were ever followed, as far as was noted.
    pub fn reached_recovery(&self, id: &str) -> Result<u32, StoreError> {
        Ok(self.record(Kind::Recovery, id)?.map_or(0, |record| record.reached))
    }

    /// Notes durably that more frames than ever before were followed, so that the attempts before count no longer.
    ///
    /// # Errors
    /// Not found where it was deleted.
    pub fn note_reached_recovery(&self, id: &str, frames: u32) -> Result<(), StoreError> {
        self.change(Key { kind: Kind::Recovery, id }, &[Change::Reached(frames), Change::Attempts(0)])
    }

    /// Removes the input of a recovery that is over, best effort: files that remain are removed at the next start.
    pub fn forget_recovery_input(&self, id: &str) {
        let folder = self.folder(Kind::Recovery, id);
        let frames = folder.and_then(|folder| frame_names(self.files(), &folder)).unwrap_or_default();
        self.forget_files(Kind::Recovery, id, frames);
        self.forget_files(Kind::Recovery, id, [TEMPLATE, "cage", "rig", "manifold"]);
    }
}

fn frame_names(files: &Files, folder: &Path) -> Result<Vec<String>, StoreError> {
    let entries = files.list(folder)?;
    let names = entries.into_iter().map(|entry| entry.name.to_string_lossy().into_owned());
    Ok(names.filter(|name| name.starts_with(FRAME)).collect())
}

/// The description at the start of a frame's file, and where its content begins.
fn split(path: &Path, file: &[u8]) -> Result<(StoredPart, usize), StoreError> {
    let cut = || StoreError::damaged(path, "it has no description");
    let end = file.iter().position(|&byte| byte == b'\n').ok_or_else(cut)? + 1;
    meta::unwrap(&file[..end], "frame").map(|part| (part, end)).map_err(|what| StoreError::damaged(path, what))
}
