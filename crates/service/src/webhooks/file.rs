//! The webhooks file.
//!
//! ```toml
//! [[webhook]]
//! url = "https://pipeline.example/hooks/cager"
//! secret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"   # of 24 to 64 bytes, base64; the receiver has the same
//! # tenant = "studio-a"              # only sessions of this tenant; default: all
//! # events = ["session.completed"]   # default: session.failed, job.completed and job.failed as well
//! ```

use super::Event;
use crate::auth::is_name;
use crate::config::{EntriesError, entries, entries::Wrong, line_of};
use base64::Engine as _;
use base64::prelude::{BASE64_STANDARD, BASE64_URL_SAFE_NO_PAD};
use reqwest::Url;
use ring::digest;
use ring::hmac::{HMAC_SHA256, Key};
use serde::Deserialize;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use tokio::sync::Semaphore;
use toml::Spanned;

/// Concurrent messages to one receiver.
const AT_A_TIME: usize = 4;
const SECRET_PREFIX: &str = "whsec_";

/// Why a webhooks file cannot be used. Never quotes secrets.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WebhooksError {
    /// It cannot be read, or an entry is wrong.
    #[error(transparent)]
    Entries(#[from] EntriesError),
    /// Nothing can be sent.
    #[error("webhooks cannot be sent: {0}")]
    Client(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default)]
    webhook: Vec<Written>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    url: Spanned<String>,
    secret: Spanned<String>,
    tenant: Option<String>,
    events: Option<Vec<Event>>,
}

/// A receiver of messages.
pub(super) struct Hook {
    /// Digest of address and tenant, which identifies it in notes.
    pub(super) id: String,
    pub(super) url: Url,
    /// Its line in the file, which identifies it in the log: the address may be a secret.
    pub(super) line: usize,
    pub(super) key: Key,
    tenant: Option<String>,
    events: Option<Vec<Event>>,
    pub(super) places: Semaphore,
    /// It responded 410 Gone.
    pub(super) gone: AtomicBool,
}

impl Hook {
    pub(super) fn wants(&self, tenant: &str, event: Event) -> bool {
        self.tenant.as_deref().is_none_or(|wanted| wanted == tenant)
            && self.events.as_ref().is_none_or(|events| events.contains(&event))
    }
}

pub(super) fn read(file: &Path) -> Result<Vec<Hook>, WebhooksError> {
    Ok(entries::read(file, parse)?)
}

/// Parses entries; errors have their offset in the text.
fn parse(text: &str) -> Result<Vec<Hook>, Wrong> {
    let document: Document = entries::document(text, "webhooks")?;
    let mut hooks: Vec<Hook> = Vec::with_capacity(document.webhook.len());
    for written in document.webhook {
        let place = written.url.span().start;
        let hook = hook(written, line_of(text, place))?;
        if let Some(other) = hooks.iter().find(|other| other.id == hook.id) {
            let why =
                format!("the entry in line {} has the same url and tenant; put their events together", other.line);
            return Err((place, why));
        }
        hooks.push(hook);
    }
    Ok(hooks)
}

fn hook(written: Written, line: usize) -> Result<Hook, Wrong> {
    let url = crate::http_client::address(written.url.as_ref()).map_err(|why| (written.url.span().start, why))?;
    let secret = written.secret.as_ref().strip_prefix(SECRET_PREFIX).and_then(|text| BASE64_STANDARD.decode(text).ok());
    let secret = secret.filter(|secret| (24..=64).contains(&secret.len())).ok_or_else(|| {
        let why = "secret must be whsec_ and 24 to 64 bytes in base64: echo whsec_$(openssl rand -base64 32)";
        (written.secret.span().start, why.to_owned())
    })?;
    if let Some(tenant) = written.tenant.as_deref().filter(|tenant| !is_name(tenant)) {
        return Err((written.url.span().start, format!("tenant: {tenant:?} can be no tenant's name")));
    }
    let named = format!("{url} {}", written.tenant.as_deref().unwrap_or_default());
    Ok(Hook {
        id: BASE64_URL_SAFE_NO_PAD.encode(&digest::digest(&digest::SHA256, named.as_bytes()).as_ref()[..12]),
        url,
        line,
        key: Key::new(HMAC_SHA256, &secret),
        tenant: written.tenant,
        events: written.events,
        places: Semaphore::new(AT_A_TIME),
        gone: AtomicBool::new(false),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: &str = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";

    #[test]
    fn entries_say_who_is_told_of_what() {
        let hooks = parse(&format!(
            "[[webhook]]\nurl = \"https://a.example/all\"\nsecret = \"{SECRET}\"\n\
             [[webhook]]\nurl = \"https://a.example/x\"\nsecret = \"{SECRET}\"\ntenant = \"a\"\nevents = [\"session.failed\"]\n"
        ));
        let hooks = hooks.map_err(|(_, why)| why).unwrap();
        assert!(hooks[0].wants("a", Event::Completed) && hooks[0].wants("b", Event::Failed));
        assert!(hooks[1].wants("a", Event::Failed) && !hooks[1].wants("a", Event::Completed));
        assert!(!hooks[1].wants("b", Event::Failed));
        assert_ne!(hooks[0].id, hooks[1].id);
    }

    #[test]
    fn wrong_entries_are_named_by_line_and_never_quote_secrets() {
        let good = ("https://a.example/x", SECRET, "");
        for (url, secret, more, line, word) in [
            ("http://a.example/x", good.1, "", 2, "https"),
            ("nowhere", good.1, "", 2, "no address"),
            (good.0, "whsec_c2VjcmV0", "", 3, "24 to 64 bytes"),
            (good.0, "c2VjcmV0c2VjcmV0c2VjcmV0c2VjcmV0", "", 3, "whsec_"),
            (good.0, good.1, "events = [\"session.begun\"]", 4, "unknown variant"),
            (good.0, good.1, "tenant = \"a/b\"", 2, "no tenant's name"),
            (
                good.0,
                good.1,
                "[[webhook]]\nurl = \"https://a.example/x\"\nsecret = \"whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw\"",
                5,
                "line 2",
            ),
            (good.0, good.1, "tenants = \"a\"", 4, "unknown field"),
        ] {
            let text = format!("[[webhook]]\nurl = \"{url}\"\nsecret = \"{secret}\"\n{more}\n");
            let (offset, why) = parse(&text).err().unwrap();
            assert_eq!((line_of(&text, offset), why.contains(word)), (line, true), "{why}");
            assert!(!why.contains("c2Vj"), "{why}");
        }
    }
}
