//! Brings the tables of a database to the version of this program.

use super::link::Link;
use super::rows::only;
use super::trouble::Trouble;
use crate::CatalogError;
use std::time::Duration;

/// What leads from each version to the next one, from none on.
const STEPS: [&str; 2] = [include_str!("schema.sql"), include_str!("members.sql")];

/// The newest version.
pub(super) const VERSION: i64 = STEPS.len() as i64;

/// Distinguishes this lock from those that others take in the same database.
const LOCK: i32 = 0x6361_6765;

/// Makes the schema and its tables where they are not there yet; processes that start together wait for each other.
pub(super) fn prepare(link: &Link, limit: Duration) -> Result<(), Trouble> {
    let schema = link.read(limit, &async |link: &Link| schema(link).await)?;
    if link.read(limit, &async |link: &Link| version(link, &schema).await)? == VERSION {
        return Ok(());
    }
    link.write(limit, None, &async |link: &Link| {
        link.query("SELECT pg_advisory_xact_lock($1, $2)", &[&LOCK, &hash(&schema)]).await?;
        let found = link.query("SELECT to_regnamespace($1) IS NOT NULL", &[&schema]).await?;
        if !only::<bool>(&found)? {
            link.batch(&format!("CREATE SCHEMA {schema}")).await?;
        }
        let version = version(link, &schema).await?;
        for (step, to) in STEPS.iter().zip(1i64..).skip(version as usize) {
            link.batch(step).await?;
            link.query("UPDATE catalogue SET version = $1", &[&to]).await?;
        }
        Ok(())
    })
}

/// Distinguishes locks of this schema from those of others.
pub(super) fn hash(schema: &str) -> i32 {
    crc32c::crc32c(schema.as_bytes()) as i32
}

/// The name of the schema, which needs no quotes.
pub(super) async fn schema(link: &Link) -> Result<String, Trouble> {
    let path: String = only(&link.query("SELECT current_setting('search_path')", &[]).await?)?;
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
async fn version(link: &Link, schema: &str) -> Result<i64, Trouble> {
    let found = link.query("SELECT to_regclass($1) IS NOT NULL", &[&format!("{schema}.catalogue")]).await?;
    if !only::<bool>(&found)? {
        return Ok(0);
    }
    let version = only(&link.query("SELECT max(version) FROM catalogue", &[]).await?)?;
    match version {
        0..=VERSION => Ok(version),
        newer => Err(CatalogError::Newer { found: newer, known: VERSION }.into()),
    }
}
