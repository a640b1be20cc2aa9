//! Brings the tables of a database to the version of this program.

use super::transaction::{read, write};
use crate::CatalogError;
use crate::link::{Link, Value};
use crate::migrations::{POSTGRES, missing};
use crate::trouble::Trouble;
use sqlx::AssertSqlSafe;
use std::time::Duration;

/// Distinguishes this lock from those that others take in the same database.
const LOCK: i32 = 0x6361_6765;

/// Makes the schema and its tables where they are not there yet; processes that start together wait for each other.
pub(super) fn prepare(link: &mut Link, limit: Duration) -> Result<(), Trouble> {
    let schema = read(link, limit, schema)?;
    if read(link, limit, |link| Ok(missing(&POSTGRES, version(link, &schema)?)?.is_empty()))? {
        return Ok(());
    }
    write(link, limit, None, |link| {
        link.batch(AssertSqlSafe(format!("SELECT pg_advisory_xact_lock({LOCK}, {})", hash(&schema))))?;
        if !link.only::<bool>("SELECT to_regnamespace($1) IS NOT NULL", &[Value::Text(&schema)])? {
            link.batch(AssertSqlSafe(format!("CREATE SCHEMA {schema}")))?;
        }
        for (version, sql) in missing(&POSTGRES, version(link, &schema)?)? {
            link.batch(*sql)?;
            link.execute("UPDATE catalogue SET version = $1", &[Value::Integer(*version)])?;
        }
        Ok(())
    })
}

/// Distinguishes locks of this schema from those of others.
pub(super) fn hash(schema: &str) -> i32 {
    crc32c::crc32c(schema.as_bytes()) as i32
}

/// The name of the schema, which needs no quotes.
pub(super) fn schema(link: &mut Link) -> Result<String, Trouble> {
    let path: String = link.only("SELECT current_setting('search_path')", &[])?;
    let is_plain = !path.is_empty()
        && path.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
        && !path.starts_with(|first: char| first.is_ascii_digit());
    if !is_plain {
        let said = format!(
            "search_path in the address names one schema, in lower-case letters, digits and _, as in ?options=-csearch_path%3Dcager; it is `{path}`"
        );
        return Err(CatalogError::Failed(said).into());
    }
    Ok(path)
}

/// The version of the tables; 0 without them.
fn version(link: &mut Link, schema: &str) -> Result<i64, Trouble> {
    let table = format!("{schema}.catalogue");
    match link.only("SELECT to_regclass($1) IS NOT NULL", &[Value::Text(&table)])? {
        true => link.only("SELECT max(version) FROM catalogue", &[]),
        false => Ok(0),
    }
}
