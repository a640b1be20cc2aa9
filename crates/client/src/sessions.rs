//! Reading, awaiting, completing and deleting sessions.

use crate::body::json;
use crate::client::Client;
use crate::error::{ClientError, Failure};
use cager_proto::messages::{Complete, Problem, Rename, Session, SessionList, SessionState};
use reqwest::Method;
use serde::de::DeserializeOwned;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Polling intervals of [`Client::wait_ready`].
const FIRST_PAUSE: Duration = Duration::from_millis(20);
const MAX_PAUSE: Duration = Duration::from_secs(2);

impl Client {
    /// A session as it is now.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn session(&self, id: &str) -> Result<Session, ClientError> {
        self.fetch(Method::GET, &["v1", "sessions", id], &[]).await
    }

    /// All sessions, newest first, page after page.
    ///
    /// # Errors
    /// Those of the connection.
    pub async fn sessions(&self) -> Result<Vec<Session>, ClientError> {
        self.pages("sessions", |SessionList { sessions, next }| (sessions, next)).await
    }

    /// What all pages of a list have.
    pub(crate) async fn pages<L: DeserializeOwned, T>(
        &self,
        list: &str,
        read: impl Fn(L) -> (Vec<T>, Option<String>),
    ) -> Result<Vec<T>, ClientError> {
        let (mut all, mut query) = (Vec::new(), Vec::new());
        loop {
            let (page, next) = read(self.fetch(Method::GET, &["v1", list], &query).await?);
            let grew = !page.is_empty();
            all.extend(page);
            match next {
                None => return Ok(all),
                // An empty page with a `next` would loop for ever.
                Some(_) if !grew => return Err(ClientError::Protocol(format!("its list of {list} has no end"))),
                Some(next) => query = vec![("after", next)],
            }
        }
    }

    /// Deletes a session with all its results, and stops work for it.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn delete(&self, id: &str) -> Result<(), ClientError> {
        let asked = AtomicBool::new(false);
        self.retrying(|| async {
            let request = self.request(Method::DELETE, &["v1", "sessions", id], &[]).await?;
            let again = asked.swap(true, Ordering::Relaxed);
            match self.send(request).await {
                // An earlier attempt deleted it, and its answer was lost.
                Err(failure) if again && failure.status() == Some(404) => Ok(()),
                answer => answer.map(drop),
            }
        })
        .await
    }

    /// Waits until a session takes frames, or is complete.
    ///
    /// # Errors
    /// [`ClientError::Failed`] with the reason where preparing failed, [`ClientError::NotReady`] after `limit`, and those of
    /// the connection.
    pub async fn wait_ready(&self, id: &str, limit: Duration) -> Result<Session, ClientError> {
        let clock = Instant::now();
        let mut pause = FIRST_PAUSE;
        loop {
            let session = self.session(id).await?;
            match session.state {
                SessionState::Ready | SessionState::Completed => return Ok(session),
                SessionState::Failed => return Err(ClientError::Failed(Box::new(reason(session)))),
                SessionState::Preparing => {}
            }
            let waited = clock.elapsed();
            if waited >= limit {
                return Err(ClientError::NotReady { id: id.to_owned(), waited });
            }
            tokio::time::sleep(pause.min(limit - waited)).await;
            pause = pause.mul_f64(1.25).min(MAX_PAUSE);
        }
    }

    /// Gives a session another name; an empty name removes it.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id and 422 for a name that is too long, and those of the connection.
    pub async fn rename(&self, id: &str, name: &str) -> Result<Session, ClientError> {
        let rename = Rename { name: name.to_owned() };
        self.retrying(|| async {
            let request = self.request(Method::PATCH, &["v1", "sessions", id], &[]).await?;
            json(self, self.send(request.json(&rename)).await?).await
        })
        .await
    }

    /// Declares that the capture has `frames` frames, which completes the session and writes its container.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 and the missing ranges where frames are missing, and those of the
    /// connection.
    pub async fn complete(&self, id: &str, frames: u32) -> Result<Session, ClientError> {
        self.retrying(|| async {
            let request = self.request(Method::POST, &["v1", "sessions", id, "complete"], &[]).await?;
            json(self, self.send(request.json(&Complete { frames, discard_beyond: false })).await?).await
        })
        .await
    }
}

/// Why a session failed.
pub(crate) fn reason(session: Session) -> Problem {
    session.problem.unwrap_or_else(|| Problem {
        kind: "about:blank".to_owned(),
        title: "Session failed".to_owned(),
        detail: "the service does not say why; look at its log".to_owned(),
        ..Problem::default()
    })
}

/// A number of a session that is known once it is ready.
pub(crate) fn known(id: &str, what: &str, number: Option<u32>) -> Result<u32, Failure> {
    number.ok_or_else(|| {
        ClientError::Mismatch(format!("session {id} does not know its {what} yet; wait until it is ready")).into()
    })
}
