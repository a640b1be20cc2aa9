//! The catalogue by statements that both engines understand; what an engine does in its own way is [`Engine`].

use crate::chunks::{Chunk, add_cage, chunks, lost};
use crate::link::{Link, Value};
use crate::numbers::{kind_number, phase_number};
use crate::trouble::Trouble;
use crate::{Catalog, CatalogError, Change, FrameEntry, Key, Kind, NewFrame, NewRecord, Phase, Record, rows};
use sqlx::AssertSqlSafe;
use std::fmt::Debug;

/// Bytes of cages from which on they are read.
const READ_BYTES: u64 = 4 << 20;
/// Most pieces of chunks that are read together.
const READ_PIECES: usize = 1024;

/// How an engine reads and writes.
pub(crate) trait Engine: Debug + Send + Sync {
    /// Chunks of a removed record, and rows of its frames, that are removed in one transaction: between two of them
    /// others can write.
    const REMOVED: (u32, u32);

    /// What the database is called in messages.
    fn name(&self) -> &str;

    fn read<T>(&self, work: impl FnMut(&mut Link) -> Result<T, Trouble>) -> Result<T, CatalogError>;

    /// Does `work` in a transaction; `frees` where it gives room.
    fn write<T: Send + 'static>(
        &self,
        frees: bool,
        work: impl Fn(&mut Link) -> Result<T, Trouble> + Clone + Send + 'static,
    ) -> Result<T, CatalogError>;

    /// Stores frames of a session.
    fn store(&self, session: &str, chunks: Vec<Chunk>) -> Result<Vec<FrameEntry>, CatalogError>;

    /// Checks that it can be written to.
    fn try_writing(&self) -> Result<(), CatalogError>;

    /// A record was removed.
    fn note_removal(&self) {}

    fn check_owner(&self) -> Result<(), CatalogError> {
        Ok(())
    }

    fn release(&self) {}

    fn is_taken_over(&self) -> bool {
        false
    }
}

/// Number of the row of a record; `None` if the record does not exist. `lock` keeps it until the transaction ends,
/// where
/// others may change it meanwhile.
fn number(link: &mut Link, kind: Kind, id: &str, lock: &str) -> Result<Option<i64>, Trouble> {
    let lock = if link.is_postgres() { lock } else { "" };
    let sql = format!("SELECT number FROM records WHERE kind = $1 AND id = $2{lock}");
    link.first(AssertSqlSafe(sql), &[kind_value(kind), Value::Text(id)])
}

/// Number of a session.
pub(crate) fn session(link: &mut Link, id: &str) -> Result<i64, Trouble> {
    number(link, Kind::Session, id, "")?.ok_or_else(|| CatalogError::Gone.into())
}

pub(crate) fn kind_value(kind: Kind) -> Value<'static> {
    Value::Integer(kind_number(kind).into())
}

pub(crate) fn phase_value(phase: Phase) -> Value<'static> {
    Value::Integer(phase_number(phase).into())
}

impl<E: Engine> Catalog for E {
    fn create(&self, record: NewRecord<'_>) -> Result<(), CatalogError> {
        let NewRecord { key: Key { kind, id }, created_ms, phase, meta } = record;
        let (id, meta) = (id.to_owned(), meta.to_vec());
        self.write(false, move |link| {
            let sql = "INSERT INTO records (kind, id, created_ms, phase, meta) VALUES ($1, $2, $3, $4, $5) \
                ON CONFLICT (kind, id) DO NOTHING";
            let created = Value::Integer(created_ms as i64);
            let values = [kind_value(kind), Value::Text(&id), created, phase_value(phase), Value::Bytes(Some(&meta))];
            if link.execute(sql, &values)? == 1 { Ok(()) } else { Err(CatalogError::Taken.into()) }
        })
    }

    fn record(&self, key: Key<'_>) -> Result<Option<Record>, CatalogError> {
        self.read(|link| {
            let sql = rows::one(link);
            Ok(link.query(sql, &[kind_value(key.kind), Value::Text(key.id)], rows::record)?.into_iter().next())
        })
    }

    fn records(&self) -> Result<Vec<Record>, CatalogError> {
        let all = self.read(|link| {
            let sql = rows::all(link);
            link.query(sql, &[], |row| match rows::record(row) {
                Ok(record) => Ok(Some(record)),
                Err(trouble) => {
                    // It stays, and blocks nobody.
                    let error = trouble.explain(self.name());
                    tracing::error!(record = rows::identity(row), %error, "a damaged record is left out");
                    Ok(None)
                }
            })
        });
        Ok(all?.into_iter().flatten().collect())
    }

    fn change(&self, key: Key<'_>, changes: &[Change]) -> Result<bool, CatalogError> {
        let (kind, id, changes) = (key.kind, key.id.to_owned(), changes.to_vec());
        let frees = changes.contains(&Change::Phase(Phase::Deleted));
        self.write(frees, move |link| {
            // What is being appended is waited for by a deletion, and nothing is appended afterwards.
            let lock = if frees { " FOR UPDATE" } else { " FOR NO KEY UPDATE" };
            let Some(number) = number(link, kind, &id, lock)? else { return Ok(false) };
            let columns = rows::columns(&changes);
            if !columns.is_empty() {
                let set: Vec<String> =
                    columns.keys().zip(2..).map(|(column, at)| format!("{column} = ${at}")).collect();
                let values: Vec<Value<'_>> =
                    [Value::Integer(number)].into_iter().chain(columns.into_values()).collect();
                link.execute(
                    AssertSqlSafe(format!("UPDATE records SET {} WHERE number = $1", set.join(", "))),
                    &values,
                )?;
            }
            Ok(true)
        })
    }

    fn remove(&self, key: Key<'_>) -> Result<(), CatalogError> {
        let chunks = "DELETE FROM chunks WHERE number IN (SELECT number FROM chunks WHERE record = $1 LIMIT $2)";
        let frames =
            "DELETE FROM frames WHERE record = $1 AND frame IN (SELECT frame FROM frames WHERE record = $1 LIMIT $2)";
        let steps = [(chunks, E::REMOVED.0), (frames, E::REMOVED.1)];
        let kind = key.kind;
        loop {
            let id = key.id.to_owned();
            let is_gone = self.write(true, move |link| {
                let Some(number) = number(link, kind, &id, "")? else { return Ok(true) };
                for (sql, most) in steps {
                    let values = [Value::Integer(number), Value::Integer(most.into())];
                    if link.execute(sql, &values)? == u64::from(most) {
                        return Ok(false);
                    }
                }
                link.execute("DELETE FROM records WHERE number = $1", &[Value::Integer(number)])?;
                Ok(true)
            });
            if is_gone? {
                self.note_removal();
                return Ok(());
            }
        }
    }

    fn append(&self, id: &str, frames: &[NewFrame<'_>]) -> Result<Vec<FrameEntry>, CatalogError> {
        self.store(id, chunks(id, frames))
    }

    fn frames(&self, id: &str) -> Result<Vec<FrameEntry>, CatalogError> {
        self.read(|link| {
            let number = session(link, id)?;
            link.query(rows::FRAMES, &[Value::Integer(number)], |row| rows::frame(id, row))
        })
    }

    fn cages(&self, id: &str, frames: &[FrameEntry], out: &mut Vec<u8>) -> Result<(), CatalogError> {
        // Of each run of frames whose cages are stored together, the bytes from the first to the last.
        let pieces: Vec<&[FrameEntry]> = frames.chunk_by(|a, b| a.place.chunk == b.place.chunk).collect();
        let read = self.read(|link| {
            let number = session(link, id)?;
            let (mut read, mut rest) = (Vec::new(), &pieces[..]);
            while !rest.is_empty() {
                let mut bytes = 0;
                let fits = |piece: &&&[FrameEntry]| {
                    let fits = bytes < READ_BYTES;
                    bytes += u64::from(extent(piece).1);
                    fits
                };
                let (now, later) = rest.split_at(rest.iter().take(READ_PIECES).take_while(fits).count());
                read_pieces(link, number, id, now, &mut read)?;
                rest = later;
            }
            Ok(read)
        });
        read.map(|mut read| out.append(&mut read))
    }

    fn probe(&self) -> Result<(), CatalogError> {
        self.try_writing()
    }

    fn check_owner(&self) -> Result<(), CatalogError> {
        Engine::check_owner(self)
    }

    fn release(&self) {
        Engine::release(self);
    }

    fn is_taken_over(&self) -> bool {
        Engine::is_taken_over(self)
    }
}

/// Where the bytes of frames that are stored together begin, and how many they are.
fn extent(piece: &[FrameEntry]) -> (u32, u32) {
    let first = piece.iter().map(|entry| entry.place.offset).min().unwrap_or(0);
    let end = piece.iter().map(|entry| entry.place.offset.saturating_add(entry.place.bytes)).max().unwrap_or(0);
    (first, end - first)
}

/// Appends the cages of `pieces` to `out`.
fn read_pieces(
    link: &mut Link,
    number: i64,
    id: &str,
    pieces: &[&[FrameEntry]],
    out: &mut Vec<u8>,
) -> Result<(), Trouble> {
    // No chunk is so large that the database could not count its bytes.
    let most = i64::from(i32::MAX - 1);
    let asked: Vec<[i64; 3]> = pieces
        .iter()
        .map(|piece| (piece[0].place.chunk, extent(piece)))
        .map(|(chunk, (first, length))| [chunk, most.min(first.into()), most.min(length.into())])
        .collect();
    let sql = match link.is_postgres() {
        true => {
            "SELECT at - 1, substr(bytes, (piece ->> 1)::int + 1, (piece ->> 2)::int) \
             FROM json_array_elements($2::json) WITH ORDINALITY AS asked (piece, at) \
             JOIN chunks ON number = (piece ->> 0)::bigint AND record = $1 ORDER BY at"
        }
        // In the order of the left side.
        false => {
            "SELECT asked.key, substr(bytes, (asked.value ->> 1) + 1, asked.value ->> 2) FROM json_each($2) AS asked \
             CROSS JOIN chunks ON number = asked.value ->> 0 AND record = $1"
        }
    };
    let mut next = 0;
    // It is JSON.
    link.query(sql, &[Value::Integer(number), Value::Text(&format!("{asked:?}"))], |row| {
        let piece = pieces[next];
        if row.get::<i64>(0)? != next as i64 {
            return Err(lost(&piece[0]).into());
        }
        // Of nothing, SQLite gives no part.
        let stored: &[u8] = row.get::<Option<_>>(1)?.unwrap_or_default();
        piece.iter().try_for_each(|entry| add_cage(id, entry, stored, extent(piece).0, out))?;
        next += 1;
        Ok(())
    })?;
    pieces.get(next).map_or(Ok(()), |piece| Err(lost(&piece[0]).into()))
}
