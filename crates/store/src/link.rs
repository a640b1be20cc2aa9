//! One connection to either engine, and statements by it: on the thread that asks for them.

use crate::CatalogError;
use crate::trouble::Trouble;
use futures_util::TryStreamExt as _;
use sqlx::error::BoxDynError;
use sqlx::postgres::{PgArguments, PgConnectOptions, PgRow};
use sqlx::sqlite::{SqliteArguments, SqliteConnectOptions, SqliteRow};
use sqlx::{
    Arguments as _, Column as _, ConnectOptions as _, Connection as _, Decode, PgConnection, Postgres, Row as _,
    SqlSafeStr, Sqlite, SqliteConnection, Type,
};
use std::future::Future;
use std::time::{Duration, Instant};
use tokio::runtime::{Builder, Handle, Runtime, RuntimeFlavor};
use tokio::task::block_in_place;
use tokio::time::timeout_at;

/// A parameter of a statement.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Value<'a> {
    Integer(i64),
    Real(f64),
    Text(&'a str),
    Bytes(Option<&'a [u8]>),
    /// Lists, which SQLite does not have.
    Integers(&'a [i64]),
    Reals(&'a [f64]),
    Blobs(&'a [Option<&'a [u8]>]),
}

pub(crate) struct Link {
    /// Always there until it is dropped.
    on: Option<On>,
    /// When the database has to have answered.
    until: Option<Instant>,
}

enum On {
    Sqlite(SqliteConnection),
    Postgres(PgConnection, Runtime),
}

impl std::fmt::Debug for Link {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("Link")
    }
}

impl Link {
    pub(crate) fn to_sqlite(options: &SqliteConnectOptions) -> Result<Self, Trouble> {
        let connection = futures_executor::block_on(options.connect())?;
        Ok(Self { on: Some(On::Sqlite(connection)), until: None })
    }

    /// Within so long.
    pub(crate) fn to_postgres(options: &PgConnectOptions, limit: Duration) -> Result<Self, Trouble> {
        let runtime = Builder::new_current_thread().enable_io().enable_time().build();
        let runtime = runtime.map_err(|error| CatalogError::Failed(error.to_string()))?;
        let connected = run(&runtime, Instant::now().checked_add(limit), async { Ok(options.connect().await?) });
        match connected {
            Ok(connection) => Ok(Self { on: Some(On::Postgres(connection, runtime)), until: None }),
            Err(trouble) => {
                runtime.shutdown_background();
                Err(trouble)
            }
        }
    }

    pub(crate) fn is_postgres(&self) -> bool {
        matches!(self.on, Some(On::Postgres(..)))
    }

    /// Answers have so long from now on. It is PostgreSQL that may be out of reach.
    pub(crate) fn limit(&mut self, limit: Duration) {
        self.until = Instant::now().checked_add(limit);
    }

    /// What `read` makes of each row.
    pub(crate) fn query<T>(
        &mut self,
        sql: impl SqlSafeStr,
        values: &[Value<'_>],
        mut read: impl FnMut(&Row) -> Result<T, Trouble>,
    ) -> Result<Vec<T>, Trouble> {
        let mut all = Vec::new();
        match &mut self.on {
            Some(On::Sqlite(connection)) => {
                let mut rows = sqlx::query_with(sql, of_sqlite(values).map_err(unusable)?).fetch(connection);
                while let Some(row) = futures_executor::block_on(rows.try_next())? {
                    all.push(read(&Row::Sqlite(row))?);
                }
            }
            Some(On::Postgres(connection, runtime)) => {
                let mut rows = sqlx::query_with(sql, of_postgres(values).map_err(unusable)?).fetch(connection);
                run(runtime, self.until, async {
                    while let Some(row) = rows.try_next().await? {
                        all.push(read(&Row::Postgres(row))?);
                    }
                    Ok(())
                })?;
            }
            None => return Err(ended()),
        }
        Ok(all)
    }

    /// The first column of the first row.
    pub(crate) fn first<T>(&mut self, sql: impl SqlSafeStr, values: &[Value<'_>]) -> Result<Option<T>, Trouble>
    where
        T: for<'r> Read<'r>,
    {
        Ok(self.query(sql, values, |row| row.get(0))?.into_iter().next())
    }

    /// As [`Self::first`], of statements that always answer.
    pub(crate) fn only<T>(&mut self, sql: impl SqlSafeStr, values: &[Value<'_>]) -> Result<T, Trouble>
    where
        T: for<'r> Read<'r>,
    {
        self.first(sql, values)?.ok_or_else(|| CatalogError::Failed("the database gave no row".to_owned()).into())
    }

    /// How many rows were changed.
    pub(crate) fn execute(&mut self, sql: impl SqlSafeStr, values: &[Value<'_>]) -> Result<u64, Trouble> {
        match &mut self.on {
            Some(On::Sqlite(connection)) => {
                let query = sqlx::query_with(sql, of_sqlite(values).map_err(unusable)?);
                Ok(futures_executor::block_on(query.execute(connection))?.rows_affected())
            }
            Some(On::Postgres(connection, runtime)) => {
                let query = sqlx::query_with(sql, of_postgres(values).map_err(unusable)?);
                run(runtime, self.until, async { Ok(query.execute(connection).await?.rows_affected()) })
            }
            None => Err(ended()),
        }
    }

    /// Several statements at once, without parameters. All their rows.
    pub(crate) fn batch(&mut self, sql: impl SqlSafeStr) -> Result<Vec<Row>, Trouble> {
        let all = sqlx::raw_sql(sql);
        match &mut self.on {
            Some(On::Sqlite(connection)) => {
                let rows = futures_executor::block_on(all.fetch_all(connection))?;
                Ok(rows.into_iter().map(Row::Sqlite).collect())
            }
            Some(On::Postgres(connection, runtime)) => {
                let rows = run(runtime, self.until, async { Ok(all.fetch_all(connection).await?) })?;
                Ok(rows.into_iter().map(Row::Postgres).collect())
            }
            None => Err(ended()),
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        match self.on.take() {
            Some(On::Sqlite(connection)) => {
                // Whoever opens the file next finds it closed.
                if let Err(error) = futures_executor::block_on(connection.close()) {
                    tracing::warn!(%error, "the catalogue could not be closed");
                }
            }
            // Wherever that happens: it does not wait.
            Some(On::Postgres(_, runtime)) => runtime.shutdown_background(),
            None => {}
        }
    }
}

/// What both engines read a value as.
pub(crate) trait Read<'r>: Decode<'r, Sqlite> + Type<Sqlite> + Decode<'r, Postgres> + Type<Postgres> {}

impl<'r, T: Decode<'r, Sqlite> + Type<Sqlite> + Decode<'r, Postgres> + Type<Postgres>> Read<'r> for T {}

pub(crate) enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

impl Row {
    pub(crate) fn get<'r, T: Read<'r>>(&'r self, column: usize) -> Result<T, Trouble> {
        Ok(match self {
            Self::Sqlite(row) => row.try_get(column)?,
            Self::Postgres(row) => row.try_get(column)?,
        })
    }

    /// A column whose numbers are those of `T`.
    pub(crate) fn number<T: TryFrom<i64>>(&self, column: usize) -> Result<T, Trouble> {
        self.optional(column)?.ok_or_else(|| self.unreadable(column).into())
    }

    pub(crate) fn optional<T: TryFrom<i64>>(&self, column: usize) -> Result<Option<T>, Trouble> {
        let number: Option<i64> = self.get(column)?;
        number.map(|number| T::try_from(number).map_err(|_| self.unreadable(column).into())).transpose()
    }

    /// What is said of a value that was never written.
    pub(crate) fn unreadable(&self, column: usize) -> CatalogError {
        let name = match self {
            Self::Sqlite(row) => row.column(column).name(),
            Self::Postgres(row) => row.column(column).name(),
        };
        CatalogError::Damaged(format!("the column {name} has a value that was never written"))
    }
}

fn of_sqlite(values: &[Value<'_>]) -> Result<SqliteArguments, BoxDynError> {
    let mut arguments = SqliteArguments::default();
    for value in values {
        match value {
            Value::Integer(value) => arguments.add(value)?,
            Value::Real(value) => arguments.add(value)?,
            Value::Text(value) => arguments.add(*value)?,
            Value::Bytes(value) => arguments.add(value)?,
            Value::Integers(_) | Value::Reals(_) | Value::Blobs(_) => return Err("SQLite has no lists".into()),
        }
    }
    Ok(arguments)
}

fn of_postgres(values: &[Value<'_>]) -> Result<PgArguments, BoxDynError> {
    let mut arguments = PgArguments::default();
    for value in values {
        match value {
            Value::Integer(value) => arguments.add(value)?,
            Value::Real(value) => arguments.add(value)?,
            Value::Text(value) => arguments.add(*value)?,
            Value::Bytes(value) => arguments.add(value)?,
            Value::Integers(values) => arguments.add(*values)?,
            Value::Reals(values) => arguments.add(*values)?,
            Value::Blobs(values) => arguments.add(*values)?,
        }
    }
    Ok(arguments)
}

fn unusable(error: impl std::fmt::Display) -> Trouble {
    CatalogError::Failed(error.to_string()).into()
}

fn ended() -> Trouble {
    CatalogError::Failed("the connection has ended".to_owned()).into()
}

/// Does `work`, for which it is waited until then.
fn run<T>(
    runtime: &Runtime,
    until: Option<Instant>,
    work: impl Future<Output = Result<T, Trouble>>,
) -> Result<T, Trouble> {
    let in_time = async {
        match until {
            Some(until) => timeout_at(until.into(), work).await.unwrap_or(Err(Trouble::TimedOut)),
            None => work.await,
        }
    };
    match Handle::try_current().map(|handle| handle.runtime_flavor()) {
        // Of asynchronous work, which goes on elsewhere meanwhile.
        Ok(RuntimeFlavor::MultiThread) => block_in_place(|| runtime.block_on(in_time)),
        _ => runtime.block_on(in_time),
    }
}
