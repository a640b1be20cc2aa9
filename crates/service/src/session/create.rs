//! Creating, preparing and deleting sessions.

use super::cage_source::UploadedFiles;
use super::facts::{Facts, Outcome};
use super::resume::CompletionState;
use super::solve;
use super::upload::FrameJob;
use super::{Phase, Session, SessionQueue, Status};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::idempotency::{create_once, extension, fingerprint, made_before};
use crate::preparation::{self, Geometry, Prepared, SolverRequest, SolverResponse, ValidOptions, content_key};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Content, ContentKey, Idempotency, Kind, NamedFile, SessionMeta, StoredPart};
use crate::tasks::{Pauses, blocking, to_the_end};
use crate::webhooks::Event;
use cager_proto::messages::{CacheUse, PreparationSeconds, SessionOptions};
use http::StatusCode;
use opentelemetry::Context;
use opentelemetry::trace::FutureExt as _;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// A request to create a session.
pub(crate) struct NewSession {
    pub(crate) uploaded: UploadedFiles,
    pub(crate) options: SessionOptions,
    pub(crate) idempotency_key: Option<String>,
    /// Permit for the memory that the uploaded files take.
    pub(crate) room: Permit,
}

/// A request whose options have been validated.
struct Checked {
    key: ContentKey,
    content: Content,
    made_cage: Option<ContentKey>,
    options: SessionOptions,
    valid: ValidOptions,
}

impl Service {
    /// Creates a session, durably, and starts preparing it. A cage is made only as long as the client waits; from then on it runs to the end
    /// even if the client disconnects: otherwise a session that is on disk but not registered would appear only after a restart, beside the
    /// one that the client created instead.
    pub(crate) async fn create(
        self: &Arc<Self>,
        tenant: &Arc<Tenant>,
        new: NewSession,
    ) -> Result<Arc<Session>, ApiError> {
        let NewSession { uploaded, options, idempotency_key, room } = new;
        let room = Arc::new(room);
        let valid = ValidOptions::of(&options)?;
        let (service, owner) = (Arc::clone(self), Arc::clone(tenant));
        let asked = blocking(move || {
            let request = request_of(idempotency_key, &uploaded, &options);
            let may_be = |session: &Session| session.is_of(&uploaded, &options);
            let made = made_before(&service.registry, &owner.name, request.as_ref(), may_be)?;
            Ok::<_, ApiError>((uploaded, options, request, made))
        });
        let (uploaded, options, request, made) = asked.await??;
        if let Some(made) = made {
            return Ok(made);
        }
        let (content, made_cage) = self.resolve_cage(&tenant.name, uploaded, &options, &room).await?;
        let (key, content) = {
            let (tenant, options) = (tenant.name.clone(), options.clone());
            blocking(move || (content_key(&tenant, &content, &options, &valid), content)).await?
        };
        let checked = Checked { key, content, made_cage, options, valid };
        let (service, tenant) = (Arc::clone(self), Arc::clone(tenant));
        to_the_end(async move {
            let _room = room;
            let make = |request| service.create_new(&tenant, checked, request);
            create_once(&service.registry, &tenant.name, request, make).await
        })
        .await
    }

    async fn create_new(
        self: &Arc<Self>,
        tenant: &Tenant,
        checked: Checked,
        idempotency: Option<Idempotency>,
    ) -> Result<Arc<Session>, ApiError> {
        let Checked { key, content, made_cage, options, valid } = checked;
        let room = self.reserve(tenant, content.size_bytes())?;
        let in_memory = self.solvers.in_memory(&key);
        let most = self.config.max_preparing + self.config.max_prepare_queue;
        if in_memory.is_none() && self.solvers.in_flight_of(&tenant.name) >= most {
            self.rejected("prepare_queue");
            let detail = format!("{most} of your sessions are being prepared or queued for it; try again later");
            return Err(ApiError::new(problem::BUSY, detail).limit(most as u64).retry_after(5));
        }
        let (content, geometry) = match in_memory {
            Some(_) => (content, None),
            None => self.read_geometry(&tenant.name, &key, content, valid).await?,
        };
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let meta = SessionMeta {
            id: uuid::Uuid::now_v7().simple().to_string(),
            tenant: tenant.name.clone(),
            created_ms: now.as_millis() as u64,
            key,
            solver_version: cager_core::SOLVER_VERSION,
            options,
            renamed: None,
            made_cage,
            idempotency,
        };
        let status = match &in_memory {
            Some(prepared) => {
                let facts = Facts::new(prepared, valid.goal.is_some(), CacheUse::Hit, PreparationSeconds::default());
                Status { phase: Phase::Ready, facts: Some(facts) }
            }
            None => Status { phase: Phase::Preparing, facts: None },
        };
        let session = Arc::new(Session::new(meta, self, status, true));
        session.bytes.store(content.size_bytes(), Relaxed);
        {
            let _content = self.registry.content_lock(&key).await;
            let (store, meta) = (self.store.clone(), session.meta.clone());
            let stored = move || store.put_content(&key, &content).and_then(|()| store.create_session(&meta));
            if let Err(error) = blocking(stored).await? {
                self.forget_uncreated(&session.meta).await;
                return Err(error.into());
            }
            self.registry.insert(Arc::clone(&session));
            drop(room);
        }
        self.code_in_background(&session);
        metrics::counter!("cager_sessions_created_total", "tenant" => tenant.name.clone()).increment(1);
        match session.facts() {
            // Not awaited: without a stored outcome a restart prepares the session again, and finds its solver on disk.
            Some(facts) => drop(self.keep_outcome(&session, Outcome::Ready(Box::new(facts)))),
            None => {
                let preparing = Arc::clone(self).prepare(Arc::clone(&session), valid, geometry, CompletionState::None);
                drop(tokio::spawn(preparing.with_current_context()));
            }
        }
        Ok(session)
    }

    /// Removes what is left of a session that could not be created. The caller holds the lock of its content.
    async fn forget_uncreated(&self, meta: &SessionMeta) {
        let is_used = self.registry.uses_content(&meta.key);
        let (store, id, key) = (self.store.clone(), meta.id.clone(), meta.key);
        let left = blocking(move || {
            let deleted = store.delete(Kind::Session, &id);
            // An error may be about what is gone all the same.
            let is_there = deleted.is_err() && !matches!(store.reload_meta::<SessionMeta>(&id), Ok(None));
            let content = if is_used || is_there { Ok(()) } else { store.remove_content(&key) };
            (is_there, content)
        });
        match left.await {
            Ok((false, Ok(()))) => {}
            Ok((_, Err(error))) => {
                tracing::warn!(%error, "the content of a session that was not created takes space until the next start");
            }
            _ => {
                tracing::warn!(session = %meta.id, "what could not be created takes space until it is found by the next start");
            }
        }
    }

    /// Parses rest pose and cage, so that errors are reported in the response. Returns them only if preparation starts soon; otherwise they
    /// would occupy memory while queued.
    async fn read_geometry(
        &self,
        tenant: &str,
        key: &ContentKey,
        content: Content,
        valid: ValidOptions,
    ) -> Result<(Content, Option<Arc<Geometry>>), ApiError> {
        if self.solvers.is_stored(key) {
            return Ok((content, None));
        }
        let place = self.parse_slots.take(tenant, 1).await;
        let (content, geometry) = blocking(move || {
            let _place = place;
            let geometry = preparation::read(&content, &valid);
            (content, geometry)
        })
        .await?;
        let geometry = Arc::new(geometry?);
        preparation::check(&geometry, &valid, self.config.max_prepare_bytes)?;
        let soon = self.solvers.in_flight() <= self.config.max_preparing;
        Ok((content, soon.then_some(geometry)))
    }

    pub(super) async fn prepare(
        self: Arc<Self>,
        session: Arc<Session>,
        valid: ValidOptions,
        mut geometry: Option<Arc<Geometry>>,
        mark: CompletionState,
    ) {
        let (clock, mut again, mut pauses) = (Instant::now(), true, Pauses::new());
        let got = loop {
            let got = tokio::select! {
                got = self.solvers.get(wanted(&session, valid, geometry.take())) => got,
                () = session.deleted().cancelled() => return,
            };
            // This request may have joined the preparation of a session that was deleted meanwhile together with its content.
            match got {
                Err(error) if again && error.problem.word() == problem::SESSION_DELETED.word => again = false,
                Err(error) if error.passes => {
                    tracing::warn!(session = %session.meta.id, detail = %error.problem.detail, "the preparation waits");
                    tokio::select! {
                        () = pauses.next() => {}
                        () = session.deleted().cancelled() => return,
                        () = self.stopping().cancelled() => return,
                    }
                }
                got => break got,
            }
        };
        match got {
            Ok(SolverResponse { prepared, cache, mut seconds }) => {
                seconds.total = clock.elapsed().as_secs_f64();
                let facts = Facts::new(&prepared, valid.goal.is_some(), cache, seconds);
                session.set_status(Status { phase: Phase::Preparing, facts: Some(facts.clone()) });
                self.keep_outcome(&session, Outcome::Ready(Box::new(facts.clone()))).await;
                // The previous process may have ended after writing frames but before storing the outcome. They are loaded before clients
                // see the state `ready`.
                if session.ensure_loaded().await.is_err() && session.has_failed() {
                    return;
                }
                let phase = mark.phase(&mut session.frames());
                session.set_status(Status { phase, facts: Some(facts) });
                let _ = blocking(move || session.resend_undelivered()).await;
            }
            Err(error) => {
                let error = session.explain_missing_content(error);
                tracing::info!(session = %session.meta.id, detail = %error.problem.detail, "the session cannot be prepared");
                // Errors that may be temporary are retried after a restart.
                if error.status() == StatusCode::UNPROCESSABLE_ENTITY {
                    self.keep_outcome(&session, Outcome::Failed(error.problem.clone())).await;
                }
                let ended = Arc::clone(&session);
                let due = blocking(move || ended.webhooks.store_pending(&ended.about(), Event::Failed)).await;
                session.set_phase(Phase::Failed(error.problem));
                match due {
                    Ok(Ok(None)) => {}
                    Ok(Ok(Some(due))) => session.announce(due),
                    Ok(Err(_)) | Err(_) => session.announce_unrecorded_failure(),
                }
            }
        }
    }

    fn keep_outcome(&self, session: &Arc<Session>, outcome: Outcome) -> impl Future<Output = ()> + use<> {
        let (store, id) = (self.store.clone(), session.meta.id.clone());
        let done = tokio::task::spawn_blocking(move || {
            if let Err(error) = store.set_outcome(Kind::Session, &id, &outcome) {
                tracing::warn!(session = %id, %error, "the outcome of the preparation could not be stored; a restart prepares the session again");
            }
        });
        async move { drop(done.await) }
    }

    /// The solver of a session that is ready.
    pub(crate) async fn solver(self: &Arc<Self>, session: &Session) -> Result<Arc<Prepared>, ApiError> {
        let valid = ValidOptions::of(&session.meta.options)?;
        let got = self.solvers.get(wanted(session, valid, None)).await;
        let prepared = got.map_err(|error| session.explain_missing_content(error))?.prepared;
        session.check_handles(&prepared)?;
        Ok(prepared)
    }

    /// The engine lane of a session's frames, opened if no upload holds one.
    pub(crate) fn lane(&self, session: &Arc<Session>, prepared: Arc<Prepared>, tenant: &Tenant) -> Arc<SessionQueue> {
        session.queue(|| {
            let cost = {
                let decoder = prepared.solver.decoder();
                let (points, columns) = (decoder.points() as f64, decoder.columns() as f64);
                // Where normals are functions of the vertices, the iteration multiplies by a square matrix about this many times.
                let products = if decoder.dependent_normals().is_some() { 40.0 } else { 0.0 };
                points * columns + products * columns * columns
            };
            let in_order = prepared.solver.follows_previous();
            let (weak, solver) = (Arc::downgrade(session), prepared);
            let run = move |jobs: Vec<FrameJob>| {
                if let Some(session) = weak.upgrade() {
                    solve::solve(&session, &solver, jobs);
                }
            };
            let (name, weight) = (&tenant.name, tenant.priority.weight());
            SessionQueue::new(match in_order {
                true => self.engine.lane_in_order(name, weight, cost, run),
                false => self.engine.lane(name, weight, cost, run),
            })
        })
    }

    /// Deletes a session and stops work for it. Runs to the end even if the client disconnects: a session whose files are gone must not
    /// stay registered and accept frames that a restart would lose.
    pub(crate) async fn delete(self: &Arc<Self>, session: &Arc<Session>) -> Result<(), ApiError> {
        let (service, session) = (Arc::clone(self), Arc::clone(session));
        to_the_end(async move { service.delete_alone(&session).await }).await
    }

    async fn delete_alone(&self, session: &Arc<Session>) -> Result<(), ApiError> {
        let (store, id, key) = (self.store.clone(), session.meta.id.clone(), session.meta.key);
        let _content = self.registry.content_lock(&key).await;
        let removed = id.clone();
        session.set_deleting(true);
        let deleted = blocking({
            let store = store.clone();
            move || store.delete(Kind::Session, &removed)
        });
        deleted.await?.inspect_err(|_| session.set_deleting(false))?;
        self.registry.remove(&id);
        session.mark_deleted();
        if !self.registry.uses_content(&key) {
            let gone = blocking(move || store.remove_content(&key)).await?;
            if let Err(error) = gone {
                tracing::warn!(session = %id, %error, "the content of a deleted session still takes space");
            }
        }
        Ok(())
    }
}

impl Session {
    /// Whether it was made of these files and options, as far as that can be told. Blocks.
    fn is_of(&self, uploaded: &UploadedFiles, options: &SessionOptions) -> bool {
        let (Ok(sent), Ok(files)) = (self.sent_options(), self.files()) else { return false };
        let given = [Some(&uploaded.rest), uploaded.cage.as_ref(), uploaded.matrix.as_ref()];
        let is_same = |(there, given): (&Option<StoredPart>, Option<&NamedFile>)| match (there, given) {
            (Some(there), Some(given)) => *there == StoredPart::of(&there.name, &given.bytes),
            // Without a cage, it was made here.
            (_, given) => given.is_none(),
        };
        sent == *options && files.iter().zip(given).all(is_same)
    }
}

/// The request with an idempotency key that these files and options are. Blocks.
fn request_of(key: Option<String>, uploaded: &UploadedFiles, options: &SessionOptions) -> Option<Idempotency> {
    let files = [Some(&uploaded.rest), uploaded.cage.as_ref(), uploaded.matrix.as_ref()];
    let names = files.map(|file| file.map_or_else(String::new, |file| extension(&file.name)));
    let parts = files
        .iter()
        .zip(&names)
        .flat_map(|(file, name)| [name.as_bytes(), file.map_or(&[][..], |file| file.bytes.as_slice())]);
    fingerprint(key, parts, options)
}

fn wanted(session: &Session, valid: ValidOptions, geometry: Option<Arc<Geometry>>) -> SolverRequest {
    SolverRequest {
        key: session.meta.key,
        tenant: session.meta.tenant.clone(),
        valid,
        geometry,
        trace: Context::current(),
    }
}
