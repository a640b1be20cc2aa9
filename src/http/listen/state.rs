//! Activity of a connection and since when: updated by its socket and its requests, checked against the time limits.

use super::Limits;
use super::head::{Head, HeadScanner, Scan};
use super::idle::IdleEntry;
use crate::sync::lock;
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;
use tokio::time::Instant;

/// Why a connection ended; the label of `cager_connections_closed_total`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reason {
    /// The client closed it, or the protocol said so.
    Normal,
    /// Reading, writing or the protocol failed.
    Error,
    /// The TLS handshake failed.
    Handshake,
    /// No whole header in time.
    HeaderTimeout,
    /// No request for a while.
    Idle,
    /// The client read nothing for a while.
    WriteTimeout,
    /// It had sent no request when places ran out.
    Displaced,
    /// It was a spare connection and has had its answer.
    Spare,
    /// The service stopped and the connection's requests were done.
    Stop,
    /// The service stopped and requests were cut off at the end of the drain time.
    Drain,
}

impl Reason {
    pub(super) fn label(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Error => "error",
            Self::Handshake => "handshake",
            Self::HeaderTimeout => "header_timeout",
            Self::Idle => "idle",
            Self::WriteTimeout => "write_timeout",
            Self::Displaced => "displaced",
            Self::Spare => "spare",
            Self::Stop => "stop",
            Self::Drain => "drain",
        }
    }
}

/// State of one connection.
pub(super) struct State {
    facts: Mutex<Facts>,
    /// Listed while the connection waits for its client.
    entry: Arc<IdleEntry>,
}

#[derive(Debug)]
struct Facts {
    http2: bool,
    /// Requests begun on this connection.
    requests: u64,
    /// Requests whose body is still coming or whose response is still going.
    in_flight: usize,
    /// Requests in progress.
    open: Vec<Weak<InFlight>>,
    /// Start of the connection, later the end of the last request.
    idle_since: Instant,
    /// First byte of a header that is not complete.
    head_since: Option<Instant>,
    scanner: Option<HeadScanner>,
    /// A complete header that no request has claimed yet.
    head: Option<Head>,
    /// The socket takes no more.
    blocked_since: Option<Instant>,
    /// Last progress of a response or a request body.
    progress: Instant,
    /// Unread request bytes may follow, so that closing at once would discard the response.
    may_linger: bool,
}

impl State {
    pub(super) fn new(entry: Arc<IdleEntry>) -> Arc<Self> {
        let now = Instant::now();
        let facts = Mutex::new(Facts {
            http2: false,
            requests: 0,
            in_flight: 0,
            open: Vec::new(),
            idle_since: now,
            head_since: None,
            scanner: None,
            head: None,
            blocked_since: None,
            progress: now,
            may_linger: false,
        });
        Arc::new(Self { facts, entry })
    }

    /// Bytes were read; an empty slice is the end of the stream.
    pub(super) fn read(&self, bytes: &[u8]) {
        let mut facts = lock(&self.facts);
        if bytes.is_empty() {
            facts.may_linger = false;
            return;
        }
        if facts.http2 {
            return;
        }
        facts.may_linger = true;
        // Between requests, bytes begin a header; during one they belong to its body (or to a pipelined request, which is
        // then not looked at here).
        if facts.scanner.is_none() && facts.in_flight == 0 && facts.head.is_none() {
            let scanner = if facts.requests == 0 { HeadScanner::first() } else { HeadScanner::default() };
            facts.scanner = Some(scanner);
            facts.head_since = Some(Instant::now());
        }
        match facts.scanner.as_mut().map_or(Scan::More, |scanner| scanner.feed(bytes)) {
            Scan::More => {}
            Scan::Http2 => {
                facts.http2 = true;
                facts.may_linger = false;
                facts.scanner = None;
                facts.head_since = None;
                facts.idle_since = Instant::now();
            }
            Scan::Done(head) => {
                facts.head = Some(head);
                facts.scanner = None;
            }
        }
    }

    /// The socket took bytes.
    pub(super) fn wrote(&self) {
        let mut facts = lock(&self.facts);
        facts.blocked_since = None;
        // Pings are answered on an idle HTTP/2 connection too: there, only responses count.
        if !facts.http2 {
            facts.progress = Instant::now();
        }
    }

    /// The socket has nothing left to take.
    pub(super) fn flushed(&self) {
        lock(&self.facts).blocked_since = None;
    }

    /// The socket takes no more.
    pub(super) fn blocked(&self) {
        lock(&self.facts).blocked_since.get_or_insert_with(Instant::now);
    }

    /// Reading or writing failed, or the connection is to be cut.
    pub(super) fn abandon(&self) {
        lock(&self.facts).may_linger = false;
    }

    /// Whether the client may still be sending when the connection is closed.
    pub(super) fn may_linger(&self) -> bool {
        lock(&self.facts).may_linger
    }

    /// A request begins. Gives its header's scan, if it had one.
    pub(super) fn begin(self: &Arc<Self>) -> (Option<Head>, Arc<InFlight>) {
        let mut facts = lock(&self.facts);
        self.entry.work();
        facts.requests += 1;
        facts.in_flight += 1;
        facts.head_since = None;
        facts.scanner = None;
        facts.progress = Instant::now();
        let in_flight = Arc::new(InFlight { state: Arc::clone(self), unread_since: Mutex::default() });
        facts.open.retain(|open| open.strong_count() > 0);
        facts.open.push(Arc::downgrade(&in_flight));
        (facts.head.take(), in_flight)
    }

    /// A piece of a request body came.
    pub(super) fn body_progressed(&self) {
        lock(&self.facts).progress = Instant::now();
    }

    /// A request is there to its end, so that nothing unread is left of it.
    pub(super) fn body_ended(&self) {
        lock(&self.facts).may_linger = false;
    }

    /// Whether no request is on its way.
    pub(super) fn is_idle(&self) -> bool {
        lock(&self.facts).in_flight == 0
    }

    /// The time limit that has been exceeded, if any.
    pub(super) fn exceeded_limit(&self, limits: &Limits) -> Option<Reason> {
        let now = Instant::now();
        let past = |since: Instant, limit: Duration| now.saturating_duration_since(since) >= limit;
        // Dropped after the lock is released, since the last one takes it.
        let open: Vec<_> = lock(&self.facts).open.iter().filter_map(Weak::upgrade).collect();
        let facts = lock(&self.facts);
        // In HTTP/2 a stalled response does not block the socket, and its memory is released only by closing the connection, whatever
        // progress other streams make. In HTTP/1.1 every byte written belongs to the one response.
        let unread = open.iter().filter_map(|open| *lock(&open.unread_since));
        let unread = unread.min().map(|since| if facts.http2 { since } else { since.max(facts.progress) });
        let blocked = facts.blocked_since.map(|since| since.max(facts.progress));
        if let Some(since) = blocked.into_iter().chain(unread).min() {
            return past(since, limits.write_timeout).then_some(Reason::WriteTimeout);
        }
        if facts.in_flight > 0 {
            return None;
        }
        if let Some(since) = facts.head_since {
            return past(since, limits.header_timeout).then_some(Reason::HeaderTimeout);
        }
        if facts.requests == 0 && !facts.http2 {
            return past(facts.idle_since, limits.header_timeout).then_some(Reason::HeaderTimeout);
        }
        past(facts.idle_since.max(facts.progress), limits.idle_timeout).then_some(Reason::Idle)
    }
}

/// Shared by the two halves of a request: its body and its response.
pub(super) struct InFlight {
    state: Arc<State>,
    /// Since when the protocol has not asked for the response's next chunk: the client has to read first.
    unread_since: Mutex<Option<Instant>>,
}

impl InFlight {
    pub(super) fn state(&self) -> &Arc<State> {
        &self.state
    }

    /// Records that a chunk was handed to the protocol (`true`) or the next one was requested (`false`).
    pub(super) fn unread(&self, unread: bool) {
        *lock(&self.unread_since) = unread.then(Instant::now);
        lock(&self.state.facts).progress = Instant::now();
    }

    /// A client that still sends need not read.
    pub(super) fn body_progressed(&self) {
        if let Some(since) = &mut *lock(&self.unread_since) {
            *since = Instant::now();
        }
    }
}

impl Drop for InFlight {
    fn drop(&mut self) {
        let mut facts = lock(&self.state.facts);
        facts.in_flight -= 1;
        facts.idle_since = Instant::now();
        if facts.in_flight == 0 {
            self.state.entry.wait(true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;

    #[test]
    fn a_request_may_end_while_its_connection_is_looked_at() {
        let state = State::new(Arc::new(Arc::<super::super::idle::IdleConnections>::default().enter()));
        let (together, limits) = (Barrier::new(2), Limits::default());
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for _ in 0..100_000 {
                    let (_, request) = state.begin();
                    together.wait();
                    drop(request);
                }
            });
            for _ in 0..100_000 {
                together.wait();
                assert_eq!(state.exceeded_limit(&limits), None);
            }
        });
        assert!(state.is_idle());
    }
}
