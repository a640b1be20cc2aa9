//! What a connection is doing and since when: written by its socket and its requests, judged by its clock.

use super::Limits;
use super::body::Content;
use super::head::{Head, HeadScanner, Scan};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
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
#[derive(Debug)]
pub(super) struct State(Mutex<Facts>);

#[derive(Debug)]
struct Facts {
    http2: bool,
    /// Requests begun on this connection.
    requests: u64,
    /// Requests whose body is still coming or whose response is still going.
    in_flight: usize,
    /// Responses that have given a piece to the protocol and were not asked for the next: the client has to read first.
    unread: usize,
    /// The bodies of the responses on their way in HTTP/2.
    replies: Vec<Weak<Mutex<Content>>>,
    /// Start of the connection, later the end of the last request.
    idle_since: Instant,
    /// First byte of a header that is not complete.
    head_since: Option<Instant>,
    scanner: Option<HeadScanner>,
    /// A complete header that no request has claimed yet.
    head: Option<Head>,
    /// The socket takes no more.
    blocked_since: Option<Instant>,
    /// Last time that a response got on, or a body came.
    progress: Instant,
    /// More bytes of a request may come that nobody reads: closing at once would destroy the response on its way.
    may_linger: bool,
}

impl State {
    pub(super) fn new() -> Arc<Self> {
        let now = Instant::now();
        Arc::new(Self(Mutex::new(Facts {
            http2: false,
            requests: 0,
            in_flight: 0,
            unread: 0,
            replies: Vec::new(),
            idle_since: now,
            head_since: None,
            scanner: None,
            head: None,
            blocked_since: None,
            progress: now,
            may_linger: false,
        })))
    }

    fn facts(&self) -> MutexGuard<'_, Facts> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The socket gave bytes; none is the end.
    pub(super) fn read(&self, bytes: &[u8]) {
        let mut facts = self.facts();
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
        let mut facts = self.facts();
        facts.blocked_since = None;
        // Pings are answered on an idle HTTP/2 connection too: there, only responses count.
        if !facts.http2 {
            facts.progress = Instant::now();
        }
    }

    /// The socket has nothing left to take.
    pub(super) fn flushed(&self) {
        self.facts().blocked_since = None;
    }

    /// The socket takes no more.
    pub(super) fn blocked(&self) {
        self.facts().blocked_since.get_or_insert_with(Instant::now);
    }

    /// Reading or writing failed, or the connection is to be cut.
    pub(super) fn abandon(&self) {
        self.facts().may_linger = false;
    }

    /// Whether the client may still be sending when the connection is closed.
    pub(super) fn may_linger(&self) -> bool {
        self.facts().may_linger
    }

    /// A request begins. Gives its header's scan, if it had one.
    pub(super) fn begin(self: &Arc<Self>) -> (Option<Head>, Arc<InFlight>) {
        let mut facts = self.facts();
        facts.requests += 1;
        facts.in_flight += 1;
        facts.head_since = None;
        facts.scanner = None;
        facts.progress = Instant::now();
        (facts.head.take(), Arc::new(InFlight(Arc::clone(self))))
    }

    /// A piece of a request body came.
    pub(super) fn body_came(&self) {
        self.facts().progress = Instant::now();
    }

    /// A request is there to its end, so that nothing unread is left of it.
    pub(super) fn body_ended(&self) {
        self.facts().may_linger = false;
    }

    /// A response is asked for its next piece (`false`) or has just given one (`true`).
    pub(super) fn response_unread(&self, unread: bool) {
        let mut facts = self.facts();
        facts.unread = if unread { facts.unread + 1 } else { facts.unread.saturating_sub(1) };
        facts.progress = Instant::now();
    }

    /// A response in HTTP/2 begins, whose reader may stall while others go on.
    pub(super) fn watch(&self, reply: &Arc<Mutex<Content>>) {
        let mut facts = self.facts();
        facts.replies.retain(|reply| reply.strong_count() > 0);
        facts.replies.push(Arc::downgrade(reply));
    }

    /// Drops the bodies of responses that nobody has read from for so long, with all that they hold.
    pub(super) fn cut_stalled(&self, limit: Duration) {
        let replies: Vec<_> = self.facts().replies.iter().filter_map(Weak::upgrade).collect();
        for reply in replies {
            let cut = reply.lock().unwrap_or_else(PoisonError::into_inner).cut_if_stalled(limit);
            // Outside the lock: what a body holds may be much.
            drop(cut);
        }
    }

    /// Whether no request has come yet.
    pub(super) fn is_fresh(&self) -> bool {
        self.facts().requests == 0
    }

    /// Whether no request is on its way.
    pub(super) fn is_idle(&self) -> bool {
        self.facts().in_flight == 0
    }

    /// Whether a limit has passed.
    pub(super) fn verdict(&self, limits: &Limits) -> Option<Reason> {
        let now = Instant::now();
        let past = |since: Instant, limit: Duration| now.saturating_duration_since(since) >= limit;
        let facts = self.facts();
        // In HTTP/2, a stalled stream does not block the socket. One of several is left alone: it costs a buffer.
        let all_unread = facts.in_flight > 0 && facts.unread >= facts.in_flight;
        if let Some(since) = facts.blocked_since.or(all_unread.then_some(facts.progress)) {
            return past(since.max(facts.progress), limits.write_timeout).then_some(Reason::WriteTimeout);
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

/// Held by the two halves of a request: its body and its response.
#[derive(Debug)]
pub(super) struct InFlight(Arc<State>);

impl Drop for InFlight {
    fn drop(&mut self) {
        let mut facts = self.0.facts();
        facts.in_flight -= 1;
        facts.idle_since = Instant::now();
    }
}
