//! What the file needs from time to time: its log written back, room given back to the disk, and a reserve for deletions on a full one.

use super::{Writer, explain};
use crate::CatalogError;
use crate::link::Link;
use sqlx::AssertSqlSafe;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

/// Pause between two rounds.
const PAUSE: Duration = Duration::from_secs(2);
/// Length of the log from which on writing waits until it is written back.
const LONG_LOG: u64 = 256 << 20;
/// Pages that are given back at once.
const FREED_PAGES: i64 = 1024;
/// So many unused pages are given back also while others write.
const MANY_UNUSED_PAGES: i64 = 16 * FREED_PAGES;
/// How often they are in a round on a full disk, or where they are many.
const STEPS: u32 = 64;
/// Bytes that are kept free for deletions; on a disk that has less, at least the second number.
pub(super) const RESERVE: usize = 8 << 20;
const LEAST: u64 = 512 << 10;

/// Bytes of it that are written at a time.
const PIECE: usize = 32 << 10;

/// Handle to the thread that does it, which ends with it.
#[derive(Debug)]
pub(super) struct Upkeep {
    reserve: PathBuf,
    written: Arc<AtomicBool>,
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Upkeep {
    pub(super) fn start(path: &Path, link: Link, writer: Weak<Writer>) -> Result<Self, CatalogError> {
        let written = Arc::new(AtomicBool::new(true));
        let (reserve, log) = (beside(path, "reserve"), beside(path, "-wal"));
        let (stop, stopped) = channel::<()>();
        let mut rounds = Rounds {
            link,
            writer,
            log,
            reserve: reserve.clone(),
            written: Arc::clone(&written),
            told: AtomicBool::new(false),
        };
        rounds.keep_reserve();
        let work = move || {
            while stopped.recv_timeout(PAUSE) != Err(RecvTimeoutError::Disconnected) {
                // Several are one.
                while stopped.try_recv().is_ok() {}
                let done = rounds.once();
                // On a full disk the one fails, and the other helps.
                let done = if rounds.keep_reserve() { done } else { rounds.make_room() };
                if let Err(error) = done {
                    tracing::debug!(%error, "the catalogue's log is written back later");
                }
            }
        };
        let thread = std::thread::Builder::new().name("catalogue-upkeep".to_owned()).spawn(work);
        let thread = thread.map_err(|error| CatalogError::Failed(format!("threads cannot be started: {error}")))?;
        Ok(Self { reserve, written, stop: Some(stop), thread: Some(thread) })
    }

    /// Something was removed. Where the reserve is not whole, a round begins at once, which may have the room before others do.
    pub(super) fn note_removal(&self) {
        self.note_write();
        if !is_whole(&self.reserve)
            && let Some(thread) = &self.stop
        {
            // Without the thread there is nobody to tell.
            let _ = thread.send(());
        }
    }

    /// Has the next round look at the log.
    pub(super) fn note_write(&self) {
        self.written.store(true, Relaxed);
    }
}

impl Drop for Upkeep {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Gives the reserve of a file to what cannot do without. Whether it was there.
pub(super) fn give_reserve(path: &Path) -> bool {
    fs::remove_file(beside(path, "reserve")).is_ok()
}

struct Rounds {
    link: Link,
    writer: Weak<Writer>,
    log: PathBuf,
    reserve: PathBuf,
    written: Arc<AtomicBool>,
    /// It was told that there is no reserve.
    told: AtomicBool,
}

impl Rounds {
    fn once(&mut self) -> Result<(), CatalogError> {
        if self.written.swap(false, Relaxed) {
            self.checkpoint("PRAGMA wal_checkpoint(PASSIVE)")?;
            // Deletions on a busy service give their room back as well.
            let unused = self.unused_pages()?;
            if unused > MANY_UNUSED_PAGES {
                for _ in 0..STEPS {
                    self.free_pages()?;
                }
                self.written.store(true, Relaxed);
            }
            if fs::metadata(&self.log).is_ok_and(|log| log.len() > LONG_LOG) {
                // Those who read or write meanwhile wait, or it is tried again.
                self.checkpoint("PRAGMA wal_checkpoint(TRUNCATE)")?;
            }
            return Ok(());
        }
        // Nothing was written for a while.
        let is_freed = self.free_pages()?;
        // The file ends earlier when that is written back.
        self.written.fetch_or(is_freed, Relaxed);
        Ok(())
    }

    fn checkpoint(&mut self, sql: &'static str) -> Result<(), CatalogError> {
        self.link.execute(sql, &[]).map(drop).map_err(explain)
    }

    fn unused_pages(&mut self) -> Result<i64, CatalogError> {
        self.link.only("PRAGMA freelist_count", &[]).map_err(explain)
    }

    /// Gives all that it can back to a full disk, for the reserve.
    fn make_room(&mut self) -> Result<(), CatalogError> {
        let freed = (0..STEPS).try_for_each(|_| self.free_pages().map(|_| ()));
        self.checkpoint("PRAGMA wal_checkpoint(TRUNCATE)")?;
        self.keep_reserve();
        freed
    }

    /// Gives some unused pages back. Whether there were any.
    fn free_pages(&mut self) -> Result<bool, CatalogError> {
        let free = self.unused_pages()?;
        if free > 0
            && let Some(writer) = self.writer.upgrade()
        {
            let sql = AssertSqlSafe(format!("PRAGMA incremental_vacuum({FREED_PAGES})"));
            writer.run(|link| link.execute(sql, &[]).map(drop))?;
        }
        Ok(free > 0)
    }

    /// Makes the reserve as large as there is room for, unless it is. Whether it is whole.
    fn keep_reserve(&self) -> bool {
        if is_whole(&self.reserve) {
            return true;
        }
        let there = fs::metadata(&self.reserve).map_or(0, |reserve| reserve.len());
        let system = self.reserve.parent().and_then(|folder| rustix::fs::statvfs(folder).ok());
        // What others have room for shall not fail meanwhile: half is left to them.
        let room = system.map_or(u64::MAX, |system| system.f_bavail.saturating_mul(system.f_frsize)) / 2;
        let pieces = room.min(RESERVE as u64) / PIECE as u64;
        let bytes = pieces * PIECE as u64;
        if bytes < LEAST || bytes <= there {
            if there == 0 && !self.told.swap(true, Relaxed) {
                tracing::warn!(
                    "the disk is so full that nothing is kept free for deletions, and sessions may not be deleted: make room"
                );
            }
            return false;
        }
        let temporary = self.reserve.with_extension("tmp");
        let make = || -> std::io::Result<()> {
            let _ = fs::remove_file(&temporary);
            let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&temporary)?;
            // Not zeros, of which some file systems keep nothing.
            (0..pieces).try_for_each(|_| file.write_all(&[0xa5; PIECE]))?;
            file.sync_all()?;
            fs::rename(&temporary, &self.reserve)
        };
        let made = make();
        if made.is_err() {
            let _ = fs::remove_file(&temporary);
        } else if self.told.swap(false, Relaxed) {
            tracing::info!("there is room again that is kept free for deletions");
        }
        made.is_ok() && bytes == RESERVE as u64
    }
}

fn is_whole(reserve: &Path) -> bool {
    fs::metadata(reserve).is_ok_and(|reserve| reserve.len() >= RESERVE as u64)
}

/// A file beside the catalogue's.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(if ending.starts_with('-') { ending.to_owned() } else { format!(".{ending}") });
    name.into()
}
