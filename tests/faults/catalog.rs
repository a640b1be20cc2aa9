//! Catalogues that fail on demand. That of a faulty disk lies in a folder that outlives stops and power cuts, since what it says is durable is. Each
//! change is two steps: one before it, and one between it and its answer, which is lost with that.

use super::{FaultyDisk, Op, Verdict, stopped};
use cager_store::{Catalog, CatalogError, Change, FrameEntry, Key, NewFrame, NewRecord, Record, SqliteCatalog};
use futures_executor::block_on;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions as _};
use std::fmt;
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// A catalogue that asks before every step whether it may.
pub struct Hooked {
    inner: Arc<dyn Catalog>,
    hook: Box<dyn Fn(Op) -> Result<(), CatalogError> + Send + Sync>,
}

impl fmt::Debug for Hooked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.inner.fmt(f)
    }
}

impl Hooked {
    /// With this hook, for [`Op::Read`], [`Op::Change`] and [`Op::Answer`].
    pub fn over(
        inner: Arc<dyn Catalog>,
        hook: impl Fn(Op) -> Result<(), CatalogError> + Send + Sync + 'static,
    ) -> Arc<dyn Catalog> {
        Arc::new(Self { inner, hook: Box::new(hook) })
    }

    fn read<T>(&self, act: impl FnOnce() -> Result<T, CatalogError>) -> Result<T, CatalogError> {
        (self.hook)(Op::Read).and_then(|()| act())
    }

    fn write<T>(&self, act: impl FnOnce() -> Result<T, CatalogError>) -> Result<T, CatalogError> {
        (self.hook)(Op::Change)?;
        let done = act()?;
        (self.hook)(Op::Answer).map(|()| done)
    }
}

impl Catalog for Hooked {
    fn create(&self, record: NewRecord<'_>) -> Result<(), CatalogError> {
        self.write(|| self.inner.create(record))
    }

    fn record(&self, key: Key<'_>) -> Result<Option<Record>, CatalogError> {
        self.read(|| self.inner.record(key))
    }

    fn records(&self) -> Result<Vec<Record>, CatalogError> {
        self.read(|| self.inner.records())
    }

    fn change(&self, key: Key<'_>, changes: &[Change]) -> Result<bool, CatalogError> {
        self.write(|| self.inner.change(key, changes))
    }

    fn remove(&self, key: Key<'_>) -> Result<(), CatalogError> {
        self.write(|| self.inner.remove(key))
    }

    fn append(&self, session: &str, frames: &[NewFrame<'_>]) -> Result<Vec<FrameEntry>, CatalogError> {
        self.write(|| self.inner.append(session, frames))
    }

    fn frames(&self, session: &str) -> Result<Vec<FrameEntry>, CatalogError> {
        self.read(|| self.inner.frames(session))
    }

    fn cages(&self, session: &str, frames: &[FrameEntry], out: &mut Vec<u8>) -> Result<(), CatalogError> {
        self.read(|| self.inner.cages(session, frames, out))
    }

    fn probe(&self) -> Result<(), CatalogError> {
        self.write(|| self.inner.probe())
    }
}

/// What is kept of a faulty disk's catalogue while nobody has it open.
#[derive(Debug)]
pub(super) struct Kept {
    inner: Arc<SqliteCatalog>,
    folder: TempDir,
}

impl Kept {
    fn new() -> Result<Self, CatalogError> {
        let memory = tempfile::tempdir_in("/dev/shm");
        let folder = memory.or_else(|_| tempfile::tempdir()).map_err(|e| CatalogError::Failed(e.to_string()))?;
        Ok(Self { inner: Arc::new(SqliteCatalog::open(&folder.path().join("catalog.db"))?), folder })
    }
}

/// The catalogue of a faulty disk, as its faults have it.
pub(super) fn open(disk: &FaultyDisk, path: &Path) -> Result<Arc<dyn Catalog>, CatalogError> {
    let mut state = disk.state();
    let kept = match state.catalog.take() {
        Some(kept) => kept,
        None => Kept::new()?,
    };
    let inner = Arc::clone(&state.catalog.insert(kept).inner);
    let (disk, path, generation) = (disk.clone(), path.to_owned(), state.generation);
    let hook = move |op| {
        let mut state = disk.state();
        if state.generation != generation {
            return Err(CatalogError::Failed("it was opened before the restart".to_owned()));
        }
        if op == Op::Read && state.is_mute {
            return Err(CatalogError::Failed("it does not answer".to_owned()));
        }
        match state.admit(op, &path) {
            Verdict::Whole | Verdict::Half => Ok(()),
            Verdict::HalfAndStop => Err(CatalogError::Failed(stopped().to_string())),
            Verdict::Error(error) | Verdict::Ruin(error) if error.kind() == std::io::ErrorKind::StorageFull => {
                Err(CatalogError::Full)
            }
            Verdict::Error(error) | Verdict::Ruin(error) => Err(CatalogError::Failed(error.to_string())),
        }
    };
    Ok(Hooked::over(inner, hook))
}

impl FaultyDisk {
    /// Changes what the catalogue holds behind its back.
    pub fn sql(&self, statement: &str) {
        let state = self.state();
        let file = state.catalog.as_ref().expect("a catalogue").folder.path().join("catalog.db");
        let options = SqliteConnectOptions::new().filename(file);
        let statements = sqlx::raw_sql(AssertSqlSafe(statement.to_owned()));
        block_on(async { statements.execute(&mut options.connect().await?).await }).expect(statement);
    }
}
