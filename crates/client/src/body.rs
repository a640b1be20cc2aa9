//! Reading response bodies with limits on length and idle time.

use crate::client::Client;
use crate::error::{ClientError, Failure};
use bytes::Bytes;
use reqwest::{Method, Response};
use serde::de::DeserializeOwned;

/// Longest JSON body: the errors of half a million frames are shorter.
const JSON_BYTES: u64 = 64 << 20;

/// Largest allocation made from `Content-Length` alone.
const TRUSTED_BYTES: u64 = 1 << 20;

/// Result of waiting for the next chunk of a body.
pub(crate) enum BodyEvent {
    /// The part.
    Piece(Bytes),
    /// The body is over.
    End,
    /// Nothing within the idle time-out.
    Idle,
}

/// Waits for the next chunk of a body that may be idle for long.
pub(crate) async fn listen(client: &Client, response: &mut Response) -> Result<BodyEvent, Failure> {
    match tokio::time::timeout(client.options().idle_timeout, response.chunk()).await {
        Ok(Ok(Some(piece))) => Ok(BodyEvent::Piece(piece)),
        Ok(Ok(None)) => Ok(BodyEvent::End),
        Ok(Err(error)) => Err(client.network(&error)),
        Err(_) => Ok(BodyEvent::Idle),
    }
}

/// The next chunk of a body; `None` at its end.
pub(crate) async fn next(client: &Client, response: &mut Response) -> Result<Option<Bytes>, Failure> {
    match listen(client, response).await? {
        BodyEvent::Piece(piece) => Ok(Some(piece)),
        BodyEvent::End => Ok(None),
        BodyEvent::Idle => Err(client.stalled()),
    }
}

/// A whole body of at most `limit` bytes.
pub(crate) async fn whole(client: &Client, mut response: Response, limit: u64) -> Result<Vec<u8>, Failure> {
    let too_long = || Failure::protocol(format!("its body has more than {limit} bytes"));
    let announced = response.content_length().unwrap_or(0);
    if announced > limit {
        return Err(too_long());
    }
    let mut body = Vec::with_capacity(announced.min(TRUSTED_BYTES) as usize);
    while let Some(chunk) = next(client, &mut response).await? {
        if body.len() as u64 + chunk.len() as u64 > limit {
            return Err(too_long());
        }
        body.extend_from_slice(&chunk);
    }
    Ok(body)
}

impl Client {
    /// Sends an idempotent request and parses its JSON response.
    pub(crate) async fn fetch<T: DeserializeOwned>(
        &self,
        method: Method,
        segments: &[&str],
        query: &[(&str, String)],
    ) -> Result<T, ClientError> {
        self.retrying(|| async {
            let request = self.request(method.clone(), segments, query).await?;
            json(self, self.send(request).await?).await
        })
        .await
    }
}

/// A JSON body.
pub(crate) async fn json<T: DeserializeOwned>(client: &Client, response: Response) -> Result<T, Failure> {
    let body = whole(client, response, JSON_BYTES).await?;
    serde_json::from_slice(&body)
        .map_err(|error| Failure::protocol(format!("its JSON is not what was asked for: {error}")))
}

/// Parses little-endian numbers of N bytes each.
pub(crate) fn numbers<T, const N: usize>(bytes: &[u8], read: fn([u8; N]) -> T) -> Result<Vec<T>, Failure> {
    let (numbers, rest) = bytes.as_chunks::<N>();
    if rest.is_empty() {
        Ok(numbers.iter().map(|&b| read(b)).collect())
    } else {
        Err(Failure::protocol(format!("its {} bytes are not numbers of {N}", bytes.len())))
    }
}
