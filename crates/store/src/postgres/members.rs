//! Who serves what where several processes share a database: each tenant is in one shard, a shard is a catalogue with a schema of its own, and one process
//! at a time has it. What is said here leads requests; that nobody else changes a shard is the lock and the number of its own catalogue.

use super::claim::OWNER;
use super::link::Link;
use super::place::Place;
use super::rows::only;
use super::schema::{self, hash};
use super::trouble::Trouble;
use crate::CatalogError;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Distinguishes the locks that processes hold while they live.
const MEMBER: i32 = 0x6361_6768;
/// How long a call may take.
const LIMIT: Duration = Duration::from_secs(5);
/// Most shards: each takes connections of the database.
pub const MAX_SHARDS: u32 = 64;

/// One of the processes that share a database. Calls block.
pub struct Members {
    place: Place,
    link: Mutex<Option<Link>>,
    number: i32,
    address: String,
    schema: String,
    /// How many shards were seen last.
    shards: AtomicU32,
    /// It is about to end.
    is_ending: AtomicBool,
}

/// How things are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Membership {
    /// Addresses of the processes that live, by their numbers.
    pub processes: BTreeMap<i32, String>,
    /// Those of them that are about to end, and take no more shards.
    pub ending: BTreeSet<i32>,
    /// Which process serves which shard, of those that live.
    pub holders: BTreeMap<u32, i32>,
    /// Shards that no process has for itself.
    pub free: BTreeSet<u32>,
}

impl Membership {
    /// Numbers of the processes that live and go on.
    pub fn staying(&self) -> impl Iterator<Item = i32> {
        self.processes.keys().filter(|number| !self.ending.contains(number)).copied()
    }
}

impl Members {
    /// Joins those who share the database at `url`, which is divided into `shards` shards at least: as many as it was divided into before. `address` is where
    /// the others reach this process.
    ///
    /// # Errors
    /// [`CatalogError::Newer`].
    pub fn join(url: &str, shards: u32, address: &str) -> Result<Self, CatalogError> {
        let place = Place::parse(url)?;
        let link = Link::connect(&place)?;
        let explained = |trouble: Trouble| trouble.explain(&place.name);
        schema::prepare(&link, super::PREPARING).map_err(explained)?;
        let schema = link.read(LIMIT, &async |link: &Link| schema::schema(link).await).map_err(explained)?;
        let wanted = shards.clamp(1, MAX_SHARDS) as i32;
        let made = link.write(LIMIT, None, &async |link: &Link| {
            link.query("SELECT pg_advisory_xact_lock($1, $2)", &[&MEMBER, &0]).await?;
            let sql = "INSERT INTO shards (number) SELECT generate_series(0, $1 - 1) ON CONFLICT DO NOTHING";
            link.query(sql, &[&wanted]).await?;
            // Of processes that have ended.
            let sql = "DELETE FROM processes WHERE number::bigint & 4294967295 NOT IN (SELECT objid::bigint FROM pg_locks WHERE locktype = 'advisory' AND classid::bigint = $1 AND granted)";
            link.query(sql, &[&i64::from(MEMBER)]).await?;
            let rows = link.query("SELECT count(*), (random() * 2147483646)::integer + 1 FROM shards", &[]).await?;
            let row = rows.first().ok_or(CatalogError::Gone)?;
            Ok((row.try_get::<_, i64>(0)?, row.try_get::<_, i32>(1)?))
        });
        let (count, number) = made.map_err(explained)?;
        let members = Self {
            place,
            link: Mutex::new(Some(link)),
            number,
            address: address.to_owned(),
            schema,
            shards: AtomicU32::new(count as u32),
            is_ending: AtomicBool::new(false),
        };
        members.call(&async |link: &Link| members.enter(link).await)?;
        Ok(members)
    }

    /// Number of this process.
    pub fn number(&self) -> i32 {
        self.number
    }

    /// How many shards there are; another process may have made more.
    pub fn shards(&self) -> u32 {
        self.shards.load(Ordering::Relaxed)
    }

    /// How things are now.
    pub fn look(&self) -> Result<Membership, CatalogError> {
        self.call(&async |link: &Link| {
            let sql = "SELECT classid::bigint, objid::bigint FROM pg_locks WHERE locktype = 'advisory' AND granted AND classid::bigint IN ($1, $2) AND database = (SELECT oid FROM pg_database WHERE datname = current_database())";
            let mut locked = BTreeSet::new();
            for row in link.query(sql, &[&i64::from(OWNER), &i64::from(MEMBER)]).await? {
                locked.insert((row.try_get::<_, i64>(0)?, row.try_get::<_, i64>(1)?));
            }
            let is_locked = |class: i32, object: i32| locked.contains(&(i64::from(class), i64::from(object as u32)));
            if !is_locked(MEMBER, self.number) {
                self.enter(link).await?;
            }
            let mut now = Membership::default();
            for row in link.query("SELECT number, address, is_ending FROM processes", &[]).await? {
                let number = row.try_get(0)?;
                if number == self.number || is_locked(MEMBER, number) {
                    now.processes.insert(number, row.try_get(1)?);
                    if row.try_get(2)? {
                        now.ending.insert(number);
                    }
                }
            }
            let shards = link.query("SELECT number, holder FROM shards", &[]).await?;
            self.shards.store(shards.len() as u32, Ordering::Relaxed);
            for row in shards {
                let (shard, holder): (i32, Option<i32>) = (row.try_get(0)?, row.try_get(1)?);
                let shard = shard as u32;
                if let Some(holder) = holder.filter(|holder| now.processes.contains_key(holder)) {
                    now.holders.insert(shard, holder);
                }
                if !is_locked(OWNER, hash(&schema_of(&self.schema, shard))) {
                    now.free.insert(shard);
                }
            }
            Ok(now)
        })
    }

    /// Says that this process serves a shard. `tenants` are those whose sessions it has, from a time before it was divided.
    pub fn serves(&self, shard: u32, tenants: &[String]) -> Result<(), CatalogError> {
        self.write(&async |link: &Link| {
            let shard = shard as i32;
            for tenant in tenants {
                let sql = "INSERT INTO tenants (tenant, shard) VALUES ($1, $2) ON CONFLICT DO NOTHING";
                link.query(sql, &[tenant, &shard]).await?;
            }
            link.query("UPDATE shards SET holder = $2, told = true WHERE number = $1", &[&shard, &self.number]).await?;
            Ok(())
        })
    }

    /// Says that this process serves these shards no longer.
    pub fn leaves(&self, shards: &[u32]) -> Result<(), CatalogError> {
        let shards: Vec<i32> = shards.iter().map(|shard| *shard as i32).collect();
        self.write(&async |link: &Link| {
            let sql = "UPDATE shards SET holder = NULL WHERE number = ANY($1) AND holder = $2";
            link.query(sql, &[&shards, &self.number]).await?;
            Ok(())
        })
    }

    /// Says that this process is about to end.
    pub fn ends(&self) -> Result<(), CatalogError> {
        self.is_ending.store(true, Ordering::Relaxed);
        self.write(&async |link: &Link| {
            link.query("UPDATE processes SET is_ending = true WHERE number = $1", &[&self.number]).await?;
            Ok(())
        })
    }

    /// The shard of a tenant: a new one comes to where the fewest are, of those that were served before. `None` while it is not known yet who was there before.
    pub fn shard_of(&self, tenant: &str) -> Result<Option<u32>, CatalogError> {
        self.write(&async |link: &Link| {
            let find = "SELECT shard FROM tenants WHERE tenant = $1";
            if let Some(row) = link.query(find, &[&tenant]).await?.first() {
                return Ok(Some(row.try_get::<_, i32>(0)? as u32));
            }
            let told = link.query("SELECT told FROM shards WHERE number = 0", &[]).await?;
            if !only::<bool>(&told)? {
                return Ok(None);
            }
            // One at a time, so that they are spread.
            link.query("SELECT pg_advisory_xact_lock($1, $2)", &[&MEMBER, &0]).await?;
            let sql = "INSERT INTO tenants (tenant, shard) SELECT $1, number FROM shards LEFT JOIN (SELECT shard, count(*) AS tenants FROM tenants GROUP BY shard) AS counted ON shard = number WHERE told ORDER BY coalesce(tenants, 0), number LIMIT 1 ON CONFLICT DO NOTHING";
            link.query(sql, &[&tenant]).await?;
            Ok(Some(only::<i32>(&link.query(find, &[&tenant]).await?)? as u32))
        })
    }

    /// Takes the lock that says that this process lives, and says where it is.
    async fn enter(&self, link: &Link) -> Result<(), Trouble> {
        link.query("SELECT pg_try_advisory_lock($1, $2)", &[&MEMBER, &self.number]).await?;
        let sql =
            "INSERT INTO processes (number, address) VALUES ($1, $2) ON CONFLICT (number) DO UPDATE SET address = $2";
        link.query(sql, &[&self.number, &self.address]).await?;
        Ok(())
    }

    fn call<T>(&self, work: &impl AsyncFn(&Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        self.by_link(|link| link.read(LIMIT, work))
    }

    fn write<T>(&self, work: &impl AsyncFn(&Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        self.by_link(|link| link.write(LIMIT, None, work))
    }

    /// By the connection that there is, or a new one.
    fn by_link<T>(&self, call: impl FnOnce(&Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        let mut kept = self.link.lock().unwrap_or_else(PoisonError::into_inner);
        let link = match kept.take() {
            Some(link) => link,
            None => {
                let link = Link::connect(&self.place)?;
                link.read(LIMIT, &async |link: &Link| self.enter(link).await)
                    .map_err(|trouble| trouble.explain(&self.place.name))?;
                link
            }
        };
        let outcome = call(&link);
        if !outcome.as_ref().is_err_and(Trouble::is_broken) {
            *kept = Some(link);
        }
        outcome.map_err(|trouble| trouble.explain(&self.place.name))
    }
}

/// The schema of a shard: the first one is where all was before.
pub(super) fn schema_of(schema: &str, shard: u32) -> String {
    match shard {
        0 => schema.to_owned(),
        shard => format!("{schema}_{shard}"),
    }
}
