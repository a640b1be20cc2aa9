//! Reading all that is stored, to find what is damaged.

use super::cage_jobs::CAGE;
use super::files::Files;
use super::records::outcome_of;
use super::sessions::Completion;
use super::{Content, ContentKey, Kind, Store, StoreError, StoredPart};
use cager_store::Key;
use serde_json::Value;
use std::io;
use std::path::Path;

/// Bytes read at a time.
const PIECE: usize = 1 << 20;

/// What was read of an object.
#[derive(Debug, Default)]
pub struct Verified {
    /// Bytes of its files and frames.
    pub bytes: u64,
    /// What is damaged or missing.
    pub damage: Vec<String>,
}

impl Verified {
    fn note<T>(&mut self, outcome: Result<T, StoreError>) -> Option<T> {
        outcome.map_err(|error| self.damage.push(error.to_string())).ok()
    }
}

impl Store {
    /// Reads everything that is stored of a session or job, and changes nothing.
    ///
    /// # Errors
    /// The catalogue cannot be read.
    pub fn verify(&self, kind: Kind, id: &str) -> Result<Verified, StoreError> {
        let mut found = Verified::default();
        let record = self.catalog().record(Key { kind, id }).map_err(|e| self.failed("read", e))?;
        let Some(record) = record else { return Ok(found) };
        found.damage.extend(record.damage.clone());
        found.bytes = record.frame_bytes + found.note(self.bytes(kind, id)).unwrap_or(0);
        let folder = self.folder(kind, id)?;
        if kind == Kind::Session {
            found.note(self.check_frames(id));
            if let Some(mark) = found.note(self.completion(id)).flatten() {
                found.damage.extend(self.container_damage(id, &mark));
            }
            for entry in found.note(self.files().list(&folder)).unwrap_or_default() {
                if entry.name.to_str().is_some_and(|name| name.starts_with("group-") || name.starts_with("last-")) {
                    found.note(self.files().check_tail(&folder.join(&entry.name)));
                }
            }
            return Ok(found);
        }
        // Until it is over its input is there; afterwards its results are.
        let files = match &record.outcome {
            Some(outcome) => self.unsealed((kind, id), outcome_of(kind), outcome).map(|said| results_of(kind, &said)),
            None => self.unsealed((kind, id), kind.name(), &record.meta).map(|said: Value| parts(&said)),
        };
        for (name, part) in found.note(files).unwrap_or_default() {
            found.note(self.files().check_digest(&folder.join(name), part.bytes, &part.blake3));
        }
        if kind == Kind::Recovery && record.outcome.is_none() {
            for (frame, part) in found.note(self.recovery_frames(id)).unwrap_or_default() {
                found.note(self.recovery_frame(id, frame, &part));
            }
        }
        Ok(found)
    }

    /// The results of a job, as they are named in its folder; none where it is not completed.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn results(&self, kind: Kind, id: &str) -> Result<Vec<StoredPart>, StoreError> {
        let said: Option<Value> = self.outcome(kind, id)?;
        let results = said.map(|said| results_of(kind, &said)).unwrap_or_default();
        Ok(results.into_iter().map(|(name, part)| StoredPart { name, ..part }).collect())
    }

    /// What is wrong with a file of a job; reads all of it.
    pub fn result_damage(&self, kind: Kind, id: &str, part: &StoredPart) -> Option<String> {
        let checked = self
            .job_file(kind, id, &part.name)
            .and_then(|path| self.files().check_digest(&path, part.bytes, &part.blake3));
        checked.err().map(|error| error.to_string())
    }

    /// What is wrong with the container of a completed session, and what to do; reads all of it.
    pub fn container_damage(&self, id: &str, mark: &Completion) -> Option<String> {
        let path = self.container_path(id);
        let error = self.files().check_digest(&path, mark.container_bytes, &mark.container_digest).err()?;
        // In a bucket the service looks at its length alone.
        let is_noticed = !self.files().disk.is_elsewhere();
        Some(match error {
            StoreError::Damaged { path, what } if is_noticed => {
                let path = path.display();
                format!("{path} is damaged: {what}; complete the session again, restore it from a backup, or delete it")
            }
            error => error.to_string(),
        })
    }

    /// Reads the rest pose, the cage and the matrix of sessions with this key, and changes nothing.
    pub fn verify_content(&self, key: &ContentKey) -> Verified {
        let mut found = Verified::default();
        let place = self.content_path(key);
        match found.note(self.read_content(&place)) {
            Some(Some(content)) => found.bytes = Content::size_bytes(&content),
            Some(None) => found.damage.push(format!("{} is missing; restore it from a backup", place.display())),
            None => {}
        }
        found
    }
}

/// The files that the outcome of a job describes, with the names that they have there.
fn results_of(kind: Kind, outcome: &Value) -> Vec<(String, StoredPart)> {
    let found = outcome.get("completed").filter(|_| kind == Kind::CageJob);
    let cage = found.and_then(|found| Some((found.get("cage_bytes")?.as_u64()?, found.get("cage_digest")?.as_str()?)));
    match cage {
        Some((bytes, digest)) => {
            let name = CAGE.to_owned();
            vec![(name.clone(), StoredPart { name, bytes, blake3: digest.to_owned() })]
        }
        None => parts(outcome),
    }
}

/// Files that are described in what is said of a job, with the names that they have there.
fn parts(said: &Value) -> Vec<(String, StoredPart)> {
    let within = |(name, value): (String, &Value)| match serde_json::from_value::<StoredPart>(value.clone()) {
        // What was sent lies under the name of its part, results under their own.
        Ok(part) if name.is_empty() => vec![(part.name.clone(), part)],
        Ok(part) => vec![(name, part)],
        Err(_) => parts(value),
    };
    match said {
        Value::Object(fields) => fields.iter().flat_map(|(name, value)| within((name.clone(), value))).collect(),
        Value::Array(items) => items.iter().flat_map(|value| within((String::new(), value))).collect(),
        _ => Vec::new(),
    }
}

impl Files {
    /// Checks a file's length and digest, BLAKE3, hexadecimal.
    fn check_digest(&self, path: &Path, bytes: u64, digest: &str) -> Result<(), StoreError> {
        let (found, length) = self.digest(path, 0)?;
        if length == bytes && found.to_hex().as_str() == digest {
            return Ok(());
        }
        Err(StoreError::damaged(path, "its content does not match its checksum"))
    }

    /// Checks a file that ends with the digest of what is before.
    fn check_tail(&self, path: &Path) -> Result<(), StoreError> {
        let (found, length) = self.digest(path, blake3::OUT_LEN as u64)?;
        let mut tail = [0; blake3::OUT_LEN];
        let read = self.open_expected(path)?.read_exact_at(&mut tail, length);
        read.map_err(|e| StoreError::of(path, "read", e))?;
        if found == blake3::Hash::from_bytes(tail) {
            return Ok(());
        }
        Err(StoreError::damaged(path, "its content does not match its checksum"))
    }

    /// Digest of all but the last `rest` bytes of a file, and how many that are.
    fn digest(&self, path: &Path, rest: u64) -> Result<(blake3::Hash, u64), StoreError> {
        let file = self.open_expected(path)?;
        let read = || -> io::Result<(blake3::Hash, u64)> {
            let bytes = file.length()?.saturating_sub(rest);
            let (mut digest, mut piece) = (blake3::Hasher::new(), vec![0; PIECE]);
            let mut at = 0;
            while at < bytes {
                let piece = &mut piece[..(bytes - at).min(PIECE as u64) as usize];
                file.read_exact_at(piece, at)?;
                digest.update(piece);
                at += piece.len() as u64;
            }
            Ok((digest.finalize(), bytes))
        };
        read().map_err(|e| StoreError::of(path, "read", e))
    }
}
