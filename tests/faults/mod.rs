//! A disk that fails on demand, for tests: errors of single operations, short writes, syncs that lose what they should keep,
//! processes that stop anywhere, and power cuts. The tests of the store and those of the whole service share it.

#![allow(dead_code, unreachable_pub, unused_imports, reason = "each of them uses a part")]

use super::disk::DiskFile;
use files::FaultyFile;
use shadow::Shadow;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

mod catalog;
mod files;
mod shadow;

pub use catalog::Hooked;

/// Kinds of operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Op {
    /// A new file.
    Create,
    /// Opening a file.
    Open,
    /// Writing to a file.
    Write,
    /// Reading from a file, or asking for its length.
    Read,
    /// Cutting a file.
    Truncate,
    /// Syncing a file.
    Sync,
    /// A new folder.
    CreateDir,
    /// Renaming a file or folder.
    Rename,
    /// Removing a file or an empty folder.
    Remove,
    /// Listing a folder.
    List,
    /// Syncing a folder.
    SyncDir,
    /// Noting a use.
    Touch,
    /// A change of the catalogue.
    Change,
    /// The answer to such a change, which is done.
    Answer,
}

/// What happens to an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It fails with this `errno` and does nothing; a sync loses all that it should have kept.
    Error(i32),
    /// As an error; a sync also ruins the blocks it tried to write, with older bytes in them.
    Ruin(i32),
    /// As an error; where that is the answer to a change of the catalogue, nothing can be read from it either until the faults end.
    Mute(i32),
    /// A write takes half of its bytes and succeeds. Other operations are as ever.
    Short,
    /// The process ends here: a write takes half of its bytes, nothing else happens, and all later operations fail until
    /// [`FaultyDisk::restart`].
    Stop,
}

/// What becomes of unsynced data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// All stays, as when only the process ends. A later power cut can still take it.
    Nothing,
    /// All is gone.
    Everything,
    /// Sectors of files stay or go by chance, and a first part of the changes to folders stays. The same seed gives the same.
    Torn(u64),
}

#[derive(Debug)]
struct Armed {
    op: Option<Op>,
    /// Counted from 1.
    nth: u64,
    last: u64,
    fault: Fault,
}

#[derive(Debug)]
struct State {
    shadow: Shadow,
    counts: BTreeMap<Op, u64>,
    total: u64,
    trace: Vec<(Op, PathBuf)>,
    armed: Vec<Armed>,
    stopped: bool,
    /// Files opened before a restart are dead.
    generation: u64,
    free_bytes: Option<u64>,
    catalog: Option<catalog::Kept>,
    /// Nothing can be read from the catalogue.
    is_mute: bool,
}

/// A disk over the system's own, with faults in it. Everything under its root is also kept in memory.
#[derive(Clone, Debug)]
pub struct FaultyDisk {
    state: Arc<Mutex<State>>,
}

enum Verdict {
    Whole,
    Half,
    HalfAndStop,
    Error(io::Error),
    Ruin(io::Error),
}

impl FaultyDisk {
    /// A disk for the folder `root`, which has to be there; what is in it counts as durable.
    ///
    /// # Errors
    /// The system's.
    pub fn new(root: &Path) -> io::Result<Self> {
        let state = State {
            shadow: Shadow::new(root)?,
            counts: BTreeMap::new(),
            total: 0,
            trace: Vec::new(),
            armed: Vec::new(),
            stopped: false,
            generation: 0,
            free_bytes: None,
            catalog: None,
            is_mute: false,
        };
        Ok(Self { state: Arc::new(Mutex::new(state)) })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the `nth` operation of a kind fail, of all where none is given; counted from 1 and from now on.
    pub fn fail(&self, op: Option<Op>, nth: u64, fault: Fault) {
        self.arm(op, nth, 1, fault);
    }

    /// Makes the `nth` operation and all later ones fail.
    pub fn fail_from(&self, op: Option<Op>, nth: u64, fault: Fault) {
        self.arm(op, nth, u64::MAX, fault);
    }

    fn arm(&self, op: Option<Op>, nth: u64, count: u64, fault: Fault) {
        let mut state = self.state();
        let before = op.map_or(state.total, |op| state.counts.get(&op).copied().unwrap_or(0));
        state.armed.push(Armed { op, nth: before + nth, last: (before + nth - 1).saturating_add(count), fault });
    }

    /// No more faults, but for a stop that has happened.
    pub fn disarm(&self) {
        let mut state = self.state();
        state.armed.clear();
        state.is_mute = false;
    }

    /// Stops here: all operations fail until [`Self::restart`].
    pub fn stop(&self) {
        self.state().stopped = true;
    }

    /// Whether it stopped and was not restarted.
    pub fn is_stopped(&self) -> bool {
        self.state().stopped
    }

    /// Operations so far.
    pub fn operations(&self) -> u64 {
        self.state().total
    }

    /// The operations so far, for the message of a test.
    pub fn trace(&self) -> Vec<(Op, PathBuf)> {
        self.state().trace.clone()
    }

    /// Bytes that the disk says are free; None for what the system says.
    pub fn set_free_bytes(&self, bytes: Option<u64>) {
        self.state().free_bytes = bytes;
    }

    /// Starts again after a stop, without faults; the folder then has what the disk would hold. Files opened before are dead.
    ///
    /// # Errors
    /// The system's.
    pub fn restart(&self, loss: Loss) -> io::Result<()> {
        let mut state = self.state();
        state.armed.clear();
        state.is_mute = false;
        state.stopped = false;
        state.generation += 1;
        match loss {
            Loss::Nothing => Ok(()),
            Loss::Everything => state.shadow.restore(None),
            Loss::Torn(seed) => state.shadow.restore(Some(seed)),
        }
    }

    fn run<T>(&self, op: Op, path: &Path, act: impl FnOnce(&mut Shadow) -> io::Result<T>) -> io::Result<T> {
        let mut state = self.state();
        match state.admit(op, path) {
            Verdict::Whole | Verdict::Half => act(&mut state.shadow),
            Verdict::HalfAndStop => Err(stopped()),
            Verdict::Error(error) | Verdict::Ruin(error) => Err(error),
        }
    }

    fn file(&self, path: &Path, inner: Arc<dyn DiskFile>, node: Option<usize>) -> Arc<dyn DiskFile> {
        let generation = self.state().generation;
        Arc::new(FaultyFile { disk: self.clone(), path: path.to_owned(), inner, node, generation })
    }
}

fn stopped() -> io::Error {
    io::Error::other("the process has ended")
}

impl State {
    fn admit(&mut self, op: Op, path: &Path) -> Verdict {
        if self.stopped {
            return Verdict::Error(stopped());
        }
        self.total += 1;
        self.trace.push((op, path.to_owned()));
        let count = self.counts.entry(op).or_default();
        *count += 1;
        let (count, total) = (*count, self.total);
        let hit = self.armed.iter().find(|armed| match armed.op {
            None => (armed.nth..=armed.last).contains(&total),
            Some(kind) => kind == op && (armed.nth..=armed.last).contains(&count),
        });
        match hit.map(|armed| armed.fault) {
            None => Verdict::Whole,
            Some(Fault::Short) => Verdict::Half,
            Some(Fault::Error(errno)) => Verdict::Error(io::Error::from_raw_os_error(errno)),
            Some(Fault::Mute(errno)) => {
                self.is_mute |= op == Op::Answer;
                Verdict::Error(io::Error::from_raw_os_error(errno))
            }
            Some(Fault::Ruin(errno)) => Verdict::Ruin(io::Error::from_raw_os_error(errno)),
            Some(Fault::Stop) => {
                self.stopped = true;
                Verdict::HalfAndStop
            }
        }
    }
}
