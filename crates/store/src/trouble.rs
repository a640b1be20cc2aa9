//! What goes wrong with a database, whether it is worth a second try, and what is said of it.

use crate::CatalogError;
use sqlx::Error;
use sqlx::error::DatabaseError;
use sqlx::postgres::{PgDatabaseError, PgSeverity};
use sqlx::sqlite::SqliteError;
use std::borrow::Cow;
use std::error::Error as _;

/// SQLite's `SQLITE_FULL`, and `SQLITE_IOERR_SHMSIZE`: a full disk has no room for the index of the log.
const FULL: [i32; 2] = [13, 10 | 19 << 8];
/// SQLite's `SQLITE_CORRUPT` and `SQLITE_NOTADB`, of which there are kinds.
const CORRUPT: [i32; 2] = [11, 26];
/// Codes of PostgreSQL by which the server ends this connection, or takes no writes, which another one may do
/// meanwhile.
const OF_CONNECTION: [&str; 4] = ["57P01", "57P02", "57P03", "25006"];
/// Those that pass without anybody changing the program or its settings, with those before.
const PASSING: [&str; 3] = ["53200", "53300", "57014"];
/// Those after which the same may succeed: transactions that met, and one number given twice.
const MET: [&str; 3] = ["40001", "40P01", "23505"];

/// Why a call was not done.
#[derive(Debug)]
pub(crate) enum Trouble {
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
    fn code(&self) -> Option<Cow<'_, str>> {
        if let Self::Database(error) = self { error.as_database_error()?.code() } else { None }
    }

    fn has_code(&self, codes: &[&str]) -> bool {
        self.code().is_some_and(|code| codes.contains(&&*code))
    }

    /// The connection cannot be used again, and others that wait for their use may be no better.
    pub(crate) fn is_broken(&self) -> bool {
        match self {
            Self::Own(_) => false,
            Self::Database(Error::Database(error)) => ends_connection(&**error) || self.has_code(&OF_CONNECTION),
            Self::Database(error) => !is_unreadable(error),
            Self::TimedOut | Self::Unknown(_) => true,
        }
    }

    /// The server gives this user no more connections.
    pub(crate) fn is_full(&self) -> bool {
        self.has_code(&["53300"])
    }

    /// It took too long.
    pub(crate) fn is_slow(&self) -> bool {
        matches!(self, Self::TimedOut) || self.has_code(&["57014"])
    }

    /// Nothing was changed, and the same may succeed at once by another connection.
    pub(crate) fn is_passing(&self) -> bool {
        matches!(self, Self::Database(_)) && (self.is_broken() || self.has_code(&MET))
    }

    /// What is said of it, by the database's name.
    pub(crate) fn explain(self, name: &str) -> CatalogError {
        match self {
            Self::Own(error) => error,
            Self::TimedOut => {
                CatalogError::Away(format!("{name} does not answer: see whether it hangs or is overloaded"))
            }
            Self::Unknown(cause) => CatalogError::Away(format!(
                "the answer of the database was lost, and what was to be stored may be there or not ({})",
                cause.explain(name)
            )),
            // No value that was written is one that cannot be read.
            Self::Database(error) if is_unreadable(&error) => CatalogError::Damaged(error.to_string()),
            Self::Database(error) => explain(&error, name),
        }
    }
}

/// Whether a column holds a value that its type does not allow, which this program never writes.
fn is_unreadable(error: &Error) -> bool {
    matches!(error, Error::ColumnDecode { .. } | Error::Decode(_))
}

fn explain(error: &Error, name: &str) -> CatalogError {
    let Some(of_database) = error.as_database_error() else {
        return CatalogError::Away(format!(
            "{name} cannot be reached ({}): see that it runs, that the address is right and that nothing lies between",
            chain(error)
        ));
    };
    let code = of_database.code().unwrap_or_default();
    if of_database.try_downcast_ref::<SqliteError>().is_some() {
        let (code, said) = (code.parse().unwrap_or(0), of_database.message().to_owned());
        return match code {
            code if FULL.contains(&code) => CatalogError::Full,
            code if CORRUPT.contains(&(code & 0xff)) => CatalogError::Corrupt(said),
            _ => CatalogError::Failed(said),
        };
    }
    let said = format!("{}, SQLSTATE {code}", of_database.message());
    let advice = match &*code {
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
    let said = format!("{name} {advice} ({said})");
    // Neither user nor database are others the next time.
    let is_lasting = code.starts_with("28") || code == "3D000";
    let passes = OF_CONNECTION.iter().chain(&PASSING).any(|known| *known == code) || ends_connection(of_database);
    let passes = passes && !is_lasting;
    if passes { CatalogError::Away(said) } else { CatalogError::Failed(said) }
}

/// Whether PostgreSQL, or what lies between, ends the connection with this error.
fn ends_connection(error: &dyn DatabaseError) -> bool {
    let severity = error.try_downcast_ref::<PgDatabaseError>().map(PgDatabaseError::severity);
    matches!(severity, Some(PgSeverity::Fatal | PgSeverity::Panic))
        || error.code().is_some_and(|code| code.starts_with("08"))
}

/// An error and what caused it, without passwords: what was parsed is not among it.
fn chain(error: &Error) -> String {
    let (mut said, mut next) = (error.to_string(), error.source());
    while let Some(cause) = next {
        let cause_said = cause.to_string();
        // Some say their cause themselves.
        if !said.contains(&cause_said) {
            said = format!("{said}: {cause_said}");
        }
        next = cause.source();
    }
    said
}
