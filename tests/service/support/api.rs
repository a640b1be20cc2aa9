//! Requests as clients make them, and answers that are looked at closely.

use super::{Capture, HANG, Mesh, eventually, within};
use bytes::Bytes;
use cager_client::CageFrame;
use cager_proto::cage_messages::CageJob;
use cager_proto::messages::{FrameErrors, FrameResult, Problem, Session, SessionState};
use cager_proto::record::{self, Kind};
use http::{HeaderMap, Method};
use reqwest::multipart::{Form, Part};
use reqwest::{Body, RequestBuilder, Response};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::time::Duration;

pub(crate) const OCTETS: &str = "application/octet-stream";
pub(crate) const RECORDS: &str = record::MEDIA_TYPE;

/// Connections to a service, with a token or without.
#[derive(Clone)]
pub(crate) struct Api {
    base: String,
    pub(crate) token: Option<String>,
    http: reqwest::Client,
}

impl Api {
    pub(crate) fn new(address: SocketAddr, token: Option<String>, http2: bool) -> Self {
        // The client library is built with TLS but without a choice of its cryptography; one call in a process is enough.
        let _ = rustls::crypto::ring::default_provider().install_default();
        // Some follow work from its beginning to its end, which takes a while on a busy machine.
        let builder = reqwest::Client::builder().timeout(10 * HANG);
        let builder = if http2 { builder.http2_prior_knowledge() } else { builder.http1_only() };
        Self { base: format!("http://{address}"), token, http: builder.build().expect("a client") }
    }

    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let request = self.http.request(method, format!("{}{path}", self.base));
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    pub(crate) async fn send(&self, request: RequestBuilder) -> Reply {
        Reply::of(request.send().await.expect("an answer")).await
    }

    pub(crate) async fn get(&self, path: &str) -> Reply {
        self.send(self.request(Method::GET, path)).await
    }

    /// As [`Self::get`], with headers.
    pub(crate) async fn get_with(&self, path: &str, headers: &[(&str, &str)]) -> Reply {
        let request = self.request(Method::GET, path);
        self.send(headers.iter().fold(request, |request, (name, value)| request.header(*name, *value))).await
    }

    /// An answer whose body is still to be read.
    pub(crate) async fn open(&self, path: &str) -> Response {
        let response = self.request(Method::GET, path).send().await.expect("an answer");
        assert_eq!(response.status(), 200, "{path}");
        response
    }

    pub(crate) async fn delete(&self, path: &str) -> Reply {
        self.send(self.request(Method::DELETE, path)).await
    }

    pub(crate) async fn post(&self, path: &str, media_type: &str, body: impl Into<Body>) -> Reply {
        self.send(self.request(Method::POST, path).header("content-type", media_type).body(body)).await
    }

    pub(crate) async fn post_json(&self, path: &str, body: &Value) -> Reply {
        self.post(path, "application/json", body.to_string()).await
    }

    pub(crate) async fn create_with(&self, form: Form, key: Option<&str>) -> Reply {
        let request = self.request(Method::POST, "/v1/sessions").multipart(form);
        self.send(match key {
            Some(key) => request.header("idempotency-key", key),
            None => request,
        })
        .await
    }

    /// A session of a capture, perhaps still being prepared.
    pub(crate) async fn create(&self, capture: &Capture) -> Session {
        self.create_with(form(capture, &json!({})), None).await.is(201)
    }

    /// A session of a capture that takes frames.
    pub(crate) async fn ready(&self, capture: &Capture) -> Session {
        let session = self.create(capture).await;
        self.prepared(&session.id).await
    }

    /// A completed session of the first frames of a capture.
    pub(crate) async fn completed(&self, capture: &Capture, frames: u32) -> Session {
        let session = self.ready(capture).await;
        self.upload(&session.id, 0, capture.raw(0..frames)).await;
        self.complete(&session.id, frames).await.is(200)
    }

    pub(crate) async fn design_with(&self, form: Form, key: Option<&str>) -> Reply {
        let request = self.request(Method::POST, "/v1/cages").multipart(form);
        self.send(match key {
            Some(key) => request.header("idempotency-key", key),
            None => request,
        })
        .await
    }

    /// A cage design of all frames of a capture, perhaps still waiting.
    pub(crate) async fn design(&self, capture: &Capture, options: &Value) -> CageJob {
        self.design_with(cage_form(capture, options), None).await.is(202)
    }

    pub(crate) async fn cage_job(&self, id: &str) -> CageJob {
        self.get(&format!("/v1/cages/{id}")).await.is(200)
    }

    /// Waits until a design is over.
    pub(crate) async fn designed(&self, id: &str) -> CageJob {
        eventually("the cage is designed", async || Some(self.cage_job(id).await).filter(|job| job.state.is_final()))
            .await
    }

    pub(crate) async fn session(&self, id: &str) -> Session {
        self.get(&format!("/v1/sessions/{id}")).await.is(200)
    }

    /// Waits until a session is prepared, whatever came of it.
    pub(crate) async fn settled(&self, id: &str) -> Session {
        eventually("the session is prepared", async || {
            Some(self.session(id).await).filter(|session| session.state != SessionState::Preparing)
        })
        .await
    }

    /// Waits until a session takes frames.
    pub(crate) async fn prepared(&self, id: &str) -> Session {
        let session = self.settled(id).await;
        assert_eq!(session.state, SessionState::Ready, "{:?}", session.problem);
        session
    }

    /// Why a rest pose and its cage are refused at once.
    pub(crate) async fn refusal(&self, form: Form) -> Problem {
        self.create_with(form, None).await.expect(422).json()
    }

    /// Posts whole frames; gives their results, ascending.
    pub(crate) async fn upload(&self, id: &str, first: u32, body: impl Into<Body>) -> Vec<FrameResult> {
        let reply = self.post(&format!("/v1/sessions/{id}/frames?first={first}"), OCTETS, body).await;
        let mut results = lines(&reply.expect(200).body);
        results.sort_by_key(|result| result.frame);
        results
    }

    pub(crate) async fn complete(&self, id: &str, frames: u32) -> Reply {
        self.post_json(&format!("/v1/sessions/{id}/complete"), &json!({ "frames": frames })).await
    }

    pub(crate) async fn errors(&self, id: &str) -> Vec<FrameResult> {
        self.get(&format!("/v1/sessions/{id}/errors")).await.is::<FrameErrors>(200).frames
    }

    /// All cages that are there, raw.
    pub(crate) async fn cages(&self, id: &str) -> Bytes {
        self.get(&format!("/v1/sessions/{id}/cages?first=0")).await.expect(200).body
    }

    pub(crate) async fn container(&self, id: &str) -> Bytes {
        self.get(&format!("/v1/sessions/{id}/capture.cager")).await.expect(200).body
    }

    pub(crate) async fn handles(&self, id: &str) -> Vec<u32> {
        let bytes = self.get(&format!("/v1/sessions/{id}/handles")).await.expect(200).body;
        bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }
}

/// The parts that make a session.
pub(crate) fn form(capture: &Capture, options: &Value) -> Form {
    form_of(&capture.rest, &capture.cage, options)
}

pub(crate) fn form_of(rest: &Mesh, cage: &Mesh, options: &Value) -> Form {
    Form::new()
        .part("rest", file("rest.obj", &rest.obj))
        .part("cage", file("cage.obj", &cage.obj))
        .part("options", text(options))
}

/// The parts that ask for a cage, with all frames of a capture as raw numbers.
pub(crate) fn cage_form(capture: &Capture, options: &Value) -> Form {
    let mut options = options.clone();
    options["frames"] = capture.count().into();
    cage_form_of(&capture.rest.obj, "frames.f32", &capture.raw(0..capture.count()), &options)
}

pub(crate) fn cage_form_of(rest: &[u8], frames_name: &str, frames: &[u8], options: &Value) -> Form {
    Form::new()
        .part("rest", file("rest.obj", rest))
        .part("options", text(options))
        .part("frames", file(frames_name, frames))
}

pub(crate) fn file(name: &str, bytes: &[u8]) -> Part {
    Part::bytes(bytes.to_vec()).file_name(name.to_owned())
}

pub(crate) fn text(options: &Value) -> Part {
    Part::text(options.to_string()).mime_str("application/json").expect("a media type")
}

/// A whole answer.
#[derive(Clone, Debug)]
pub(crate) struct Reply {
    pub(crate) status: u16,
    pub(crate) headers: HeaderMap,
    pub(crate) body: Bytes,
}

impl Reply {
    pub(crate) async fn of(response: Response) -> Self {
        let (status, headers) = (response.status().as_u16(), response.headers().clone());
        Self { status, headers, body: response.bytes().await.expect("a whole body") }
    }

    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().expect("a text"))
    }

    pub(crate) fn text(&self) -> String {
        String::from_utf8(self.body.to_vec()).expect("UTF-8")
    }

    #[track_caller]
    pub(crate) fn json<T: DeserializeOwned>(&self) -> T {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.text()))
    }

    #[track_caller]
    pub(crate) fn expect(self, status: u16) -> Self {
        assert_eq!(self.status, status, "{}", String::from_utf8_lossy(&self.body));
        self
    }

    /// Expects a status and reads the JSON body.
    #[track_caller]
    pub(crate) fn is<T: DeserializeOwned>(self, status: u16) -> T {
        self.expect(status).json()
    }

    /// Expects an error in the form that all errors have.
    #[track_caller]
    pub(crate) fn problem(&self, status: u16, word: &str) -> Problem {
        assert_eq!(self.header("content-type"), "application/problem+json", "{self:?}");
        let problem: Problem = self.json();
        assert_eq!((self.status, problem.word()), (status, word), "{}", problem.detail);
        assert_eq!(problem.status, status, "the body and the answer agree");
        assert_eq!(problem.kind, format!("urn:cager:problem:{word}"));
        assert!(!problem.title.is_empty() && !problem.detail.is_empty(), "{problem:?}");
        assert_eq!(problem.request_id.as_deref(), Some(self.header("x-request-id")), "it can be found in the log");
        problem
    }

    /// Seconds after which the client is asked to come back.
    #[track_caller]
    pub(crate) fn retry_after(&self) -> Duration {
        Duration::from_secs(self.header("retry-after").parse().expect("Retry-After"))
    }
}

/// The next piece of an answer; `None` at its end.
pub(crate) async fn piece(what: &str, response: &mut Response) -> reqwest::Result<Option<Bytes>> {
    loop {
        let piece = within(what, HANG, response.chunk()).await?;
        // HTTP/2 may end with an empty one.
        if piece.as_ref().is_none_or(|piece| !piece.is_empty()) {
            return Ok(piece);
        }
    }
}

/// Frame results of an answer to posted frames.
#[track_caller]
pub(crate) fn lines(body: &[u8]) -> Vec<FrameResult> {
    let text = std::str::from_utf8(body).expect("UTF-8");
    text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))).collect()
}

/// Cages of an answer in frame records.
#[track_caller]
pub(crate) fn records(mut body: &[u8], unknowns: u32) -> Vec<CageFrame> {
    let mut cages = Vec::new();
    let measured = |x: f32| (!x.is_nan()).then_some(x);
    while !body.is_empty() {
        let mut values = Vec::new();
        let (header, used) = record::decode(body, Kind::Cage, unknowns, &mut values).expect("a whole record");
        let (l2, linf) = (measured(header.l2), measured(header.linf));
        cages.push(CageFrame { frame: header.frame, l2, linf, values });
        body = &body[used..];
    }
    cages
}

/// Cages of an answer in raw numbers.
pub(crate) fn cages_of(body: &[u8], unknowns: u32) -> Vec<Vec<f32>> {
    assert!(body.len().is_multiple_of(12 * unknowns as usize), "whole cages");
    let numbers = |cage: &[u8]| cage.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    body.chunks_exact(12 * unknowns as usize).map(numbers).collect()
}
