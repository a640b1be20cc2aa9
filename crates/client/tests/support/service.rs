//! A service of one session, solved at once, with faults on demand.

use super::{Exchange, problem, serve};
use cager_client::messages::{
    CacheUse, FrameCounts, FrameErrors, FrameResult, PreparationSeconds, Session, SessionState,
};
use cager_proto::record::{self, Kind};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard};

pub const ID: &str = "s1";
pub const POINTS: u32 = 5;
pub const UNKNOWNS: u32 = 2;
pub const HANDLES: [u32; 2] = [3, 1];

/// What goes wrong with one request that posts frames.
#[derive(Clone, Debug)]
pub enum Fault {
    /// Nothing.
    None,
    /// The connection is cut once this many of its frames are solved and answered.
    Cut(usize),
    /// As many are solved, but their results never leave.
    LoseResults(usize),
    /// The answer ends after as many.
    End(usize),
    /// The answer has no last line's end, or is cut within a line.
    HalfLine(usize),
    /// A status without a look at the body, and the connection closed.
    Refuse(u16, &'static str, Option<&'static str>),
    /// As many frames are solved, then a line says why the next is not.
    Problem(usize, u16),
    /// A proxy's page.
    Page(u16),
    /// A proxy's page as soon as the body has more than this many bytes, before the service sees any of it.
    Limit(usize),
    /// A line that is no JSON.
    Garbage,
    /// A line without end.
    Endless,
    /// Nothing at all, for long.
    Silence,
    /// A live request goes on until as many are answered; then neither side hears of the other, as behind a proxy.
    OneWay(usize),
}

#[derive(Default)]
pub struct Service {
    state: Mutex<State>,
}

#[derive(Default)]
pub struct State {
    /// Rows of solved frames, as bytes.
    pub solved: BTreeMap<u32, Vec<u8>>,
    pub faults: VecDeque<Fault>,
    /// Requests: method and target.
    pub log: Vec<String>,
    pub posted_frames: usize,
    pub completed: Option<u32>,
}

impl Service {
    pub async fn start(faults: impl IntoIterator<Item = Fault>) -> (Arc<Self>, String) {
        let service = Arc::new(Self::default());
        service.state().faults.extend(faults);
        let served = Arc::clone(&service);
        let address = serve(move |exchange| Arc::clone(&served).answer(exchange)).await;
        (service, address)
    }

    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("no panic while it was held")
    }

    pub fn posts(&self) -> Vec<String> {
        self.state().log.iter().filter(|line| line.starts_with("POST")).cloned().collect()
    }

    pub fn session(&self) -> Session {
        let state = self.state();
        let end = state.completed.unwrap_or_else(|| state.solved.last_key_value().map_or(0, |(last, _)| last + 1));
        let mut missing: Vec<[u32; 2]> = Vec::new();
        for frame in (0..end).filter(|frame| !state.solved.contains_key(frame)) {
            match missing.last_mut() {
                Some(range) if range[1] == frame => range[1] += 1,
                _ => missing.push([frame, frame + 1]),
            }
        }
        let solved = state.solved.len() as u64;
        Session {
            frames: FrameCounts { received: solved, solved, missing, missing_next: None },
            ..session(if state.completed.is_some() { SessionState::Completed } else { SessionState::Ready })
        }
    }

    async fn answer(self: Arc<Self>, exchange: Exchange) {
        self.state().log.push(format!("{} {}", exchange.method, exchange.target));
        let rest = exchange.path().strip_prefix("/v1/sessions/s1").map(str::to_owned);
        match (exchange.method.as_str(), rest.as_deref()) {
            ("GET", Some("")) => exchange.json(serde_json::to_vec(&self.session()).expect("JSON")).await,
            ("GET", Some("/errors")) => {
                let frames = self.state().solved.keys().map(|&frame| result(frame)).collect();
                exchange.json(serde_json::to_vec(&FrameErrors { frames }).expect("JSON")).await;
            }
            ("GET", Some("/handles")) => {
                let bytes: Vec<u8> = HANDLES.iter().flat_map(|h| h.to_le_bytes()).collect();
                exchange.reply(200, &[], bytes).await;
            }
            ("POST", Some("/frames")) => self.frames(exchange).await,
            _ => exchange.problem(404, "not-found", &[]).await,
        }
    }

    async fn frames(self: Arc<Self>, mut exchange: Exchange) {
        let fault = self.state().faults.pop_front().unwrap_or(Fault::None);
        if matches!(fault, Fault::Limit(_)) {
            // So do all later requests.
            self.state().faults.push_front(fault.clone());
        }
        match &fault {
            Fault::Refuse(status, word, retry_after) => {
                let head = format!(
                    "HTTP/1.1 {status} X\r\ncontent-type: application/problem+json\r\nconnection: close\r\n{}content-length: {}\r\n\r\n{}",
                    retry_after.map_or(String::new(), |wait| format!("retry-after: {wait}\r\n")),
                    problem(*status, word).len(),
                    problem(*status, word),
                );
                // Closed with the body unread, as hasty servers do.
                return exchange.raw(head.as_bytes()).await;
            }
            Fault::Page(status) => {
                return exchange.reply(*status, &[("content-type", "text/html")], "<h1>Gateway</h1> sorry").await;
            }
            Fault::Limit(most) => {
                let mut body = Vec::new();
                while let Some(piece) = exchange.body_piece().await {
                    body.extend(piece);
                    if body.len() > *most {
                        let page = "<h1>413 Request Entity Too Large</h1> nginx";
                        return exchange.reply(413, &[("content-type", "text/html")], page).await;
                    }
                }
                exchange.put_back(body);
            }
            Fault::Silence => return tokio::time::sleep(std::time::Duration::from_secs(60)).await,
            _ => {}
        }
        let by_handles = exchange.query("rows") == Some("handles");
        let rows = if by_handles { HANDLES.len() } else { POINTS as usize };
        let kind = if by_handles { Kind::HandleRows } else { Kind::Positions };
        let mut next: u32 = exchange.query("first").expect("first").parse().expect("a number");
        let records = exchange.header("content-type") == Some(record::MEDIA_TYPE);
        exchange.begin(200, &[("content-type", "application/x-ndjson")]).await;
        if matches!(fault, Fault::Garbage) {
            exchange.chunk(b"{\"oops\"\n").await;
            // Closed with bytes unread, the connection would lose the line.
            exchange.whole_body().await;
            return exchange.end().await;
        }
        if matches!(fault, Fault::Endless) {
            for _ in 0..40 {
                exchange.chunk(&[b'x'; 1 << 16]).await;
            }
            exchange.whole_body().await;
            return exchange.end().await;
        }
        let (mut waiting, mut done) = (Vec::new(), 0);
        while let Some(piece) = exchange.body_piece().await {
            waiting.extend(piece);
            loop {
                let (frame, bytes, used) = if records {
                    let mut values = Vec::new();
                    let Ok((header, used)) = record::decode(&waiting, kind, rows as u32, &mut values) else { break };
                    (header.frame, waiting[record::HEADER_BYTES..used].to_vec(), used)
                } else {
                    let Some(bytes) = waiting.get(..12 * rows) else { break };
                    (next, bytes.to_vec(), 12 * rows)
                };
                match fault {
                    Fault::Cut(after) | Fault::LoseResults(after) if done == after => return,
                    Fault::End(after) if done == after => return exchange.end().await,
                    Fault::OneWay(after) if done == after && exchange.query("live") == Some("true") => {
                        return tokio::time::sleep(std::time::Duration::from_secs(60)).await;
                    }
                    Fault::HalfLine(after) if done == after => {
                        exchange.chunk(b"{\"frame\":").await;
                        return exchange.end().await;
                    }
                    Fault::Problem(after, status) if done == after => {
                        exchange.chunk(format!("{}\n", problem(status, "bad-frame")).as_bytes()).await;
                        return exchange.end().await;
                    }
                    _ => {}
                }
                waiting.drain(..used);
                next = frame + 1;
                done += 1;
                {
                    let mut state = self.state();
                    state.posted_frames += 1;
                    let before = state.solved.insert(frame, bytes.clone());
                    assert!(before.is_none_or(|before| before == bytes), "frame {frame} came with other bytes");
                }
                if !matches!(fault, Fault::LoseResults(_)) {
                    let line = serde_json::to_string(&result(frame)).expect("JSON");
                    exchange.chunk(format!("{line}\n").as_bytes()).await;
                }
            }
        }
        assert!(waiting.is_empty() || matches!(fault, Fault::Cut(_)), "the body ended within a frame");
        exchange.end().await;
    }
}

pub fn result(frame: u32) -> FrameResult {
    FrameResult { frame, l2: Some(frame as f32), linf: None }
}

pub fn session(state: SessionState) -> Session {
    Session {
        id: ID.to_owned(),
        name: None,
        state,
        created: 0.0,
        points: Some(POINTS),
        unknowns: Some(UNKNOWNS),
        handle_count: Some(HANDLES.len() as u32),
        cage_vertices: Some(UNKNOWNS),
        cage_faces: Some(4),
        coordinates: "mvc".to_owned(),
        handles: "maxvol".to_owned(),
        regularizer: "laplacian".to_owned(),
        spectrum: Some(0),
        lambda: 1.0,
        condition_number: None,
        rank: None,
        affine_reproduction_error: None,
        frames: FrameCounts::default(),
        coding: None,
        cache: Some(CacheUse::Miss),
        seconds: PreparationSeconds::default(),
        warnings: Vec::new(),
        problem: None,
    }
}

/// Values of a frame of the test capture.
pub fn frame(number: u32) -> Vec<f32> {
    (0..3 * POINTS).map(|k| (100 * number + k) as f32).collect()
}

pub fn capture(frames: u32) -> Vec<f32> {
    (0..frames).flat_map(frame).collect()
}

/// What the service must have of a frame.
pub fn frame_bytes(number: u32) -> Vec<u8> {
    frame(number).iter().flat_map(|x| x.to_le_bytes()).collect()
}
