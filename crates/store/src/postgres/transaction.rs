//! What is done by one connection, in time: reading, and changes as a whole.

use crate::CatalogError;
use crate::link::Link;
use crate::trouble::Trouble;
use sqlx::AssertSqlSafe;
use std::time::Duration;

/// Begins changes of the process that has the database.
pub(super) struct Fence {
    /// Begins a transaction that the next owner waits for, and asks how often the database was taken.
    pub(super) begin: String,
    /// How often it was taken, this process included.
    pub(super) taken: i64,
}

/// Does `work`, for at most so long.
pub(super) fn read<T>(
    link: &mut Link,
    limit: Duration,
    work: impl FnOnce(&mut Link) -> Result<T, Trouble>,
) -> Result<T, Trouble> {
    link.limit(limit);
    work(link)
}

/// Does `work` in a transaction, unless another process has taken the database over. Only after [`Trouble::Unknown`]
/// something may be changed.
pub(super) fn write<T>(
    link: &mut Link,
    limit: Duration,
    fence: Option<&Fence>,
    work: impl FnOnce(&mut Link) -> Result<T, Trouble>,
) -> Result<T, Trouble> {
    link.limit(limit);
    let worked = begin(link, fence).and_then(|()| work(link));
    link.limit(limit);
    match worked {
        Ok(value) => link.batch("COMMIT").map(|_| value).map_err(|trouble| match trouble.is_broken() {
            true => Trouble::Unknown(Box::new(trouble)),
            false => trouble,
        }),
        Err(trouble) => {
            if !trouble.is_broken() {
                link.batch("ROLLBACK")?;
            }
            Err(trouble)
        }
    }
}

fn begin(link: &mut Link, fence: Option<&Fence>) -> Result<(), Trouble> {
    let Some(fence) = fence else { return link.batch("BEGIN").map(drop) };
    let rows = link.batch(AssertSqlSafe(fence.begin.clone()))?;
    match rows.last().map(|row| row.get::<i64>(0)).transpose()? {
        Some(taken) if taken == fence.taken => Ok(()),
        _ => Err(CatalogError::TakenOver.into()),
    }
}
