//! Errors, one variant per reaction of the caller.

use crate::problem::is_body_limit;
use cager_proto::messages::Problem;
use std::io;
use std::time::Duration;

/// Why a call failed; the message is one sentence that says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The address of the service cannot be used: correct it.
    #[error("{address:?} is not the address of a service ({what}); give one such as http://127.0.0.1:8080")]
    Address {
        /// What was given.
        address: String,
        /// What is wrong with it.
        what: String,
    },
    /// Nobody answers there: check the address, or start the service.
    #[error("{address} cannot be reached ({cause}); check the address and whether the service is running")]
    Connect {
        /// Address of the service.
        address: String,
        /// What the network said, as text.
        cause: String,
    },
    /// The connection broke, or nothing moved for too long: try again.
    #[error("the connection to {address} broke ({cause}); try again")]
    Broken {
        /// Address of the service.
        address: String,
        /// What the network said, as text.
        cause: String,
    },
    /// The service answered with an error: its detail says what to do.
    #[error("{}", said(.0))]
    Refused(Box<Problem>),
    /// The session failed: its problem says what to correct before creating a new one.
    #[error("the session failed: {}", said(.0))]
    Failed(Box<Problem>),
    /// The session was not ready within the time allowed: wait longer.
    #[error("session {id} is still preparing after {} s; wait longer, or look at the service's load", .waited.as_secs())]
    NotReady {
        /// The session.
        id: String,
        /// How long it was waited for.
        waited: Duration,
    },
    /// No cage could be designed: its problem says what to correct before requesting another.
    #[error("no cage could be designed: {}", said(.0))]
    NoCage(Box<Problem>),
    /// The cage was not designed within the time allowed: wait longer.
    #[error("cage design {id} is still going on after {} s; wait longer, or look at the service's load", .waited.as_secs())]
    NotDesigned {
        /// The design.
        id: String,
        /// How long it was waited for.
        waited: Duration,
    },
    /// The answer is not what such a service sends: check that the address is that of a CageR service of this version.
    #[error(
        "the answer is not that of a CageR service ({0}); check the address, and that client and service are of the same version"
    )]
    Protocol(String),
    /// The data does not fit the session.
    #[error("{0}")]
    Mismatch(String),
    /// The frames to upload could not be read.
    #[error("{cause}")]
    Source {
        /// The frame that was being read.
        frame: u32,
        /// Why; it is the message, so not a source as well.
        cause: io::Error,
    },
    /// The download could not be written: free some space or choose another place.
    #[error("the download cannot be written ({0}); free some space or choose another place")]
    Output(io::Error),
    /// Several attempts in a row failed without progress.
    #[error("gave up after {attempts} attempts in a row without progress; the last one: {last}")]
    GaveUp {
        /// Attempts since the last progress.
        attempts: u32,
        /// Error of the last attempt; part of the message, so not a source as well.
        last: Box<ClientError>,
    },
}

impl ClientError {
    /// Whether a proxy before the service refused the length of a request: its limit has to be raised, trying again gives the same.
    pub fn is_body_limit(&self) -> bool {
        self.problem().is_some_and(is_body_limit)
    }

    /// The problem that the service named, where it named one.
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Self::Refused(problem) | Self::Failed(problem) => Some(problem),
            Self::GaveUp { last, .. } => last.problem(),
            _ => None,
        }
    }

    /// HTTP status of the answer, where there was one.
    pub fn status(&self) -> Option<u16> {
        self.problem().map(|problem| problem.status)
    }
}

/// Text of a problem for error messages.
fn said(problem: &Problem) -> String {
    let text = if problem.detail.is_empty() { &problem.title } else { &problem.detail };
    match &problem.request_id {
        Some(id) => format!("{text} (request {id})"),
        None => text.clone(),
    }
}

/// A failed attempt, classified by whether to retry.
#[derive(Debug)]
pub(crate) enum Failure {
    /// It may go away by itself.
    Transient {
        /// What to report if it does not.
        error: ClientError,
        /// How long the service asked to be left alone.
        retry_after: Option<Duration>,
    },
    /// Trying again gives the same.
    Final(ClientError),
}

impl Failure {
    pub(crate) fn transient(error: ClientError) -> Self {
        Self::Transient { error, retry_after: None }
    }

    pub(crate) fn protocol(what: impl Into<String>) -> Self {
        Self::Final(ClientError::Protocol(what.into()))
    }

    /// HTTP status of the answer, where there was one.
    pub(crate) fn status(&self) -> Option<u16> {
        match self {
            Self::Transient { error, .. } | Self::Final(error) => error.status(),
        }
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        Self::Final(error)
    }
}
