//! What a service has to remember, in a database made for it: its sessions and jobs, what became of them, and the frames of sessions.
//! Large files (uploads, containers, coded groups) are kept beside it, by their records' ids.
//!
//! [`Catalog`] is what the service asks for; [`SqliteCatalog`] keeps it in one file, [`PostgresCatalog`] in a database that several processes share. Everything that a call changes is changed as a whole and
//! durable when it returns `Ok`; after an error nothing is changed, unless the error is that of a database whose answer was lost. All calls block.

mod blobs;
mod checksums;
mod chunks;
mod copy;
mod engine;
mod error;
mod link;
mod migrations;
mod numbers;
mod postgres;
mod rows;
mod sqlite;
mod trouble;

pub use blobs::{Blobs, BlobsError, Listed};
pub use copy::copy;
pub use error::CatalogError;
pub use postgres::PostgresCatalog;
pub use sqlite::SqliteCatalog;

use std::fmt::Debug;

/// What has a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A session.
    Session,
    /// A cage job.
    CageJob,
    /// A recovery.
    Recovery,
    /// A transfer.
    Transfer,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Session, Self::CageJob, Self::Recovery, Self::Transfer];

    /// Its name in messages and metadata.
    pub fn name(self) -> &'static str {
        match self {
            Self::Session => "session",
            Self::CageJob => "cage job",
            Self::Recovery => "recovery",
            Self::Transfer => "transfer",
        }
    }
}

/// How far a record's life has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Its files are not all there yet; without more it is removed at the next start.
    Creating,
    /// It is there.
    Open,
    /// Its deletion has begun, and is finished at the next start at the latest.
    Deleted,
}

/// Kind and id of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key<'a> {
    /// Its kind.
    pub kind: Kind,
    /// Its id.
    pub id: &'a str,
}

/// A record to be created.
#[derive(Clone, Copy, Debug)]
pub struct NewRecord<'a> {
    /// Kind and id.
    pub key: Key<'a>,
    /// Creation time, milliseconds since 1970.
    pub created_ms: u64,
    /// [`Phase::Creating`] or [`Phase::Open`].
    pub phase: Phase,
    /// Its description.
    pub meta: &'a [u8],
}

/// A session or job, as it is stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Its kind.
    pub kind: Kind,
    /// Its id.
    pub id: String,
    /// Creation time, milliseconds since 1970.
    pub created_ms: u64,
    /// How far its life has come.
    pub phase: Phase,
    /// Its description.
    pub meta: Vec<u8>,
    /// How its preparation or its work ended.
    pub outcome: Option<Vec<u8>>,
    /// With what a session was completed.
    pub completion: Option<Vec<u8>>,
    /// What has still to be announced about it.
    pub announcement: Option<Vec<u8>>,
    /// What of it is damaged.
    pub damage: Option<String>,
    /// How often work on it was begun.
    pub attempts: u32,
    /// How many frames it will have, where that was said.
    pub declared: Option<u32>,
    /// How many frames were ever worked on.
    pub reached: u32,
    /// Bytes that its frames take, about.
    pub frame_bytes: u64,
}

/// A change of a record.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// How far its life has come.
    Phase(Phase),
    /// Its description.
    Meta(Vec<u8>),
    /// How its preparation or its work ended.
    Outcome(Vec<u8>),
    /// With what a session was completed.
    Completion(Vec<u8>),
    /// What has still to be announced about it.
    Announcement(Vec<u8>),
    /// What of it is damaged.
    Damage(String),
    /// How often work on it was begun.
    Attempts(u32),
    /// How many frames it will have.
    Declared(u32),
    /// How many frames were ever worked on.
    Reached(u32),
}

/// What is known of a frame beside its cage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameEntry {
    /// Its number.
    pub frame: u32,
    /// Where its cage is; appending sets it.
    pub place: CagePlace,
    /// `sqrt(mean |e|²)`; NaN where it was not measured.
    pub l2: f32,
    /// `max |e|`; NaN where it was not measured.
    pub linf: f32,
    /// `Σ |e|²`.
    pub squared: f64,
    /// `Σ |p − p̄|²` of the frame about its own centroid.
    pub spread: f64,
    /// Digest of the handle rows received.
    pub handle_digest: [u8; 16],
    /// Digest of all rows; `None` if only handle rows were received.
    pub full_digest: Option<[u8; 16]>,
}

/// Where a stored cage is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CagePlace {
    pub(crate) chunk: i64,
    pub(crate) offset: u32,
    pub(crate) bytes: u32,
    pub(crate) crc: u32,
}

impl FrameEntry {
    /// Bytes of its cage.
    pub fn cage_bytes(&self) -> u32 {
        self.place.bytes
    }
}

/// A frame to be stored.
#[derive(Clone, Copy, Debug)]
pub struct NewFrame<'a> {
    /// What is known of it.
    pub entry: FrameEntry,
    /// Its cage, m × 3 `f32` interleaved.
    pub cage: &'a [f32],
}

/// The records of a service and the frames of its sessions. Every call may fail as the database does; the documentation names further errors.
pub trait Catalog: Debug + Send + Sync {
    /// Creates a record.
    ///
    /// # Errors
    /// [`CatalogError::Taken`].
    fn create(&self, record: NewRecord<'_>) -> Result<(), CatalogError>;

    /// A record; `None` if there is none.
    fn record(&self, key: Key<'_>) -> Result<Option<Record>, CatalogError>;

    /// All records that can be read, oldest first; the log names the others.
    fn records(&self) -> Result<Vec<Record>, CatalogError>;

    /// Changes a record in several ways at once. Whether there is one.
    fn change(&self, key: Key<'_>, changes: &[Change]) -> Result<bool, CatalogError>;

    /// Removes a record with its frames, unless there is none. May be stopped in between, so its phase is
    /// [`Phase::Deleted`] or [`Phase::Creating`] before.
    fn remove(&self, key: Key<'_>) -> Result<(), CatalogError>;

    /// Stores frames of a session, replacing those that are there. Gives their entries, in the same order.
    ///
    /// # Errors
    /// [`CatalogError::Gone`] where the session is not there or is deleted.
    fn append(&self, session: &str, frames: &[NewFrame<'_>]) -> Result<Vec<FrameEntry>, CatalogError>;

    /// The frames of a session, ascending.
    ///
    /// # Errors
    /// [`CatalogError::Damaged`].
    fn frames(&self, session: &str) -> Result<Vec<FrameEntry>, CatalogError>;

    /// Appends the cages of frames to `out`, little-endian. On an error `out` is unchanged.
    ///
    /// # Errors
    /// [`CatalogError::Damaged`].
    fn cages(&self, session: &str, frames: &[FrameEntry], out: &mut Vec<u8>) -> Result<(), CatalogError>;

    /// Checks that it can be written to.
    fn probe(&self) -> Result<(), CatalogError>;

    /// Checks that no other process has taken it over.
    ///
    /// # Errors
    /// [`CatalogError::TakenOver`].
    fn check_owner(&self) -> Result<(), CatalogError> {
        Ok(())
    }

    /// Lets another process take it over: nothing is changed by this one afterwards.
    fn release(&self) {}

    /// Whether another process has taken it over, so that nothing can be changed any more.
    fn is_taken_over(&self) -> bool {
        false
    }
}
