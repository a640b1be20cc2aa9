//! A PostgreSQL server of the test's own, for the catalogue of a service, and a service of S3 for its files.

use server::Server;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

#[allow(dead_code, reason = "the catalogue's own tests use more")]
#[path = "../../crates/store/tests/postgres/support.rs"]
mod server;

#[allow(dead_code, reason = "the bucket's own tests use more")]
#[path = "../../crates/store/tests/blobs/support.rs"]
mod bucket;

/// Tells all tests to keep what is known of sessions in a database (`postgres`), and files in a bucket (`postgres+s3`).
const ALL: &str = "CAGER_TEST_CATALOG";

/// A database, and a bucket where there is one; their servers end with the last of its clones.
#[derive(Clone)]
pub(crate) struct Database {
    server: Arc<Mutex<Server>>,
    bucket: Option<Bucket>,
}

type Bucket = Arc<Mutex<bucket::Server>>;

impl std::fmt::Debug for Database {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.url())
    }
}

#[allow(dead_code, reason = "each of those who share it uses a part")]
impl Database {
    /// `None`, which is said, where PostgreSQL is not installed and not required.
    pub(crate) fn start() -> Option<Self> {
        Server::start().map(|server| Self { server: Arc::new(Mutex::new(server)), bucket: None })
    }

    /// As [`Self::start`], with a bucket.
    pub(crate) fn with_bucket() -> Option<Self> {
        let (bucket, database) = (bucket::Server::start()?, Self::start()?);
        Some(Self { bucket: Some(Arc::new(Mutex::new(bucket))), ..database })
    }

    /// For a test that says nothing of a database: one where `CAGER_TEST_CATALOG=postgres` is set.
    pub(crate) fn of_all() -> Option<Self> {
        match std::env::var(ALL).as_deref() {
            Ok("postgres+s3") => Some(Self::with_bucket().expect("PostgreSQL and SeaweedFS")),
            Ok("postgres") => Some(Self::start().expect("PostgreSQL")),
            _ => None,
        }
    }

    pub(crate) fn is_for_all() -> bool {
        matches!(std::env::var(ALL).as_deref(), Ok("postgres" | "postgres+s3"))
    }

    /// What tells a service to use it.
    pub(crate) fn flags(&self) -> Vec<String> {
        let blobs = self.bucket.iter().flat_map(|bucket| ["--blobs".to_owned(), lock(bucket).url("files")]);
        ["--catalog".to_owned(), self.url()].into_iter().chain(blobs).collect()
    }

    /// The environment that goes with them.
    pub(crate) fn environment(&self) -> Vec<(&'static str, String)> {
        self.bucket.iter().flat_map(|bucket| lock(bucket).environment()).collect()
    }

    /// Names of files in the bucket.
    pub(crate) fn files(&self, folder: &str) -> Vec<String> {
        let blobs = lock(self.bucket.as_ref().expect("a bucket")).open("files", 0).expect("the bucket");
        blobs.list(folder).into_iter().map(|listed| listed.name).collect()
    }

    pub(crate) fn url(&self) -> String {
        self.server().url()
    }

    pub(crate) fn sql(&self, sql: &str) -> String {
        self.server().sql(sql)
    }

    /// Kills the service of S3, as if it had crashed.
    pub(crate) fn kill_bucket(&self) {
        lock(self.bucket.as_ref().expect("a bucket")).kill();
    }

    pub(crate) fn run_bucket(&self) {
        lock(self.bucket.as_ref().expect("a bucket")).run();
    }

    /// Has the bucket refuse what is written, or take it again.
    pub(crate) fn set_bucket_read_only(&self, is_read_only: bool) {
        lock(self.bucket.as_ref().expect("a bucket")).set_read_only(is_read_only);
    }

    /// Kills the server, as if it had crashed.
    pub(crate) fn kill(&self) {
        self.server().kill();
    }

    pub(crate) fn run(&self) {
        self.server().run();
    }

    fn server(&self) -> MutexGuard<'_, Server> {
        lock(&self.server)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
