//! Folders, second connections and child processes.

use cager_store::SqliteCatalog;
use futures_executor::block_on;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions as _, SqliteConnection};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Tells a test that another one has started it, and in which folder.
const FOLDER: &str = "CAGER_STORE_TEST_FOLDER";

pub(crate) struct Dir(tempfile::TempDir);

impl Dir {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn file(&self) -> PathBuf {
        file(self.path())
    }

    pub(crate) fn open(&self) -> SqliteCatalog {
        SqliteCatalog::open(&self.file()).expect("a catalogue")
    }

    /// A connection beside the catalogue's.
    pub(crate) fn beside(&self) -> Beside {
        let options = SqliteConnectOptions::new().filename(self.file());
        Beside(block_on(options.connect()).expect("a connection"))
    }

    /// Bytes of the log.
    pub(crate) fn log(&self) -> Vec<u8> {
        std::fs::read(self.path().join("catalogue-wal")).unwrap_or_default()
    }
}

/// A connection by which a test changes what is stored, and looks at it.
pub(crate) struct Beside(SqliteConnection);

impl Beside {
    /// How many rows were changed.
    pub(crate) fn run(&mut self, sql: &str) -> u64 {
        let run = sqlx::raw_sql(AssertSqlSafe(sql.to_owned())).execute(&mut self.0);
        block_on(run).expect(sql).rows_affected()
    }

    pub(crate) fn number(&mut self, sql: &str) -> i64 {
        block_on(sqlx::query_scalar(AssertSqlSafe(sql.to_owned())).fetch_one(&mut self.0)).expect(sql)
    }

    pub(crate) fn text(&mut self, sql: &str) -> String {
        block_on(sqlx::query_scalar(AssertSqlSafe(sql.to_owned())).fetch_one(&mut self.0)).expect(sql)
    }

    pub(crate) fn bytes(&mut self, sql: &str) -> Vec<u8> {
        block_on(sqlx::query_scalar(AssertSqlSafe(sql.to_owned())).fetch_one(&mut self.0)).expect(sql)
    }
}

pub(crate) fn file(folder: &Path) -> PathBuf {
    folder.join("catalogue")
}

/// Runs an ignored test of this program in a process of its own.
pub(crate) fn child(test: &str, folder: &Path) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("this program"));
    command.args(["--exact", "--ignored", "--nocapture", test]).env(FOLDER, folder).stdin(Stdio::null());
    command
}

/// The folder of a test that another one has started; `None` if it was not.
pub(crate) fn folder_of_child() -> Option<PathBuf> {
    std::env::var_os(FOLDER).map(PathBuf::from)
}

/// Runs an ignored test with a disk of its own of so many MiB, where this user may have one.
pub(crate) fn with_small_disk(test: &str, mebibytes: u32) {
    let dir = Dir::new();
    let namespace = ["--user", "--map-root-user", "--mount"];
    if !Command::new("unshare").args(namespace).arg("true").output().is_ok_and(|done| done.status.success()) {
        return;
    }
    let script = format!("mount -t tmpfs -o size={mebibytes}m none \"$0\" && exec \"$@\"");
    let of = child(test, dir.path());
    let mut command = Command::new("unshare");
    command.args(namespace).args(["sh", "-c", &script]).arg(dir.path()).arg(of.get_program()).args(of.get_args());
    let done = command.env(FOLDER, dir.path()).output().expect("unshare");
    let said = String::from_utf8_lossy(&done.stdout);
    assert!(done.status.success() && said.contains("1 passed"), "{said}\n{}", String::from_utf8_lossy(&done.stderr));
}
