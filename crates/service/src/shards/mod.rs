//! Several processes that serve the tenants of one database at once. Each tenant is in one shard; a process has some of the shards, each with a service of
//! its own, answers requests of their tenants, and sends those of others on to the process that has them. Where a process ends, the others take its shards over.

mod forward;
mod hold;
mod leave;
mod routes;
mod share;

pub(crate) use hold::start;
pub(crate) use routes::{answered, seen, seen_by_operators};

use crate::config::ServeConfig;
use crate::http::listen::ConnectionHandle;
use crate::http::{Operated, until};
use crate::problem::{self, ApiError};
use crate::resources::Resources;
use crate::service::Service;
use crate::sync::lock;
use crate::tasks::blocking;
use axum::Router;
use axum::extract::Request;
use axum::response::{IntoResponse, Response};
use cager_store::{Members, Membership};
use forward::{Forwarder, Going, Sent, given_up};
use futures_util::FutureExt as _;
use http::request::Parts;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use tokio_util::task::task_tracker::TaskTrackerToken;
use tower::ServiceExt;

/// How long a request waits for a process to have its shard.
const SHARD_WAIT: Duration = Duration::from_secs(10);
/// How long it waits for news at a time.
const PAUSE: Duration = Duration::from_millis(100);

/// The shards of this process, and who has the others.
pub(crate) struct Shards {
    config: ServeConfig,
    resources: Arc<Resources>,
    members: Arc<Members>,
    own: Mutex<BTreeMap<u32, Own>>,
    /// What was seen last.
    seen: watch::Sender<Membership>,
    /// When that was.
    seen_at: Mutex<Instant>,
    /// When it could not be seen for the last time.
    trouble: Mutex<Option<Instant>>,
    /// Held while shards are taken.
    taking: tokio::sync::Mutex<()>,
    /// Shards of tenants, which do not change.
    tenants: Mutex<HashMap<String, u32>>,
    forwarder: Forwarder,
    /// The process is about to end: it gives its shards up, and goes on sending requests to others.
    stop: CancellationToken,
    /// It has given them up: what passes through it ends.
    ended: CancellationToken,
}

/// A shard that this process has.
struct Own {
    service: Arc<Service>,
    router: Router,
    stop: CancellationToken,
    /// Ends requests that go on although they were told to end.
    cut: CancellationToken,
    /// Requests in progress.
    requests: TaskTracker,
    /// It is being given up: new requests wait for the process that gets it.
    is_leaving: bool,
}

/// Whose a request is.
enum Asked {
    /// That of a tenant, in its shard.
    Shard(u32, String),
    /// Nobody's: any process can answer.
    Any,
}

impl Asked {
    /// Whose limits its response counts for.
    fn tenant(&self) -> &str {
        match self {
            Self::Shard(_, tenant) => tenant,
            Self::Any => "",
        }
    }
}

impl Shards {
    /// The services of this process.
    pub(crate) fn services(&self) -> Vec<Arc<Service>> {
        lock(&self.own).values().map(|own| Arc::clone(&own.service)).collect()
    }

    /// What operators see and do something to.
    pub(crate) fn operated(self: &Arc<Self>) -> Operated {
        let shards = Arc::clone(self);
        Operated {
            resources: Arc::clone(&self.resources),
            services: Arc::new(move || shards.services()),
            stop: self.stop.clone(),
        }
    }

    /// Answers a request, here or by the process that has its tenant's shard.
    async fn answer(&self, request: Request) -> Response {
        let (parts, body) = request.into_parts();
        let path = parts.uri.path().to_owned();
        let asked = match self.asked(&parts).await {
            Ok(asked) => asked,
            Err(error) => return self.refuse(error, &path, "database"),
        };
        let mut request = Request::from_parts(parts, body);
        let mut news = self.seen.subscribe();
        let deadline = Instant::now() + SHARD_WAIT;
        let given_up = given_up(self.ended.clone());
        // What waits counts as a request of its tenant, as what is at work does.
        let mut place = None;
        loop {
            news.mark_unchanged();
            if let Some(here) = self.enter(&asked) {
                let answered = here.cut.clone().run_until_cancelled_owned(here.router.oneshot(request)).await;
                let Some(answered) = answered else { return self.refuse(moved(), &path, "moved") };
                let cut = here.cut.cancelled_owned();
                return answered.into_response().map(|body| until(body, cut, here.token));
            }
            if let Some(address) = self.elsewhere(&asked) {
                let room = (Arc::clone(&self.resources.download_memory), asked.tenant().to_owned());
                let going = Going { seen: self.seen.subscribe(), given_up: given_up.clone(), room };
                match self.forwarder.send(request, &address, going).await {
                    Sent::Answered(response) => return response,
                    Sent::Refused(error, reason) => return self.refuse(error, &path, reason),
                    Sent::NotTaken(again) => request = again,
                }
            }
            if self.stop.is_cancelled() && (self.is_alone() || given_up.clone().now_or_never().is_some()) {
                let stopping = ApiError::new(problem::STOPPING, "the service is stopping").retry_after(5);
                return self.refuse(stopping, &path, "stopping");
            }
            if let (Asked::Shard(_, tenant), None) = (&asked, &place) {
                match self.resources.requests.try_take(tenant, 1) {
                    Ok(held) => place = Some(held),
                    Err(full) => {
                        return self.refuse(full.refusal("requests at a time").retry_after(1), &path, "requests");
                    }
                }
            }
            if Instant::now() >= deadline {
                let detail = "no process has the sessions of this tenant at the moment; try again soon";
                return self.refuse(ApiError::new(problem::BUSY, detail).retry_after(2), &path, "no_holder");
            }
            let _ = tokio::time::timeout(PAUSE, news.changed()).await;
        }
    }

    /// The response to a request that no service has seen.
    fn refuse(&self, mut error: ApiError, path: &str, reason: &'static str) -> Response {
        self.resources.rejected(reason);
        let id = uuid::Uuid::now_v7().simple().to_string();
        tracing::warn!(request_id = id, path, reason, detail = %error.problem.detail, "a request is refused");
        error.problem.request_id = Some(id);
        error.into_response()
    }

    /// Whose the request is. One without a valid token is nobody's, and is refused where it is answered.
    async fn asked(&self, request: &Parts) -> Result<Asked, ApiError> {
        if !request.uri.path().starts_with("/v1/") {
            return Ok(Asked::Any);
        }
        let Ok(grant) = self.resources.access.grant(&request.headers).await else { return Ok(Asked::Any) };
        if let Some(connection) = request.extensions.get::<ConnectionHandle>() {
            connection.caller_is_known();
        }
        let shard = self.shard_of(&grant.tenant.name).await?;
        Ok(Asked::Shard(shard, grant.tenant.name.clone()))
    }

    async fn shard_of(&self, tenant: &str) -> Result<u32, ApiError> {
        let deadline = Instant::now() + SHARD_WAIT;
        loop {
            if let Some(&known) = lock(&self.tenants).get(tenant) {
                return Ok(known);
            }
            let (members, name) = (Arc::clone(&self.members), tenant.to_owned());
            let why = match blocking(move || members.shard_of(&name)).await? {
                Ok(Some(shard)) => {
                    lock(&self.tenants).insert(tenant.to_owned(), shard);
                    return Ok(shard);
                }
                Ok(None) => "the sessions that were there before are being looked through".to_owned(),
                Err(error) => error.to_string(),
            };
            if Instant::now() >= deadline {
                tracing::error!(tenant, why, "it is not known where a tenant is");
                let detail = "the service's database does not answer; the log has the reason";
                return Err(ApiError::new(problem::STORAGE_FAILED, detail).retry_after(5));
            }
            tokio::time::sleep(PAUSE).await;
        }
    }

    /// Where a shard that this process has answers.
    fn enter(&self, asked: &Asked) -> Option<Here> {
        let own = lock(&self.own);
        let own = match asked {
            Asked::Shard(shard, _) => own.get(shard),
            Asked::Any => own.values().find(|own| !own.is_leaving),
        };
        let own = own.filter(|own| !own.is_leaving)?;
        Some(Here { router: own.router.clone(), token: own.requests.token(), cut: own.cut.clone() })
    }

    /// Whether no other process goes on.
    fn is_alone(&self) -> bool {
        self.seen.borrow().staying().all(|number| number == self.members.number())
    }

    /// Address of the other process that has it.
    fn elsewhere(&self, asked: &Asked) -> Option<String> {
        let seen = self.seen.borrow();
        let holder = match asked {
            Asked::Shard(shard, _) => seen.holders.get(shard),
            Asked::Any => seen.holders.values().find(|holder| **holder != self.members.number()),
        };
        let holder = holder.filter(|holder| **holder != self.members.number())?;
        seen.processes.get(holder).cloned()
    }
}

/// A shard that answers a request.
struct Here {
    router: Router,
    /// Counts the request until its response is sent.
    token: TaskTrackerToken,
    /// Ends it before.
    cut: CancellationToken,
}

fn moved() -> ApiError {
    ApiError::new(problem::STOPPING, "another process serves this tenant from now on; send the request again")
        .retry_after(1)
}
