//! The container, over as many connections as it takes.

use crate::body::next;
use crate::client::Client;
use crate::error::{ClientError, Failure};
use reqwest::header::{CONTENT_RANGE, ETAG, HeaderMap, HeaderName, IF_RANGE, RANGE};
use reqwest::{Method, Response, StatusCode};
use std::io::Write;

impl Client {
    /// Writes the container of a complete session to `out` and returns its length in bytes. A broken connection is taken up
    /// again where it broke off. `out` is written to between reads, on the thread that drives the call: give it a file, not
    /// something slow.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 where the session is not complete, [`ClientError::Output`] where `out` cannot
    /// be written, and those of the connection. `out` may then hold a part of the container.
    pub async fn download(&self, id: &str, out: &mut (impl Write + Send)) -> Result<u64, ClientError> {
        self.download_file(&["v1", "sessions", id, "capture.cager"], out).await
    }

    /// Writes a file that never changes.
    pub(crate) async fn download_file(&self, path: &[&str], out: &mut (impl Write + Send)) -> Result<u64, ClientError> {
        let mut progress = Written::default();
        let mut backoff = self.backoff();
        loop {
            let before = progress.bytes;
            let Err(failure) = self.download_on(path, out, &mut progress).await else { break };
            if progress.bytes > before {
                backoff.progress();
            }
            backoff.wait_after(failure).await?;
        }
        out.flush().map_err(ClientError::Output)?;
        Ok(progress.bytes)
    }

    /// Bytes of a completed session's container.
    pub(crate) async fn container_length(&self, id: &str) -> Result<u64, Failure> {
        let request = self.request(Method::GET, &["v1", "sessions", id, "capture.cager"], &[]).await?;
        let response = self.send(request.header(RANGE, "bytes=0-0")).await?;
        let range = text(response.headers(), CONTENT_RANGE);
        let total = range.as_deref().and_then(content_range).and_then(|(_, total)| total);
        total.ok_or_else(|| Failure::protocol("it does not say how long the container is"))
    }

    /// Goes on with a download on one connection, to its end.
    async fn download_on(
        &self,
        path: &[&str],
        out: &mut (impl Write + Send),
        written: &mut Written,
    ) -> Result<(), Failure> {
        let mut request = self.request(Method::GET, path, &[]).await?;
        if written.bytes > 0 {
            // Without a name for the version there is no telling whether the rest belongs to what is there.
            let Some(etag) = &written.etag else {
                return Err(Failure::protocol("it broke off and has no ETag to go on with; download it again"));
            };
            request = request.header(RANGE, format!("bytes={}-", written.bytes)).header(IF_RANGE, etag);
        }
        let mut response = match self.send(request).await {
            // All of it was there already, but not the end of the answer.
            Err(failure) if failure.status() == Some(416) && written.total == Some(written.bytes) => return Ok(()),
            answer => answer?,
        };
        let mut known = written.accept(&response)?;
        while let Some(piece) = next(self, &mut response).await? {
            let skipped = known.min(piece.len() as u64);
            known -= skipped;
            let piece = &piece[skipped as usize..];
            out.write_all(piece).map_err(ClientError::Output)?;
            written.bytes += piece.len() as u64;
        }
        match written.total {
            Some(total) if written.bytes < total => {
                Err(self.broken(format!("{} of {total} bytes came", written.bytes)))
            }
            Some(total) if written.bytes > total => {
                Err(Failure::protocol(format!("{} bytes came where {total} were announced", written.bytes)))
            }
            _ => Ok(()),
        }
    }
}

/// How far a download is.
#[derive(Debug, Default)]
struct Written {
    bytes: u64,
    total: Option<u64>,
    etag: Option<String>,
}

impl Written {
    /// Checks that an answer continues what is there; returns how many of its first bytes are there already.
    fn accept(&mut self, response: &Response) -> Result<u64, Failure> {
        let etag = text(response.headers(), ETAG).filter(|tag| !tag.starts_with("W/"));
        if self.bytes > 0 && etag.is_some() && etag != self.etag {
            return Err(Failure::protocol("it changed while it was downloaded; download it again"));
        }
        if response.status() == StatusCode::PARTIAL_CONTENT {
            let range = text(response.headers(), CONTENT_RANGE);
            let (start, total) = range.as_deref().and_then(content_range).unwrap_or((u64::MAX, None));
            if start != self.bytes {
                return Err(Failure::protocol(format!(
                    "the range from byte {} was asked for, but another one came",
                    self.bytes
                )));
            }
            self.total = total.or(self.total);
            return Ok(0);
        }
        // The whole in place of the rest: the version is the same, or the server would have said so above.
        if self.bytes > 0 && etag.is_none() {
            return Err(Failure::protocol("it broke off and its ETag is gone; download it again"));
        }
        self.total = response.content_length();
        self.etag = etag;
        Ok(self.bytes)
    }
}

fn text(headers: &HeaderMap, name: HeaderName) -> Option<String> {
    Some(headers.get(name)?.to_str().ok()?.to_owned())
}

/// First byte and total of `bytes 10-99/100`; the total may be unknown, `*`.
fn content_range(value: &str) -> Option<(u64, Option<u64>)> {
    let (range, total) = value.trim().strip_prefix("bytes")?.trim_start().split_once('/')?;
    let (start, _) = range.split_once('-')?;
    Some((start.trim().parse().ok()?, total.trim().parse().ok()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_of_an_answer_is_read() {
        assert_eq!(content_range("bytes 10-99/100"), Some((10, Some(100))));
        assert_eq!(content_range("bytes 10-99/*"), Some((10, None)));
        for bad in ["", "bytes", "bytes */100", "items 1-2/3", "bytes -5/10"] {
            assert_eq!(content_range(bad), None, "{bad}");
        }
    }
}
