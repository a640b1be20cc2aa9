//! Activity of a connection and since when: updated by its socket and its requests, checked against the time limits.

use super::Limits;
use super::head::{Head, HeadScanner, Scan};
use super::idle::IdleEntry;
use crate::sync::lock;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;
use tokio::time::Instant;

/// Slowest reading of a response beside pauses, as fast as bodies have to come: what waits for a reader takes memory that others want.
const SLOWEST_READER_BYTES_PER_SECOND: f64 = 16_384.0;

/// Reasons and the words that stand for them.
macro_rules! reasons {
    ($($(#[$meta:meta])+ $reason:ident = $label:literal,)+) => {
        /// Why a connection ended; the label of `cager_connections_closed_total`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Reason {
            $($(#[$meta])+ $reason,)+
        }

        impl Reason {
            pub(crate) const LABELS: &[&str] = &[$($label),+];

            pub(super) fn label(self) -> &'static str {
                match self {
                    $(Self::$reason => $label,)+
                }
            }
        }
    };
}

reasons! {
    /// The client closed it, or the protocol said so.
    Normal = "normal",
    /// Reading, writing or the protocol failed.
    Error = "error",
    /// The TLS handshake failed.
    Handshake = "handshake",
    /// No whole header in time.
    HeaderTimeout = "header_timeout",
    /// No request for a while.
    Idle = "idle",
    /// The client read nothing for a while.
    WriteTimeout = "write_timeout",
    /// It had sent no request when places ran out.
    Displaced = "displaced",
    /// It was a spare connection and has had its answer.
    Spare = "spare",
    /// The service stopped and the connection's requests were done.
    Stop = "stop",
    /// The service stopped and requests were cut off at the end of the drain time.
    Drain = "drain",
}

/// State of one connection.
pub(super) struct State {
    facts: Mutex<ConnectionFacts>,
    /// Listed while the connection waits for its client.
    entry: Arc<IdleEntry>,
}

#[derive(Debug)]
struct ConnectionFacts {
    http2: bool,
    /// Requests begun on this connection.
    requests: u64,
    /// Requests whose body is still coming or whose response is still going.
    in_flight: usize,
    /// Requests in progress.
    open: Vec<Weak<RequestInFlight>>,
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
    /// Whether who sent the last request has shown who they are.
    known: bool,
    /// Unread request bytes may follow, so that closing at once would discard the response.
    may_linger: bool,
}

impl State {
    pub(super) fn new(entry: Arc<IdleEntry>) -> Arc<Self> {
        let now = Instant::now();
        let facts = Mutex::new(ConnectionFacts {
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
            known: false,
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
    pub(super) fn begin(self: &Arc<Self>) -> (Option<Head>, Arc<RequestInFlight>) {
        let mut facts = lock(&self.facts);
        self.entry.work();
        facts.requests += 1;
        facts.in_flight += 1;
        facts.head_since = None;
        facts.scanner = None;
        facts.progress = Instant::now();
        facts.known = false;
        let in_flight = Arc::new(RequestInFlight {
            state: Arc::clone(self),
            reading: Mutex::default(),
            known: AtomicBool::new(false),
        });
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

    /// The socket is closed.
    pub(super) fn close(&self) {
        self.entry.close();
    }

    /// The address that the connection counts for, while nobody has shown who they are.
    pub(super) fn stranger(&self) -> Option<IpAddr> {
        self.entry.address()
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
        let patience = |known| {
            if known { limits.write_timeout } else { limits.stranger_write_timeout.min(limits.write_timeout) }
        };
        // In HTTP/2 a stalled response does not block the socket, and its memory is released only by closing the connection, whatever
        // progress other streams make. In HTTP/1.1 every byte written belongs to the one response.
        let progress = (!facts.http2).then_some(facts.progress);
        let unread = open
            .iter()
            .filter_map(|open| open.deadline(patience(open.known.load(Relaxed)), progress, limits.paced_readers));
        let any_known = facts.known || open.iter().any(|open| open.known.load(Relaxed));
        let blocked = facts.blocked_since.map(|since| since.max(facts.progress) + patience(any_known));
        if let Some(deadline) = blocked.into_iter().chain(unread).min() {
            return (now >= deadline).then_some(Reason::WriteTimeout);
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
pub(super) struct RequestInFlight {
    state: Arc<State>,
    reading: Mutex<Reading>,
    /// Whether who sent it has shown who they are.
    known: AtomicBool,
}

/// How the client reads a response.
#[derive(Default)]
struct Reading {
    /// Since when the protocol has not asked for the next chunk after one of so many bytes: the client has to read first.
    unread: Option<(Instant, usize)>,
    /// Time that the chunks before took beyond what their size allows.
    behind: Duration,
}

/// How long a client may take to read a chunk.
fn allowance(bytes: usize) -> Duration {
    Duration::from_secs_f64(bytes as f64 / SLOWEST_READER_BYTES_PER_SECOND)
}

impl RequestInFlight {
    pub(super) fn state(&self) -> &Arc<State> {
        &self.state
    }

    /// A chunk of so many bytes was handed to the protocol.
    pub(super) fn offered(&self, bytes: usize) {
        lock(&self.reading).unread = Some((Instant::now(), bytes));
        lock(&self.state.facts).progress = Instant::now();
    }

    /// The protocol wants the next chunk.
    pub(super) fn taken(&self) {
        let mut reading = lock(&self.reading);
        if let Some((since, bytes)) = reading.unread.take() {
            reading.behind = (reading.behind + since.elapsed()).saturating_sub(allowance(bytes));
        }
        drop(reading);
        lock(&self.state.facts).progress = Instant::now();
    }

    /// A client that still sends need not read.
    pub(super) fn body_progressed(&self) {
        let mut reading = lock(&self.reading);
        reading.behind = Duration::ZERO;
        if let Some((since, _)) = &mut reading.unread {
            *since = Instant::now();
        }
    }

    /// When the client will have read too slowly: nothing for as long as `patience`, or, where readers are `paced`, so little that its pauses
    /// add up to that.
    fn deadline(&self, patience: Duration, progress: Option<Instant>, paced: bool) -> Option<Instant> {
        let reading = lock(&self.reading);
        let (since, bytes) = reading.unread?;
        let stalled = progress.map_or(since, |progress| since.max(progress)) + patience;
        let slow = since + (patience + allowance(bytes)).saturating_sub(reading.behind);
        Some(if paced { stalled.min(slow) } else { stalled })
    }
}

/// What a handler can tell the listener about the connection that its request came by.
#[derive(Clone)]
pub(crate) struct ConnectionHandle(Weak<RequestInFlight>);

impl ConnectionHandle {
    pub(super) fn of(request: &Arc<RequestInFlight>) -> Self {
        Self(Arc::downgrade(request))
    }

    /// Who sent the request has shown who they are: it no longer counts for its address, and its reader may pause.
    pub(crate) fn caller_is_known(&self) {
        let Some(request) = self.0.upgrade() else { return };
        request.known.store(true, Relaxed);
        lock(&request.state.facts).known = true;
        request.state.entry.known();
    }
}

impl Drop for RequestInFlight {
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
    fn a_reader_may_pause_but_not_take_a_little_now_and_then_for_ever() {
        let state = State::new(Arc::new(Arc::<super::super::idle::IdleConnections>::default().enter(None)));
        let (_, request) = state.begin();
        let patience = Duration::from_secs(10);
        let left = |progress: Option<Instant>| {
            let deadline = request.deadline(patience, progress, true)?;
            Some(deadline.saturating_duration_since(Instant::now()).as_secs_f64().round())
        };
        assert_eq!(left(None), None);
        request.offered(20 * 16_384);
        let later = Some(Instant::now() + Duration::from_secs(3600));
        assert_eq!(left(None), Some(10.0), "over HTTP/2 the whole chunk has to be taken");
        assert_eq!(left(later), Some(30.0), "over HTTP/1.1 it is read piece by piece, but not arbitrarily slowly");
        lock(&request.reading).behind = Duration::from_secs(9);
        assert_eq!((left(None), left(later)), (Some(10.0), Some(21.0)), "pauses add up");
        request.body_progressed();
        assert_eq!(left(later), Some(30.0), "who sends need not read");
        lock(&request.reading).behind = Duration::from_secs(9);
        request.taken();
        assert_eq!(lock(&request.reading).behind, Duration::ZERO, "reading makes up for pauses");
    }

    #[test]
    fn a_request_may_end_while_its_connection_is_looked_at() {
        let state = State::new(Arc::new(Arc::<super::super::idle::IdleConnections>::default().enter(None)));
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
