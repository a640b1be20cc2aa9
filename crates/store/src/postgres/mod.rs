//! The catalogue in a PostgreSQL database, for any number of processes.

mod claim;
mod link;
mod members;
mod place;
mod pool;
mod rows;
mod schema;
mod tls;
mod trouble;

use crate::chunks::{Chunk, add_cage, chunks, lost};
use crate::numbers::phase_number;
use crate::{CagePlace, Catalog, CatalogError, Change, FrameEntry, Key, Kind, NewFrame, NewRecord, Phase, Record};
pub use members::{MAX_SHARDS, Members, Membership};

use claim::Claim;
use link::Link;
use place::Place;
use pool::Pool;
use rows::{kind_number, only};
use std::fmt::Debug;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio_postgres::types::ToSql;
use trouble::Trouble;

/// Numbers of chunks that are drawn together, as the schema says.
const DRAWN: i64 = 1024;
/// Chunks of a removed record that are removed in one transaction, which is far from taking too long.
const REMOVED_CHUNKS: i64 = 4096;
/// As [`REMOVED_CHUNKS`], for what is known of frames.
const REMOVED_FRAMES: i64 = 50_000;
/// Bytes of cages from which on they are read.
const READ_BYTES: u64 = 4 << 20;
/// Most pieces of chunks that are read together.
const READ_PIECES: usize = 1024;
/// Most connections at once, and those of all shards of a database together.
const CONNECTIONS: usize = 8;
const SHARED_CONNECTIONS: usize = 32;
/// How long preparing may take, where others may prepare much.
const PREPARING: Duration = Duration::from_secs(60);

/// A catalogue in a database. Several processes can share one.
///
/// Calls block, so that none may come from where that is not allowed, as in asynchronous work of Tokio.
pub struct PostgresCatalog {
    pool: Pool,
    /// Numbers of chunks that nobody else has.
    numbers: Mutex<Range<i64>>,
    /// Set once this process has it for itself.
    claim: Mutex<Option<Claim>>,
}

impl Debug for PostgresCatalog {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "PostgresCatalog({})", self.pool.name())
    }
}

impl PostgresCatalog {
    /// Connects to the database at `url` (`postgres://user:password@host:port/database`) and makes its tables, unless they are there: in the schema
    /// `cager`, or the one that `?options=-csearch_path%3D…` names. `sslmode` is `prefer` (not encrypted), or `require` (encrypted, and the certificate
    /// is checked by those that the system trusts, or the file of `sslrootcert`).
    ///
    /// # Errors
    /// [`CatalogError::Newer`].
    pub fn open(url: &str) -> Result<Self, CatalogError> {
        Self::open_place(Place::parse(url)?, CONNECTIONS)
    }

    /// As [`Self::open`], for one of the shards into which [`Members`] divide the database.
    ///
    /// # Errors
    /// As there.
    pub fn open_shard(url: &str, shard: u32, shards: u32) -> Result<Self, CatalogError> {
        let place = Place::parse(url)?;
        let connections = (SHARED_CONNECTIONS / shards.max(1) as usize).clamp(3, CONNECTIONS);
        if shard == 0 {
            return Self::open_place(place, connections);
        }
        let link = Link::connect(&place)?;
        let known = link.read(PREPARING, &async |link: &Link| {
            let count = only::<i64>(&link.query("SELECT count(*) FROM shards", &[]).await?)?;
            Ok((schema::schema(link).await?, count))
        });
        let (schema, count) = known.map_err(|trouble| trouble.explain(&place.name))?;
        if i64::from(shard) >= count {
            return Err(CatalogError::Failed(format!("{} is divided into {count} shards, from 0", place.name)));
        }
        Self::open_place(place.of_schema(&members::schema_of(&schema, shard)), connections)
    }

    /// Into how many shards the database at `url` is divided. Changes nothing.
    ///
    /// # Errors
    /// An address that cannot be used, a database that cannot be reached or has no catalogue.
    pub fn divided(url: &str) -> Result<u32, CatalogError> {
        let place = Place::parse(url)?;
        let link = Link::connect(&place)?;
        let count = link
            .read(PREPARING, &async |link: &Link| only::<i64>(&link.query("SELECT count(*) FROM shards", &[]).await?));
        Ok(count.map_err(|trouble| trouble.explain(&place.name))? as u32)
    }

    /// Checks the address of a database, with the files that it names, without connecting.
    ///
    /// # Errors
    /// What is wrong with it, without the password.
    pub fn check_address(url: &str) -> Result<(), CatalogError> {
        Place::parse(url).map(drop)
    }

    fn open_place(place: Place, connections: usize) -> Result<Self, CatalogError> {
        let link = Link::connect(&place)?;
        let prepared = schema::prepare(&link, PREPARING).and_then(|()| {
            link.read(PREPARING, &async |link: &Link| {
                let sql = "SELECT setting::bigint FROM pg_settings WHERE name = 'statement_timeout'";
                only::<i64>(&link.query(sql, &[]).await?)
            })
        });
        let limit = match prepared.map_err(|trouble| trouble.explain(&place.name))? {
            // None.
            0 => Duration::MAX,
            milliseconds => Duration::from_millis(milliseconds as u64),
        };
        Ok(Self {
            pool: Pool::new(place, link, limit, connections),
            numbers: Mutex::new(0..0),
            claim: Mutex::new(None),
        })
    }

    /// Takes it for this process alone, until this value is dropped or the process ends. What others have opened before changes nothing afterwards.
    /// Gives how often it was taken.
    ///
    /// # Errors
    /// [`CatalogError::InUse`], with who has it.
    pub fn claim(&self) -> Result<i64, CatalogError> {
        let (claim, fence) = Claim::take(self.pool.place())?;
        let taken = fence.taken;
        self.pool.set_fence(fence);
        *self.claimed() = Some(claim);
        Ok(taken)
    }

    fn claimed(&self) -> MutexGuard<'_, Option<Claim>> {
        self.claim.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the database is called in messages.
    pub fn name(&self) -> &str {
        self.pool.name()
    }

    /// Into how many shards it is divided; 0 where it never was.
    pub fn shards(&self) -> Result<i64, CatalogError> {
        self.pool.read(&async |link: &Link| only(&link.query("SELECT count(*) FROM shards", &[]).await?))
    }

    /// Which folder has the files of its records; `None` where that was never said.
    pub fn folder(&self) -> Result<Option<String>, CatalogError> {
        self.pool.read(&async |link: &Link| only(&link.query("SELECT folder FROM catalogue", &[]).await?))
    }

    /// Notes which folder has the files of its records, unless that was said before. Gives which it is.
    pub fn set_folder(&self, folder: &str) -> Result<String, CatalogError> {
        let sql = "UPDATE catalogue SET folder = coalesce(folder, $1) RETURNING folder";
        self.pool.write(&async |link: &Link| only(&link.query(sql, &[&folder]).await?))
    }

    /// So many numbers for chunks.
    async fn draw(&self, link: &Link, count: usize) -> Result<Vec<i64>, Trouble> {
        let mut drawn = Vec::with_capacity(count);
        loop {
            {
                let mut numbers = self.numbers.lock().unwrap_or_else(PoisonError::into_inner);
                drawn.extend(numbers.by_ref().take(count - drawn.len()));
            }
            if drawn.len() == count {
                return Ok(drawn);
            }
            let first: i64 = only(&link.query("SELECT nextval('chunk_numbers')", &[]).await?)?;
            *self.numbers.lock().unwrap_or_else(PoisonError::into_inner) = first..first + DRAWN;
        }
    }
}

/// Number of the row of a record; `None` if the record does not exist.
async fn number(link: &Link, key: Key<'_>) -> Result<Option<i64>, Trouble> {
    let sql = "SELECT number FROM records WHERE kind = $1 AND id = $2";
    let rows = link.query(sql, &[&kind_number(key.kind), &key.id]).await?;
    Ok(rows.first().map(|row| row.try_get(0)).transpose()?)
}

/// Number of a session.
async fn session(link: &Link, id: &str) -> Result<i64, Trouble> {
    number(link, Key { kind: Kind::Session, id }).await?.ok_or_else(|| CatalogError::Gone.into())
}

impl Catalog for PostgresCatalog {
    fn create(&self, record: NewRecord<'_>) -> Result<(), CatalogError> {
        let (kind, phase) = (kind_number(record.key.kind), i16::from(phase_number(record.phase)));
        let created_ms = record.created_ms as i64;
        self.pool.write(&async |link: &Link| {
            let sql = "INSERT INTO records (kind, id, created_ms, phase, meta) VALUES ($1, $2, $3, $4, $5) ON CONFLICT (kind, id) DO NOTHING RETURNING number";
            let made = link.query(sql, &[&kind, &record.key.id, &created_ms, &phase, &record.meta]).await?;
            if made.is_empty() { Err(CatalogError::Taken.into()) } else { Ok(()) }
        })
    }

    fn record(&self, key: Key<'_>) -> Result<Option<Record>, CatalogError> {
        self.pool.read(&async |link: &Link| {
            let rows = link.query(rows::RECORD, &[&kind_number(key.kind), &key.id]).await?;
            rows.first().map(rows::record).transpose()
        })
    }

    fn records(&self) -> Result<Vec<Record>, CatalogError> {
        self.pool.read(&async |link: &Link| {
            let mut records = Vec::new();
            for row in &link.query(rows::RECORDS, &[]).await? {
                match rows::record(row).map_err(|trouble| trouble.explain(self.pool.name())) {
                    Ok(record) => records.push(record),
                    // It stays, and blocks nobody.
                    Err(error) => tracing::error!(record = rows::identity(row), %error, "a damaged record is left out"),
                }
            }
            Ok(records)
        })
    }

    fn change(&self, key: Key<'_>, changes: &[Change]) -> Result<bool, CatalogError> {
        let columns = rows::columns(changes);
        // What is being appended is waited for, and nothing is appended afterwards.
        let lock = if changes.contains(&Change::Phase(Phase::Deleted)) { "UPDATE" } else { "NO KEY UPDATE" };
        let find = format!("SELECT number FROM records WHERE kind = $1 AND id = $2 FOR {lock}");
        let set: Vec<String> = columns.keys().zip(2..).map(|(column, at)| format!("{column} = ${at}")).collect();
        let update = format!("UPDATE records SET {} WHERE number = $1", set.join(", "));
        self.pool.write(&async |link: &Link| {
            let found = link.query(&find, &[&kind_number(key.kind), &key.id]).await?;
            let Some(number) = found.first().map(|row| row.try_get::<_, i64>(0)).transpose()? else { return Ok(false) };
            if !columns.is_empty() {
                let mut parameters: Vec<&(dyn ToSql + Sync)> = vec![&number];
                parameters.extend(columns.values().map(|value| &**value as &(dyn ToSql + Sync)));
                link.query(&update, &parameters).await?;
            }
            Ok(true)
        })
    }

    fn remove(&self, key: Key<'_>) -> Result<(), CatalogError> {
        let chunks = "WITH gone AS (DELETE FROM chunks WHERE number IN (SELECT number FROM chunks WHERE record = $1 LIMIT $2) RETURNING 1) SELECT count(*) FROM gone";
        let frames = "WITH gone AS (DELETE FROM frames WHERE record = $1 AND frame IN (SELECT frame FROM frames WHERE record = $1 LIMIT $2) RETURNING 1) SELECT count(*) FROM gone";
        loop {
            let is_gone = self.pool.write(&async |link: &Link| {
                let Some(number) = number(link, key).await? else { return Ok(true) };
                for (sql, most) in [(chunks, REMOVED_CHUNKS), (frames, REMOVED_FRAMES)] {
                    if only::<i64>(&link.query(sql, &[&number, &most]).await?)? == most {
                        return Ok(false);
                    }
                }
                link.query("DELETE FROM records WHERE number = $1", &[&number]).await?;
                Ok(true)
            });
            if is_gone? {
                return Ok(());
            }
        }
    }

    fn append(&self, id: &str, frames: &[NewFrame<'_>]) -> Result<Vec<FrameEntry>, CatalogError> {
        let chunks = chunks(id, frames);
        let counted: Vec<i64> = chunks.iter().map(Chunk::counted).collect();
        let bytes: Vec<&[u8]> = chunks.iter().map(|chunk| &chunk.bytes[..]).collect();
        let (kind, deleted) = (kind_number(Kind::Session), i16::from(phase_number(Phase::Deleted)));
        self.pool.write(&async |link: &Link| {
            let numbers = self.draw(link, chunks.len()).await?;
            let placed = chunks.iter().zip(&numbers).flat_map(|(of, chunk)| {
                of.entries
                    .iter()
                    .map(|entry| FrameEntry { place: CagePlace { chunk: *chunk, ..entry.place }, ..*entry })
            });
            let stored: Vec<FrameEntry> = placed.collect();
            let columns = rows::Columns::new(id, &stored);
            let mut parameters: Vec<&(dyn ToSql + Sync)> = vec![&kind, &id, &deleted, &numbers, &counted, &bytes];
            parameters.extend(columns.parameters());
            let found = link.query(rows::APPEND, &parameters).await.inspect_err(|_| {
                // A database that was restored may give numbers again.
                *self.numbers.lock().unwrap_or_else(PoisonError::into_inner) = 0..0;
            });
            if only::<i64>(&found?)? == 1 { Ok(stored) } else { Err(CatalogError::Gone.into()) }
        })
    }

    fn frames(&self, id: &str) -> Result<Vec<FrameEntry>, CatalogError> {
        self.pool.read(&async |link: &Link| {
            let number = session(link, id).await?;
            link.query(rows::FRAMES, &[&number]).await?.iter().map(|row| rows::frame(id, row)).collect()
        })
    }

    fn cages(&self, id: &str, frames: &[FrameEntry], out: &mut Vec<u8>) -> Result<(), CatalogError> {
        // Of each run of frames whose cages are stored together, the bytes from the first to the last.
        let pieces: Vec<&[FrameEntry]> = frames.chunk_by(|a, b| a.place.chunk == b.place.chunk).collect();
        let read = self.pool.read(&async |link: &Link| {
            let number = session(link, id).await?;
            let (mut read, mut rest) = (Vec::new(), &pieces[..]);
            while !rest.is_empty() {
                let mut bytes = 0;
                let fits = |piece: &&&[FrameEntry]| {
                    let fits = bytes < READ_BYTES;
                    bytes += u64::from(extent(piece).1);
                    fits
                };
                let (now, later) = rest.split_at(rest.iter().take(READ_PIECES).take_while(fits).count());
                read_pieces(link, number, id, now, &mut read).await?;
                rest = later;
            }
            Ok(read)
        });
        read.map(|mut read| out.append(&mut read))
    }

    fn probe(&self) -> Result<(), CatalogError> {
        self.pool.write(&async |link: &Link| link.batch("UPDATE catalogue SET probed = now()").await)
    }

    fn check_owner(&self) -> Result<(), CatalogError> {
        let Some(taken) = self.pool.taken() else { return Ok(()) };
        let sql = "SELECT taken FROM catalogue";
        let now: i64 = self.pool.read(&async |link: &Link| only(&link.query(sql, &[]).await?))?;
        if now == taken { Ok(()) } else { Err(CatalogError::TakenOver) }
    }

    fn release(&self) {
        *self.claimed() = None;
    }

    fn is_taken_over(&self) -> bool {
        self.claimed().as_ref().is_some_and(Claim::is_lost)
    }
}

/// Where the bytes of frames that are stored together begin, and how many they are.
fn extent(piece: &[FrameEntry]) -> (u32, u32) {
    let first = piece.iter().map(|entry| entry.place.offset).min().unwrap_or(0);
    let end = piece.iter().map(|entry| entry.place.offset.saturating_add(entry.place.bytes)).max().unwrap_or(0);
    (first, end - first)
}

/// Appends the cages of `pieces` to `out`.
async fn read_pieces(
    link: &Link,
    number: i64,
    id: &str,
    pieces: &[&[FrameEntry]],
    out: &mut Vec<u8>,
) -> Result<(), Trouble> {
    let chunks: Vec<i64> = pieces.iter().map(|piece| piece[0].place.chunk).collect();
    // No chunk is so large that the database could not count its bytes.
    let counts = |of: fn((u32, u32)) -> u32| -> Vec<i32> {
        pieces.iter().map(|piece| of(extent(piece)).try_into().unwrap_or(i32::MAX - 1)).collect()
    };
    let (firsts, lengths) = (counts(|extent| extent.0), counts(|extent| extent.1));
    let sql = "SELECT piece.at, substring(chunks.bytes FROM piece.first + 1 FOR piece.length) FROM unnest($2::bigint[], $3::int[], $4::int[]) WITH ORDINALITY AS piece (chunk, first, length, at) JOIN chunks ON chunks.number = piece.chunk AND chunks.record = $1 ORDER BY piece.at";
    let rows = link.query(sql, &[&number, &chunks, &firsts, &lengths]).await?;
    let mut rows = rows.iter();
    for (piece, at) in pieces.iter().zip(1i64..) {
        let row = rows.next().ok_or_else(|| lost(&piece[0]))?;
        if row.try_get::<_, i64>(0)? != at {
            return Err(lost(&piece[0]).into());
        }
        let stored: &[u8] = row.try_get(1)?;
        piece.iter().try_for_each(|entry| add_cage(id, entry, stored, extent(piece).0, out))?;
    }
    Ok(())
}
