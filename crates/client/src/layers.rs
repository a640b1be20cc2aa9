//! Frames that the service codes: the container as it grows, and positions of its frames.

use crate::body::{BodyEvent, listen, numbers, whole};
use crate::client::Client;
use crate::error::{ClientError, Failure};
use crate::sessions::{known, reason};
use cager_proto::messages::SessionState;
use reqwest::Method;
use std::io::Write;
use std::ops::Range;

/// How much of a frame is decoded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layer {
    /// The positions that its cage gives.
    Cages,
    /// Those with the residual added, where there is one.
    #[default]
    All,
}

impl Client {
    /// Positions of a session's own frames, n × 3 values each, decoded by the service.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 where some are not coded yet, or not solved in a session that codes none; and those of the connection.
    pub async fn decode_frames(&self, id: &str, frames: Range<u32>, layer: Layer) -> Result<Vec<f32>, ClientError> {
        let count = frames.end.saturating_sub(frames.start);
        if count == 0 {
            return Ok(Vec::new());
        }
        let layer = if layer == Layer::Cages { "cages" } else { "all" };
        let query = [("layer", layer.to_owned()), ("first", frames.start.to_string()), ("count", count.to_string())];
        let session = self.session(id).await?;
        self.retrying(|| async {
            let points = known(id, "points", session.points)?;
            let expected = 12 * u64::from(points) * u64::from(count);
            let request = self.request(Method::POST, &["v1", "sessions", id, "decode"], &query).await?;
            let positions = whole(self, self.send(request).await?, expected).await?;
            if positions.len() as u64 != expected {
                return Err(self.broken(format!("{} of {expected} bytes came", positions.len())));
            }
            numbers(&positions, f32::from_le_bytes)
        })
        .await
    }

    /// Writes the container of a session to `out` as its frames come, until the session is complete; returns its length in bytes. What is
    /// written can be decoded up to its last whole section at any time. A broken connection is taken up again where it broke off.
    ///
    /// # Errors
    /// [`ClientError::Output`] where `out` cannot be written, [`ClientError::Failed`] for a session that fails, and those of the connection.
    pub async fn follow_container(&self, id: &str, out: &mut (impl Write + Send)) -> Result<u64, ClientError> {
        let (mut written, mut backoff) = (0, self.backoff());
        loop {
            let before = written;
            let Err(failure) = self.follow_container_on(id, out, &mut written).await else { break };
            if written > before {
                backoff.progress();
            }
            backoff.wait_after(failure).await?;
        }
        out.flush().map_err(ClientError::Output)?;
        Ok(written)
    }

    async fn follow_container_on(
        &self,
        id: &str,
        out: &mut (impl Write + Send),
        written: &mut u64,
    ) -> Result<(), Failure> {
        let query = [("follow", "true".to_owned())];
        let request = self.request(Method::GET, &["v1", "sessions", id, "capture.cager"], &query).await?;
        let mut response = self.send(request).await?;
        // The same frames give the same bytes.
        let mut known = *written;
        loop {
            match listen(self, &mut response).await? {
                BodyEvent::Piece(piece) => {
                    let skipped = known.min(piece.len() as u64);
                    known -= skipped;
                    out.write_all(&piece[skipped as usize..]).map_err(ClientError::Output)?;
                    *written += piece.len() as u64 - skipped;
                }
                // Frames may be long in coming; whether the service is there shows in another answer.
                BodyEvent::Idle => drop(self.session(id).await?),
                BodyEvent::End => break,
            }
        }
        let session = self.session(id).await?;
        match session.state {
            SessionState::Completed => match self.container_length(id).await? {
                length if length == *written => Ok(()),
                _ => Err(Failure::protocol(
                    "frames that were received already are not in the completed container; download it",
                )),
            },
            SessionState::Failed => Err(ClientError::Failed(Box::new(reason(session))).into()),
            SessionState::Preparing | SessionState::Ready => Err(self.broken("the stream ended before the container")),
        }
    }
}
