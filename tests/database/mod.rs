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
/// Address of a service of S3 that all of them share; else each starts its own.
const SHARED: &str = "CAGER_TEST_S3";

/// A database, and a bucket where there is one; their servers end with the last of its clones.
#[derive(Clone)]
pub(crate) struct Database {
    server: Arc<Mutex<Server>>,
    bucket: Option<Bucket>,
}

/// One of the test's own, or a place in one that all tests share.
#[derive(Clone)]
enum Bucket {
    Own(Arc<Mutex<bucket::Server>>),
    Shared { address: String, place: String },
}

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
        Some(Self { bucket: Some(Bucket::Own(Arc::new(Mutex::new(bucket)))), ..database })
    }

    /// For a test that says nothing of a database: one where `CAGER_TEST_CATALOG=postgres` is set.
    pub(crate) fn of_all() -> Option<Self> {
        match std::env::var(ALL).as_deref() {
            Ok("postgres+s3") => match std::env::var(SHARED) {
                Ok(address) => {
                    let place = format!("{}-{}", std::process::id(), fastrand::u64(..));
                    let database = Self::start().expect("PostgreSQL");
                    Some(Self { bucket: Some(Bucket::Shared { address, place }), ..database })
                }
                Err(_) => Some(Self::with_bucket().expect("PostgreSQL and SeaweedFS")),
            },
            Ok("postgres") => Some(Self::start().expect("PostgreSQL")),
            _ => None,
        }
    }

    /// As [`Self::of_all`], for a test that changes files: they are in the service's folder.
    pub(crate) fn of_all_alone() -> Option<Self> {
        Self::is_for_all().then(|| Self::start().expect("PostgreSQL"))
    }

    pub(crate) fn is_for_all() -> bool {
        matches!(std::env::var(ALL).as_deref(), Ok("postgres" | "postgres+s3"))
    }

    /// What tells a service to use it.
    pub(crate) fn flags(&self) -> Vec<String> {
        let place = |bucket: &Bucket| match bucket {
            Bucket::Own(server) => lock(server).url("files"),
            Bucket::Shared { place, .. } => bucket::url(place),
        };
        let blobs = self.bucket.iter().flat_map(|bucket| ["--blobs".to_owned(), place(bucket)]);
        ["--catalog".to_owned(), self.url()].into_iter().chain(blobs).collect()
    }

    /// The environment that goes with them.
    pub(crate) fn environment(&self) -> Vec<(&'static str, String)> {
        let of = |bucket: &Bucket| match bucket {
            Bucket::Own(server) => lock(server).environment(),
            Bucket::Shared { address, .. } => bucket::environment(address),
        };
        self.bucket.iter().flat_map(of).collect()
    }

    /// Names of files in the bucket.
    pub(crate) fn files(&self, folder: &str) -> Vec<String> {
        let blobs = self.own_bucket().open("files", 0).expect("the bucket");
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
        self.own_bucket().kill();
    }

    pub(crate) fn run_bucket(&self) {
        self.own_bucket().run();
    }

    /// Has the bucket refuse what is written, or take it again.
    pub(crate) fn set_bucket_read_only(&self, is_read_only: bool) {
        self.own_bucket().set_read_only(is_read_only);
    }

    /// Kills the server, as if it had crashed.
    pub(crate) fn kill(&self) {
        self.server().kill();
    }

    pub(crate) fn run(&self) {
        self.server().run();
    }

    fn own_bucket(&self) -> MutexGuard<'_, bucket::Server> {
        match &self.bucket {
            Some(Bucket::Own(server)) => lock(server),
            _ => panic!("it has no bucket of its own"),
        }
    }

    fn server(&self) -> MutexGuard<'_, Server> {
        lock(&self.server)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
