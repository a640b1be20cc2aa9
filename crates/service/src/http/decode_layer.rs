//! `POST /v1/sessions/{id}/decode?layer=…`: positions of a session's own frames.

use super::waiting::{prepared, stopping};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::preparation::Prepared;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::{Session, gone};
use crate::tasks::blocking;
use axum::body::Body;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use cager_capture::coding::GroupDecoder;
use cager_codec::BasisRecord;
use cager_core::inversion::BATCH;
use cager_proto::le;
use http::header;
use serde::Deserialize;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;

/// Part of a tenant's share of the memory for downloads that is decoded at a time, at most, unless a single frame is larger.
const PARTS: u64 = 4;

/// Which of the session's frames to decode, and how much of them.
#[derive(Clone, Copy, Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct LayerQuery {
    /// `cages`: what the cages say alone. `all`: with the residual, where there is one.
    #[param(inline)]
    layer: Option<Layer>,
    /// First frame, with `layer`.
    first: Option<u32>,
    /// Number of frames, with `layer`; all that can be decoded where it is left out.
    count: Option<u32>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Layer {
    Cages,
    All,
}

impl LayerQuery {
    pub(super) fn is_given(&self) -> bool {
        self.layer.is_some() || self.first.is_some() || self.count.is_some()
    }
}

pub(super) async fn respond(
    service: Arc<Service>,
    session: Arc<Session>,
    tenant: &Tenant,
    query: LayerQuery,
) -> Result<Response, ApiError> {
    let Some(layer) = query.layer else {
        return Err(ApiError::new(problem::BAD_REQUEST, "first and count go with layer=cages or layer=all"));
    };
    let place = service.stream(tenant)?;
    let facts = prepared(&service, &session).await?;
    let first = query.first.unwrap_or(0);
    // Numbers of frames are 32 bits wide, so their ends may not be.
    let there = match session.coded_frames() {
        Some(coded) => u64::from(coded),
        None => u64::from(first) + session.frames().run_length(first),
    };
    let end = query.count.map_or(there, |count| u64::from(first) + u64::from(count));
    if end > there || u64::from(first) >= there {
        let what = if session.goal().is_some() { "coded" } else { "solved" };
        let missing = there.max(u64::from(first));
        let detail = format!(
            "frame {missing} was asked for and is not {what}; ask for fewer frames, or wait if it is still to come"
        );
        return Err(ApiError::new(problem::FRAMES_MISSING, detail));
    }
    let solver = service.solver(&session).await?;
    let of = Arc::clone(&session);
    let source = match session.goal() {
        Some(goal) => {
            let prepared = Arc::clone(&solver);
            Source::Groups(blocking(move || of.decoder_of_groups(&solver, goal)).await??, prepared)
        }
        None => Source::Cages(solver),
    };
    let (ready, source) = (VecDeque::new(), Arc::new(source));
    let frame_bytes = 12 * u64::from(facts.points);
    let decoding = LayerDecoding {
        batch: (service.download_memory.most() / PARTS / frame_bytes.max(1)).clamp(1, BATCH as u64),
        service,
        session,
        source,
        layer,
        next: u64::from(first),
        end,
        frame_bytes,
        ready,
        _place: place,
    };
    let stream = futures_util::stream::unfold(Some(decoding), |decoding| async {
        let mut decoding = decoding?;
        match decoding.next().await {
            Ok(bytes) => bytes.map(|bytes| (Ok(bytes), Some(decoding))),
            Err(error) => Some((Err(io::Error::from(error)), None)),
        }
    });
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], Body::from_stream(stream)).into_response())
}

/// Where positions come from.
enum Source {
    /// Cages as they were solved.
    Cages(Arc<Prepared>),
    /// Coded groups.
    Groups(Arc<GroupDecoder>, Arc<Prepared>),
}

struct LayerDecoding {
    service: Arc<Service>,
    session: Arc<Session>,
    source: Arc<Source>,
    layer: Layer,
    /// The frame that is decoded next.
    next: u64,
    end: u64,
    frame_bytes: u64,
    /// Frames decoded at a time, where they are not coded in groups.
    batch: u64,
    /// Decoded and not sent.
    ready: VecDeque<Bytes>,
    _place: Permit,
}

/// Positions of a frame on their way to the client, with the memory permit of those that were decoded with them.
struct OwnedFrame {
    bytes: Vec<u8>,
    _memory: Arc<Permit>,
}

impl AsRef<[u8]> for OwnedFrame {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl LayerDecoding {
    async fn next(&mut self) -> Result<Option<Bytes>, ApiError> {
        if self.ready.is_empty() && self.next < self.end {
            let wanted = match self.session.goal() {
                Some(_) => self.session.coded_group(self.next as u32).map_or(1, |group| u64::from(group.frames)),
                None => self.batch.min(self.end - self.next),
            };
            // Held until the client has taken the frames, for which it has a limited time, see `listen`; and taken anew for the next ones, so that
            // others have their turn between.
            let memory = self.service.download_memory.take(&self.session.meta.tenant, wanted * self.frame_bytes);
            let memory = tokio::select! {
                memory = memory => Arc::new(memory),
                () = self.session.deleted().cancelled() => return Err(gone()),
                () = self.service.stopping().cancelled() => return Err(stopping()),
            };
            let place = self.service.coding.take(&self.session.meta.tenant, 1).await;
            let (session, source) = (Arc::clone(&self.session), Arc::clone(&self.source));
            let (layer, next) = (self.layer, self.next);
            let wanted = wanted.min(self.end - next) as usize;
            let threads = Arc::clone(&self.service.coders);
            let work = move || {
                let _place = place;
                let frames = threads.install(|| decode(&session, &source, layer, next as u32, wanted))?;
                let owned =
                    |positions: Vec<f32>| OwnedFrame { bytes: le::f32_bytes(&positions), _memory: Arc::clone(&memory) };
                Ok::<_, ApiError>(frames.into_iter().map(|positions| Bytes::from_owner(owned(positions))).collect())
            };
            self.ready = tokio::select! {
                decoded = blocking(work) => decoded??,
                () = self.session.deleted().cancelled() => return Err(gone()),
            };
            if self.ready.is_empty() {
                let detail = format!("frame {next} was left out when the session was completed");
                return Err(ApiError::new(problem::FRAMES_MISSING, detail));
            }
            self.next += self.ready.len() as u64;
        }
        Ok(self.ready.pop_front())
    }
}

/// Positions of the next frames: those of a group, or a batch.
fn decode(
    session: &Session,
    source: &Source,
    layer: Layer,
    next: u32,
    wanted: usize,
) -> Result<VecDeque<Vec<f32>>, ApiError> {
    let (decoder, prepared) = match source {
        Source::Cages(prepared) => {
            let entries = session.frames().run(next, wanted);
            let mut bytes = Vec::new();
            session.read_cages(&entries, &mut bytes)?;
            let numbers = le::f32s(&bytes);
            let cages: Vec<&[f32]> = numbers.chunks_exact((numbers.len() / entries.len().max(1)).max(1)).collect();
            let mut positions = vec![Vec::new(); cages.len()];
            prepared.solver.decoder().decode(&cages, &mut positions);
            return Ok(positions.into());
        }
        Source::Groups(decoder, prepared) => (decoder, prepared),
    };
    let Some(group) = session.coded_group(next) else { return Ok(VecDeque::new()) };
    let stored = session.read_group(group.first)?;
    let damaged = |error: cager_codec::Error| ApiError::internal(&error);
    let other = |record: &BasisRecord| session.basis_of_groups(prepared, record);
    let cages = decoder.cages_in(group.frames as usize, &stored.cages, other).map_err(damaged)?;
    let mut positions = decoder.positions(&cages);
    if let (Layer::All, Some(residual)) = (layer, &stored.residual) {
        decoder.add_residual(residual, &mut positions).map_err(damaged)?;
    }
    let mut positions: VecDeque<Vec<f32>> = positions.into();
    positions.drain(..(next - group.first) as usize);
    positions.truncate(wanted);
    Ok(positions)
}
