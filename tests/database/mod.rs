//! A PostgreSQL server of the test's own, for the catalogue of a service.

use server::Server;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

#[allow(dead_code, reason = "the catalogue's own tests use more")]
#[path = "../../crates/store/tests/postgres/support.rs"]
mod server;

/// Tells all tests to keep what is known of sessions in a database.
const ALL: &str = "CAGER_TEST_CATALOG";

/// A database; its server ends with the last of its clones.
#[derive(Clone)]
pub(crate) struct Database(Arc<Mutex<Server>>);

impl std::fmt::Debug for Database {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.url())
    }
}

#[allow(dead_code, reason = "each of those who share it uses a part")]
impl Database {
    /// `None`, which is said, where PostgreSQL is not installed and not required.
    pub(crate) fn start() -> Option<Self> {
        Server::start().map(|server| Self(Arc::new(Mutex::new(server))))
    }

    /// For a test that says nothing of a database: one where `CAGER_TEST_CATALOG=postgres` is set.
    pub(crate) fn of_all() -> Option<Self> {
        Self::is_for_all().then(|| Self::start().expect("PostgreSQL"))
    }

    pub(crate) fn is_for_all() -> bool {
        std::env::var(ALL).as_deref() == Ok("postgres")
    }

    pub(crate) fn url(&self) -> String {
        self.server().url()
    }

    pub(crate) fn sql(&self, sql: &str) -> String {
        self.server().sql(sql)
    }

    /// Kills the server, as if it had crashed.
    pub(crate) fn kill(&self) {
        self.server().kill();
    }

    pub(crate) fn run(&self) {
        self.server().run();
    }

    fn server(&self) -> MutexGuard<'_, Server> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
