//! Posts of frames without the client crate: bodies that trickle, answers that are taken as they come.

use super::ledger::Ledger;
use crate::capture::{Errors, Reference};
use crate::database::Database;
use crate::process::Door;
use cager_client::messages::{FrameResult, Problem};
use cager_proto::record::{self, HEADER_BYTES, Kind};
use fastrand::Rng;
use reqwest::header::{ACCEPT, CONTENT_TYPE};
use reqwest::{Body, Client, RequestBuilder};
use std::convert::Infallible;
use std::ops::Range;
use std::time::Duration;

pub(super) fn errors(result: &FrameResult) -> Option<Errors> {
    result.l2.zip(result.linf).map(|(l2, linf)| Errors { l2: l2.to_bits(), linf: linf.to_bits() })
}

/// Posts frames of one session.
pub(super) struct Poster<'a> {
    http: Client,
    door: Door,
    url: String,
    id: &'a str,
    ledger: &'a Ledger,
    reference: &'a Reference,
    rng: Rng,
}

impl<'a> Poster<'a> {
    pub(super) fn new(door: &Door, ledger: &'a Ledger, reference: &'a Reference, id: &'a str, mut rng: Rng) -> Self {
        let http = Client::builder();
        let http = if rng.bool() { http.http1_only() } else { http.http2_prior_knowledge() };
        let url = door.url(&format!("/v1/sessions/{id}/frames"));
        Self { http: http.build().expect("a client"), door: door.clone(), url, id, ledger, reference, rng }
    }

    /// Whether what the service needs is killed too.
    fn may_be_away(&self) -> bool {
        Database::is_for_all() || self.door.token.is_some()
    }

    /// One raw body, answered by lines. Broken connections are no error; wrong answers are.
    pub(super) async fn raw(&mut self, frames: Range<u32>) -> Result<(), String> {
        let url = format!("{}?first={}&live={}", self.url, frames.start, self.rng.bool());
        let body = self.reference.many(frames);
        let request = self.http.post(url).header(CONTENT_TYPE, "application/octet-stream");
        let mut text = Vec::new();
        let (ledger, id, may_be_away) = (self.ledger, self.id, self.may_be_away());
        self.post(request, body, |piece| {
            text.extend_from_slice(piece);
            while let Some(end) = text.iter().position(|&b| b == b'\n') {
                let line: Vec<u8> = text.drain(..=end).collect();
                // A problem may name a frame, too.
                if let Ok(problem) = serde_json::from_slice(&line) {
                    return expected(&problem, may_be_away);
                }
                let result: FrameResult = serde_json::from_slice(&line).map_err(|e| e.to_string())?;
                ledger.answered(id, result.frame, errors(&result));
            }
            Ok(())
        })
        .await
    }

    /// Records of these frames, answered by records.
    pub(super) async fn records(&mut self, frames: &[u32]) -> Result<(), String> {
        let mut body = Vec::new();
        for &frame in frames {
            let rows = &self.reference.frames[frame as usize];
            record::encode(Kind::Positions, frame, f32::NAN, f32::NAN, rows, &mut body).expect("a record");
        }
        let request =
            self.http.post(format!("{}?live={}", self.url, self.rng.bool())).header(CONTENT_TYPE, record::MEDIA_TYPE);
        let request = request.header(ACCEPT, record::MEDIA_TYPE);
        let (ledger, id, reference) = (self.ledger, self.id, self.reference);
        let mut bytes = Vec::new();
        let length = HEADER_BYTES + 12 * reference.unknowns;
        self.post(request, body, |piece| {
            bytes.extend_from_slice(piece);
            while bytes.len() >= length {
                let answer: Vec<u8> = bytes.drain(..length).collect();
                let header = record::decode_header(&answer, Kind::Cage, reference.unknowns as u32);
                let header = header.map_err(|e| e.to_string())?;
                if answer[HEADER_BYTES..] != crate::capture::le_bytes(&reference.cages[header.frame as usize]) {
                    return Err(format!("the answer to frame {} has another cage", header.frame));
                }
                let errors = Errors { l2: header.l2.to_bits(), linf: header.linf.to_bits() };
                ledger.answered(id, header.frame, Some(errors));
            }
            Ok(())
        })
        .await
    }

    async fn post(
        &mut self,
        request: RequestBuilder,
        body: Vec<u8>,
        mut take: impl FnMut(&[u8]) -> Result<(), String>,
    ) -> Result<(), String> {
        let rng = self.rng.fork();
        let pieces = futures_util::stream::unfold((body, 0, rng), |(body, at, mut rng)| async move {
            if at == body.len() {
                return None;
            }
            if rng.u8(..3) == 0 {
                tokio::time::sleep(Duration::from_micros(rng.u64(..4000))).await;
            }
            let end = body.len().min(at + rng.usize(1..20_000));
            let piece = body[at..end].to_vec();
            Some((Ok::<_, Infallible>(piece), (body, end, rng)))
        });
        let request = self.door.with_token(request);
        let Ok(mut answer) = request.body(Body::wrap_stream(pieces)).send().await else {
            // Nobody is there for a moment.
            tokio::time::sleep(Duration::from_millis(10)).await;
            return Ok(());
        };
        if !answer.status().is_success() {
            let (status, may_be_away) = (answer.status(), self.may_be_away());
            let problem = answer.json().await.map_err(|e| format!("{status}: {e}"));
            return problem.and_then(|problem| expected(&problem, may_be_away));
        }
        while let Ok(Some(piece)) = answer.chunk().await {
            take(&piece)?;
        }
        Ok(())
    }
}

/// What may be answered in the middle of restarts; all else is a fault.
fn expected(problem: &Problem, may_be_away: bool) -> Result<(), String> {
    match problem.word() {
        "busy" | "stopping" | "not-ready" | "session-deleted" => Ok(()),
        // While the database or the bucket is away.
        "storage-failed" if may_be_away => Ok(()),
        other => Err(format!("{other}: {}", problem.detail)),
    }
}
