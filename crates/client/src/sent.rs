//! What a session was sent.

use crate::client::Client;
use crate::error::ClientError;
use cager_proto::messages::Sent;
use reqwest::Method;

impl Client {
    /// What a session was sent: options, and digests of files and of all frames that are solved. Compare them before you go on with a
    /// session from files that may have changed: [`Client::upload`] sends what is missing and looks at nothing else.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn sent(&self, id: &str) -> Result<Sent, ClientError> {
        let page = async |first: u32| -> Result<Sent, ClientError> {
            self.fetch(Method::GET, &["v1", "sessions", id, "sent"], &[("first", first.to_string())]).await
        };
        let mut sent = page(0).await?;
        while let Some(next) = sent.next {
            if sent.frames.last().is_none_or(|last| next <= last.frame) {
                return Err(ClientError::Protocol("its list of frames has no end".to_owned()));
            }
            let following = page(next).await?;
            sent.frames.extend(following.frames);
            sent.next = following.next;
        }
        Ok(sent)
    }
}
