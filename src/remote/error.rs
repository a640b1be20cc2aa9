//! Why an encoding by a service stopped, and what of it is left there.

use cager_client::ClientError;
use cager_proto::container;
use std::io;

/// Why encoding by a service stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum RemoteError {
    /// The service refused, or cannot be reached.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// A file cannot be read or written.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// What the service sent is not a container.
    #[error(
        "the container from the service cannot be read ({0}); encode again, and look at the service's log if that \
         gives the same"
    )]
    Container(container::Error),
    /// The session to go on with is of something else.
    #[error("{0}; give what session {session} was made with, or leave out --session for a new one",
            session = .0.session)]
    Different(Difference),
    /// It broke off for a reason that passes, and the service keeps what it has.
    #[error("{cause}; session {session} keeps what was sent: the same command with --session {session} goes on")]
    Kept {
        /// The session.
        session: String,
        /// Why it broke off.
        cause: Box<Self>,
    },
    /// It broke off for a reason that somebody has to remove first, and the service keeps what it has.
    #[error(
        "{cause}; session {session} keeps what was sent: once that is put right, the same command with --session \
         {session} goes on"
    )]
    Stopped {
        /// The session.
        session: String,
        /// Why it broke off.
        cause: Box<Self>,
    },
    /// A proxy lets no request through that is large enough.
    #[error("{cause}; session {session} keeps what was sent: with the limit raised, give --session {session} as well")]
    Limited {
        /// The session.
        session: String,
        /// What the proxy said.
        cause: Box<Self>,
    },
    /// Trying again would end the same way.
    #[error(
        "{cause}; session {session} cannot be gone on with: {address}/v1/sessions/{session} shows it until you delete \
         it there"
    )]
    Ended {
        /// The session.
        session: String,
        /// Address of the service.
        address: String,
        /// Why it ended.
        cause: Box<Self>,
    },
    /// There is no such session, or there is none any more.
    #[error("{cause}; leave out --session to begin a new one")]
    Gone {
        /// What the service said.
        cause: Box<Self>,
    },
    /// It broke off while a cage was being designed, or after that.
    #[error(
        "{cause}; cage design {design} stays on the service: fetch its cage from {address}/v1/cages/{design}/cage.obj \
         and give it with --cage, or delete it there"
    )]
    Designed {
        /// The design.
        design: String,
        /// Address of the service.
        address: String,
        /// Why it broke off.
        cause: Box<Self>,
    },
    /// The service could not do it.
    #[error("{0}")]
    Failed(String),
    /// The network runtime cannot be started.
    #[error("the network cannot be used ({0}); free some memory or files and try again")]
    Runtime(io::Error),
}

/// The first difference between a capture and the session that was to be gone on with.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct Difference {
    /// The session.
    pub session: String,
    /// What differs, and how.
    pub what: String,
}

impl RemoteError {
    /// The error with what is left of the session: users mend most causes, and go on.
    pub(super) fn with_session(self, session: &str, address: &str) -> Self {
        let (session, cause) = (session.to_owned(), Box::new(self));
        match &*cause {
            Self::Different(_) => *cause,
            Self::Client(error) if is_gone(error) => Self::Gone { cause },
            Self::Client(error) if is_final(error) => {
                Self::Ended { session, address: address.trim_end_matches('/').to_owned(), cause }
            }
            Self::Client(error) if error.is_body_limit() => Self::Limited { session, cause },
            Self::Client(error) if passes(error) => Self::Kept { session, cause },
            _ => Self::Stopped { session, cause },
        }
    }

    /// The error alone, for a service that does not stay.
    pub fn without_session(self) -> Self {
        match self {
            Self::Kept { cause, .. }
            | Self::Stopped { cause, .. }
            | Self::Limited { cause, .. }
            | Self::Ended { cause, .. }
            | Self::Gone { cause } => *cause,
            error => error,
        }
    }

    /// The error with what is left of a design.
    pub(super) fn of_design(cause: Self, design: &str, address: &str) -> Self {
        if matches!(&cause, Self::Client(error) if is_gone(error)) {
            return cause;
        }
        let (design, address) = (design.to_owned(), address.trim_end_matches('/').to_owned());
        Self::Designed { design, address, cause: Box::new(cause) }
    }
}

fn is_gone(error: &ClientError) -> bool {
    matches!(error.status(), Some(404 | 410))
}

/// Whether the same may succeed later with nothing changed.
fn passes(error: &ClientError) -> bool {
    match error {
        ClientError::Broken { .. } | ClientError::Connect { .. } | ClientError::NotReady { .. } => true,
        ClientError::GaveUp { last, .. } => {
            last.status().is_none_or(|status| matches!(status, 408 | 425 | 429 | 502..=504))
        }
        error => matches!(error.status(), Some(408 | 425 | 429 | 502..=504)),
    }
}

/// Whether the session can never be completed. Where in doubt it can.
fn is_final(error: &ClientError) -> bool {
    let words = ["session-failed", "session-completed", "invalid-options", "invalid-geometry"];
    error.problem().is_some_and(|problem| words.contains(&problem.word()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_client::messages::Problem;
    use std::time::Duration;

    fn said(error: impl Into<RemoteError>) -> String {
        error.into().with_session("s-1", "http://here/").to_string()
    }

    fn problem(status: u16, word: &str) -> Box<Problem> {
        let kind = format!("{}{word}", Problem::TYPE_PREFIX);
        Box::new(Problem { kind, status, detail: word.to_owned(), ..Problem::default() })
    }

    #[test]
    fn what_users_can_mend_leaves_a_session_to_go_on_with() {
        let broken = || ClientError::Broken { address: String::new(), cause: String::new() };
        let refused = |status, word| ClientError::Refused(problem(status, word));
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        let passing = [
            broken(),
            ClientError::Connect { address: String::new(), cause: String::new() },
            ClientError::GaveUp { attempts: 9, last: Box::new(refused(503, "storage-failed")) },
            ClientError::GaveUp { attempts: 9, last: Box::new(refused(502, "bad-gateway")) },
            ClientError::GaveUp { attempts: 9, last: Box::new(broken()) },
            refused(429, "share-taken"),
            ClientError::NotReady { id: "s-1".to_owned(), waited: Duration::ZERO },
        ];
        let mendable = [
            refused(507, "quota-exceeded"),
            refused(507, "storage-full"),
            refused(413, "too-large"),
            refused(401, "unauthorized"),
            refused(422, "invalid-frame"),
            refused(409, "frame-conflict"),
            refused(400, "bad-request"),
            ClientError::Source { frame: 7, cause: io::Error::other("NaN") },
            ClientError::Mismatch("other points".to_owned()),
            ClientError::Protocol("a page".to_owned()),
            ClientError::Output(full()),
        ];
        let passing = passing.map(|error| (error, ": the same command with"));
        for (error, words) in passing.into_iter().chain(mendable.map(|error| (error, ": once that is put right,"))) {
            let text = error.to_string();
            let said = said(error);
            assert!(said.starts_with(&text) && said.contains(words), "{said}");
            assert!(said.ends_with("the same command with --session s-1 goes on"), "{said}");
        }
        let path = std::path::PathBuf::from("out.cager");
        let said = said(cager_formats::Error::Io { path, action: cager_formats::Action::Write, cause: full() });
        assert!(said.contains("--session s-1 goes on"), "{said}");
    }

    #[test]
    fn a_limit_of_a_proxy_has_to_be_raised_first() {
        let page = Problem { kind: "about:blank".to_owned(), status: 413, ..Problem::default() };
        let said = said(ClientError::Refused(Box::new(page)));
        assert!(said.ends_with("with the limit raised, give --session s-1 as well"), "{said}");
    }

    #[test]
    fn what_nobody_can_mend_says_where_to_look_at_the_session() {
        let hopeless = [
            ClientError::Failed(problem(422, "invalid-geometry")),
            ClientError::Refused(problem(409, "session-failed")),
            ClientError::Refused(problem(409, "session-completed")),
            ClientError::Refused(problem(422, "invalid-options")),
        ];
        for error in hopeless {
            let said = said(error);
            assert!(said.contains("http://here/v1/sessions/s-1 shows it") && !said.contains("goes on"), "{said}");
        }
        for status in [404, 410] {
            let said = said(ClientError::Refused(problem(status, "not-found")));
            assert!(said.ends_with("leave out --session to begin a new one"), "{said}");
        }
    }
}
