//! One connection, and what is done by it: on the thread that asks for it.

use super::place::Place;
use super::trouble::Trouble;
use crate::CatalogError;
use futures_util::future::join;
use std::cell::RefCell;
use std::collections::HashMap;
use std::future::Future;
use std::time::Duration;
use tokio::runtime::{Builder, Handle, Runtime, RuntimeFlavor};
use tokio::task::block_in_place;
use tokio::time::timeout;
use tokio_postgres::types::ToSql;
use tokio_postgres::{Client, NoTls, Row, SimpleQueryMessage, Statement};

/// Parameters of a statement.
pub(super) type Parameters<'a> = &'a [&'a (dyn ToSql + Sync)];

/// Begins changes of the process that has the database.
pub(super) struct Fence {
    /// Begins a transaction that the next owner waits for, and asks how often the database was taken.
    pub(super) begin: String,
    /// How often it was taken, this process included.
    pub(super) taken: i64,
}

pub(super) struct Link {
    client: Client,
    statements: RefCell<HashMap<String, Statement>>,
    /// Always there until it is dropped.
    runtime: Option<Runtime>,
}

impl Link {
    pub(super) fn connect(place: &Place) -> Result<Self, CatalogError> {
        Self::try_connect(place).map_err(|trouble| trouble.explain(&place.name))
    }

    /// As [`Self::connect`], with what is wrong where it is.
    pub(super) fn try_connect(place: &Place) -> Result<Self, Trouble> {
        let runtime = Builder::new_current_thread().enable_io().enable_time().build();
        let runtime = runtime.map_err(|error| CatalogError::Failed(format!("{}: {error}", place.name)))?;
        let connecting = async {
            // What moves the bytes only goes on while a call waits.
            match &place.tls {
                Some(tls) => {
                    let (client, connection) = place.config.connect(tls.clone()).await?;
                    tokio::spawn(connection);
                    Ok(client)
                }
                None => {
                    let (client, connection) = place.config.connect(NoTls).await?;
                    tokio::spawn(connection);
                    Ok(client)
                }
            }
        };
        let connected = runtime.block_on(within(place.connect, connecting));
        match connected {
            Ok(client) => Ok(Self { client, statements: RefCell::default(), runtime: Some(runtime) }),
            Err(trouble) => {
                runtime.shutdown_background();
                Err(trouble)
            }
        }
    }

    /// Does `work`, for at most so long.
    pub(super) fn read<T>(
        &self,
        limit: Duration,
        work: &impl AsyncFn(&Self) -> Result<T, Trouble>,
    ) -> Result<T, Trouble> {
        self.block_on(within(limit, work(self)))
    }

    /// Does `work` in a transaction, unless another process has taken the database over. Only after [`Trouble::Unknown`] something may be changed.
    pub(super) fn write<T>(
        &self,
        limit: Duration,
        fence: Option<&Fence>,
        work: &impl AsyncFn(&Self) -> Result<T, Trouble>,
    ) -> Result<T, Trouble> {
        self.block_on(async {
            let worked = async {
                // Sent together, in this order.
                let (begun, worked) = join(self.begin(fence), work(self)).await;
                begun?;
                worked
            };
            match within(limit, worked).await {
                Ok(value) => {
                    let committed = within(limit, async { Ok(self.client.batch_execute("COMMIT").await?) }).await;
                    committed.map(|()| value).map_err(|trouble| match trouble.is_broken() {
                        true => Trouble::Unknown(Box::new(trouble)),
                        false => trouble,
                    })
                }
                Err(trouble) => {
                    if !trouble.is_broken() {
                        within(limit, async { Ok(self.client.batch_execute("ROLLBACK").await?) }).await?;
                    }
                    Err(trouble)
                }
            }
        })
    }

    async fn begin(&self, fence: Option<&Fence>) -> Result<(), Trouble> {
        let Some(fence) = fence else { return Ok(self.client.batch_execute("BEGIN").await?) };
        let said = self.client.simple_query(&fence.begin).await?;
        let taken = said.iter().rev().find_map(|message| match message {
            SimpleQueryMessage::Row(row) => row.get(0)?.parse().ok(),
            _ => None,
        });
        if taken == Some(fence.taken) { Ok(()) } else { Err(CatalogError::TakenOver.into()) }
    }

    pub(super) async fn query(&self, sql: &str, parameters: Parameters<'_>) -> Result<Vec<Row>, Trouble> {
        let known = self.statements.borrow().get(sql).cloned();
        let statement = match known {
            Some(statement) => statement,
            None => {
                let statement = self.client.prepare(sql).await?;
                self.statements.borrow_mut().insert(sql.to_owned(), statement.clone());
                statement
            }
        };
        Ok(self.client.query(&statement, parameters).await?)
    }

    pub(super) async fn batch(&self, sql: &str) -> Result<(), Trouble> {
        Ok(self.client.batch_execute(sql).await?)
    }

    fn block_on<T>(&self, work: impl Future<Output = Result<T, Trouble>>) -> Result<T, Trouble> {
        let ended = || CatalogError::Failed("the connection has ended".to_owned());
        let runtime = self.runtime.as_ref().ok_or_else(ended)?;
        match Handle::try_current().map(|handle| handle.runtime_flavor()) {
            // Of asynchronous work, which goes on elsewhere meanwhile.
            Ok(RuntimeFlavor::MultiThread) => block_in_place(|| runtime.block_on(work)),
            _ => runtime.block_on(work),
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // Wherever that happens: it does not wait.
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

async fn within<T>(limit: Duration, work: impl Future<Output = Result<T, Trouble>>) -> Result<T, Trouble> {
    timeout(limit, work).await.unwrap_or(Err(Trouble::TimedOut))
}
