//! What leads the tables of each engine from one version to the next, from none on.

use crate::CatalogError;

/// The version to which a step leads, and its SQL.
pub(crate) type Step = (i64, &'static str);

pub(crate) const SQLITE: [Step; 1] = [(1, include_str!("../migrations/sqlite/1_catalogue.sql"))];

pub(crate) const POSTGRES: [Step; 2] = [
    (1, include_str!("../migrations/postgres/1_catalogue.sql")),
    (4, include_str!("../migrations/postgres/4_seen.sql")),
];

/// The steps that tables of version `found` lack.
pub(crate) fn missing(steps: &[Step], found: i64) -> Result<&[Step], CatalogError> {
    let newest = steps.last().map_or(0, |(version, _)| *version);
    match found > newest {
        true => Err(CatalogError::Newer { found, known: newest }),
        false => Ok(&steps[steps.partition_point(|(version, _)| *version <= found)..]),
    }
}
