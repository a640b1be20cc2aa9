//! What goes wrong with a database, whether it is worth a second try, and what is said of it.

use crate::CatalogError;
use std::error::Error as _;
use tokio_postgres::Error;
use tokio_postgres::error::SqlState;

/// Why a call was not done.
#[derive(Debug)]
pub(super) enum Trouble {
    /// The catalogue says so; the database is well.
    Own(CatalogError),
    /// The database, or the way to it.
    Database(Error),
    /// There was no answer in time.
    TimedOut,
    /// The answer to a COMMIT was lost, for this reason.
    Unknown(Box<Self>),
}

impl From<Error> for Trouble {
    fn from(error: Error) -> Self {
        Self::Database(error)
    }
}

impl From<CatalogError> for Trouble {
    fn from(error: CatalogError) -> Self {
        Self::Own(error)
    }
}

impl Trouble {
    fn code(&self) -> Option<&SqlState> {
        if let Self::Database(error) = self { error.code() } else { None }
    }

    /// The server ends this connection, or it is one to a server that takes no writes, which another one may do meanwhile.
    fn is_of_connection(&self) -> bool {
        let ends = [
            SqlState::ADMIN_SHUTDOWN,
            SqlState::CRASH_SHUTDOWN,
            SqlState::CANNOT_CONNECT_NOW,
            SqlState::READ_ONLY_SQL_TRANSACTION,
        ];
        self.code().is_some_and(|code| ends.contains(code))
    }

    /// The connection cannot be used again, and others that wait for their use may be no better.
    pub(super) fn is_broken(&self) -> bool {
        match self {
            Self::Own(_) => false,
            Self::Database(error) => error.as_db_error().is_none() && !is_unreadable(error) || self.is_of_connection(),
            Self::TimedOut | Self::Unknown(_) => true,
        }
    }

    /// The server gives this user no more connections.
    pub(super) fn is_full(&self) -> bool {
        self.code() == Some(&SqlState::TOO_MANY_CONNECTIONS)
    }

    /// It took too long.
    pub(super) fn is_slow(&self) -> bool {
        matches!(self, Self::TimedOut) || self.code() == Some(&SqlState::QUERY_CANCELED)
    }

    /// Nothing was changed, and the same may succeed at once by another connection.
    pub(super) fn is_passing(&self) -> bool {
        let met = [SqlState::T_R_SERIALIZATION_FAILURE, SqlState::T_R_DEADLOCK_DETECTED, SqlState::UNIQUE_VIOLATION];
        match self {
            Self::Database(_) => self.is_broken() || self.code().is_some_and(|code| met.contains(code)),
            _ => false,
        }
    }

    /// What is said of it, by the database's name.
    pub(super) fn explain(self, name: &str) -> CatalogError {
        match self {
            Self::Own(error) => error,
            Self::TimedOut => {
                CatalogError::Failed(format!("{name} does not answer: see whether it hangs or is overloaded"))
            }
            Self::Unknown(cause) => CatalogError::Failed(format!(
                "the answer of the database was lost, and what was to be stored may be there or not ({})",
                cause.explain(name)
            )),
            Self::Database(error) => explain(&error, name),
        }
    }
}

/// Whether a column holds a value that its type does not allow, which this program never writes.
fn is_unreadable(error: &Error) -> bool {
    error.to_string().starts_with("error deserializing")
}

fn explain(error: &Error, name: &str) -> CatalogError {
    let said = chain(error);
    let Some(code) = error.code() else {
        return match is_unreadable(error) {
            true => CatalogError::Damaged(said),
            false => CatalogError::Failed(format!(
                "{name} cannot be reached ({said}): see that it runs, that the address is right and that nothing lies between"
            )),
        };
    };
    let advice = match code.code() {
        "53100" => return CatalogError::Full,
        "XX001" | "XX002" => return CatalogError::Corrupt(format!("{name} is damaged ({said})")),
        "25006" => {
            "takes no writes: name the server that does (with several hosts, target_session_attrs=read-write), or end its read-only state"
        }
        "53300" => {
            "has no connection left: raise its max_connections or this user's limit (ALTER ROLE … CONNECTION LIMIT), or run fewer processes"
        }
        "53200" => "has not enough memory: lower its work_mem or max_connections",
        "57P01" | "57P02" | "57P03" => "is being stopped or started: it is tried again with the next call",
        "57014" => "took longer than statement_timeout: see whether it is overloaded, or a lock is held",
        "28P01" | "28000" => "refuses this user: see user and password in the address, and pg_hba.conf",
        "3D000" => "does not exist: create it, or name another one in the address",
        "3F000" => "has no such schema: see search_path in the address",
        "42501" => "does not give this user the right to do so: let it own the schema, or create one",
        "42P01" | "42703" => "lacks a table or column of the catalogue: was the schema dropped? Restart the program",
        _ => "failed",
    };
    CatalogError::Failed(format!("{name} {advice} ({said})"))
}

/// An error and what caused it, without passwords: what was parsed is not among it.
pub(super) fn chain(error: &Error) -> String {
    let Some(of_database) = error.as_db_error() else {
        let (mut said, mut next) = (error.to_string(), error.source());
        while let Some(cause) = next {
            said = format!("{said}: {cause}");
            next = cause.source();
        }
        return said;
    };
    format!("{}, SQLSTATE {}", of_database.message(), of_database.code().code())
}
