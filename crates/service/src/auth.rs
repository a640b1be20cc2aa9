//! Authentication and authorisation: access tokens, tenants and their limits.
//!
//! A tokens file holds the SHA-256 of each token, never the token:
//!
//! ```toml
//! # T=$(openssl rand -hex 32); printf %s "$T" | sha256sum
//! [[token]]
//! name = "farm"            # what the log calls it
//! tenant = "studio-a"      # whose sessions it sees; several tokens may share a tenant
//! sha256 = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"
//! priority = "normal"      # or high, low
//! scope = "write"          # or read: look at sessions and decode, change nothing; admin: and operate the service
//! max_sessions = 100       # this and max_bytes, max_age_s, max_streams: where they differ from the service's settings
//! ```
//!
//! Clients send `Authorization: Bearer TOKEN`. Tokens of an OpenID Connect provider are accepted if one is configured, see [`OidcSettings`].

mod file;
mod provider;
mod signatures;
#[cfg(test)]
mod tests;

pub use file::AccessError;
pub(crate) use file::is_name;
pub use provider::OidcSettings;

use crate::sync::lock;
use file::{Entries, Stamp};
use http::HeaderMap;
use http::header::AUTHORIZATION;
use provider::Provider;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Shortest token that is accepted, in bytes: shorter ones could be guessed.
pub const MIN_TOKEN_BYTES: usize = 16;
/// Longest token accepted, in bytes.
const MAX_TOKEN_BYTES: usize = 1024;
/// Name of the only tenant of a service without tokens.
pub const LOCAL: &str = "local";
/// Interval at which the tokens file is checked for changes, and how long it must then stay as it is: who rewrites a file empties it first. A second together.
const POLL_INTERVAL: Duration = Duration::from_millis(750);
const SETTLED_FOR: Duration = Duration::from_millis(250);

/// Share of the solving threads relative to other waiting tenants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Priority {
    /// A quarter of a normal share.
    Low,
    /// One share.
    #[default]
    Normal,
    /// Four shares.
    High,
}

impl Priority {
    /// Weight in the scheduler.
    pub fn weight(self) -> f64 {
        match self {
            Self::Low => 0.25,
            Self::Normal => 1.0,
            Self::High => 4.0,
        }
    }
}

/// Resource limits of a tenant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TenantLimits {
    /// Sessions at a time.
    pub max_sessions: u64,
    /// Bytes of all its sessions on disk.
    pub max_bytes: u64,
    /// Age in seconds at which sessions are deleted; 0 for never.
    pub max_age_s: u64,
    /// Concurrent streams.
    pub max_streams: u64,
}

impl TenantLimits {
    /// The larger limit of each kind.
    fn most_generous(self, other: Self) -> Self {
        let for_ever = self.max_age_s == 0 || other.max_age_s == 0;
        Self {
            max_sessions: self.max_sessions.max(other.max_sessions),
            max_bytes: self.max_bytes.max(other.max_bytes),
            max_age_s: if for_ever { 0 } else { self.max_age_s.max(other.max_age_s) },
            max_streams: self.max_streams.max(other.max_streams),
        }
    }
}

/// The owner of sessions and cage jobs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tenant {
    /// Name, fit for a file name.
    pub name: String,
    /// Share of the solving threads relative to other waiting tenants.
    pub priority: Priority,
    /// Resource limits.
    pub limits: TenantLimits,
}

/// Permissions of a token.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scope {
    /// Read and decode.
    Read,
    /// Read and write.
    #[default]
    Write,
    /// Also use the operators' listener, for all tenants.
    Admin,
}

/// Tenant and permissions of an authenticated request.
#[derive(Clone, Debug)]
pub struct Grant {
    /// Tenant that the token belongs to.
    pub tenant: Arc<Tenant>,
    /// The token's name in the tokens file; empty in a service without tokens.
    pub token: Arc<str>,
    /// Permissions.
    pub scope: Scope,
    /// Cancelled when the token is removed from the file or moved to another tenant; ends requests in progress.
    pub revoked: CancellationToken,
    /// When the token expires, which also ends requests in progress.
    pub expires: Option<Instant>,
}

impl PartialEq for Grant {
    fn eq(&self, other: &Self) -> bool {
        (&self.tenant, &self.token, self.scope) == (&other.tenant, &other.token, other.scope)
    }
}

/// Why authentication failed; the response is 401 with `WWW-Authenticate: Bearer`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Denied {
    /// There is no `Authorization` header.
    #[error("this service needs a token: send the header Authorization: Bearer TOKEN")]
    Missing,
    /// The header is malformed or repeated.
    #[error("the Authorization header must be Bearer and a token, once")]
    Malformed,
    /// The token is unknown or was revoked.
    #[error("the token is not valid (any more); ask the service's operator for another")]
    Unknown,
    /// The token has expired.
    #[error("the token has expired; sign in again for another")]
    Expired,
    /// The token has no expiry time.
    #[error("the token does not say when it expires: its exp is missing or no time")]
    NoExpiry,
    /// Its issuer or audience is another.
    #[error("the token is not for this service: its iss or aud is another")]
    WrongIssuerOrAudience,
    /// It has no valid tenant claim.
    #[error(
        "the token names no tenant, or one that is not 1 to 64 letters, digits or . _ -; the provider has to add the claim that the setting oidc_tenant names"
    )]
    NoTenant,
    /// It has no scope of this service.
    #[error("the token's scope has none of cager:read, cager:write and cager:admin")]
    NoScope,
    /// The provider's key set has never been fetched successfully.
    #[error("the keys of the OpenID Connect provider cannot be fetched at the moment; try again soon")]
    NoKeys,
}

/// Authenticates requests. Clones share their state.
#[derive(Clone)]
pub struct Access {
    tokens: Arc<Tokens>,
    provider: Option<Arc<Provider>>,
}

struct Tokens {
    /// Without a file, all requests belong to the tenant `local`.
    path: Option<PathBuf>,
    defaults: TenantLimits,
    local: Grant,
    entries: RwLock<Arc<Entries>>,
    seen: Mutex<Option<Stamp>>,
}

impl Access {
    /// Reads the tokens file; without one, everyone is tenant `local` with the default limits.
    ///
    /// # Errors
    /// A file that cannot be read, has no entry, or has one that is wrong, with its line.
    pub fn open(path: Option<&Path>, defaults: TenantLimits) -> Result<Self, AccessError> {
        // Before reading, so that a concurrent change is noticed later.
        let seen = path.and_then(Stamp::of);
        let entries = path.map(|path| Entries::read(path, defaults)).transpose()?.unwrap_or_default();
        let tokens = Tokens {
            path: path.map(Path::to_owned),
            defaults,
            local: Grant {
                tenant: Arc::new(Tenant { name: LOCAL.to_owned(), priority: Priority::Normal, limits: defaults }),
                token: "".into(),
                scope: Scope::Write,
                revoked: CancellationToken::new(),
                expires: None,
            },
            entries: RwLock::new(Arc::new(entries)),
            seen: Mutex::new(seen),
        };
        Ok(Self { tokens: Arc::new(tokens), provider: None })
    }

    /// Also accepts the tokens of this OpenID Connect provider.
    ///
    /// # Errors
    /// An address that cannot be read, or that is not safe to send to.
    pub fn with_provider(self, trust: OidcSettings) -> Result<Self, AccessError> {
        let provider = Provider::new(trust).map_err(AccessError::Provider)?;
        Ok(Self { provider: Some(Arc::new(provider)), ..self })
    }

    /// Whether requests need a token.
    pub fn is_guarded(&self) -> bool {
        self.tokens.path.is_some() || self.provider.is_some()
    }

    /// Authenticates a request by the tokens file, then by the OpenID Connect provider.
    ///
    /// # Errors
    /// As [`Self::authenticate`], or why the provider's token was refused.
    pub async fn grant(&self, headers: &HeaderMap) -> Result<Grant, Denied> {
        match (self.authenticate(headers), &self.provider) {
            (Err(Denied::Unknown), Some(provider)) => {
                let verified = provider.verified(bearer(headers)?).await?;
                Ok(Grant {
                    tenant: self.tenant(&verified.tenant),
                    token: verified.name.into(),
                    scope: verified.scope,
                    revoked: CancellationToken::new(),
                    expires: Some(verified.expires),
                })
            }
            (known, _) => known,
        }
    }

    /// Authenticates a request by the tokens file.
    ///
    /// # Errors
    /// No token, a header that is not understood, or a token that is not in the file.
    pub fn authenticate(&self, headers: &HeaderMap) -> Result<Grant, Denied> {
        if !self.is_guarded() {
            return Ok(self.tokens.local.clone());
        }
        let token = bearer(headers)?;
        if !(MIN_TOKEN_BYTES..=MAX_TOKEN_BYTES).contains(&token.len()) {
            return Err(Denied::Unknown);
        }
        self.entries().find(&Sha256::digest(token).into()).ok_or(Denied::Unknown)
    }

    /// A tenant by name, for sessions resumed from disk: the most generous limits of its tokens, or the defaults.
    pub fn tenant(&self, name: &str) -> Arc<Tenant> {
        let of_tokens = self.entries().tenants().filter(|tenant| tenant.name == name).fold(None, |best, tenant| {
            let best: &Tenant = best.as_ref().unwrap_or(tenant);
            Some(Tenant {
                name: name.to_owned(),
                priority: best.priority.max(tenant.priority),
                limits: best.limits.most_generous(tenant.limits),
            })
        });
        let default = || Tenant { name: name.to_owned(), priority: Priority::Normal, limits: self.tokens.defaults };
        Arc::new(of_tokens.unwrap_or_else(default))
    }

    /// Reads the file again whenever it changes, until `stop`. A removed entry stops working within a second; a file that
    /// cannot be used or has no entry is logged, and the entries before stay.
    pub async fn watch(self, stop: CancellationToken) {
        if let Some(provider) = self.provider.clone() {
            let stop = stop.clone();
            tokio::spawn(provider.watch(stop));
        }
        let Some(path) = self.tokens.path.clone() else { return };
        while stop.run_until_cancelled(tokio::time::sleep(POLL_INTERVAL)).await.is_some() {
            let this = self.clone();
            let reloaded = tokio::task::spawn_blocking(move || this.reload_if_changed()).await;
            match reloaded {
                Ok(Ok(None)) => {}
                Ok(Ok(Some(count))) => tracing::info!(file = %path.display(), tokens = count, "tokens reloaded"),
                Ok(Err(error)) => tracing::error!(%error, "tokens not reloaded; the old ones stay valid"),
                Err(error) => tracing::error!(%error, "tokens not reloaded; the old ones stay valid"),
            }
        }
    }

    /// Reads the file if it has changed; returns the number of tokens if so.
    fn reload_if_changed(&self) -> Result<Option<usize>, AccessError> {
        let Some(path) = &self.tokens.path else { return Ok(None) };
        let stamp = Stamp::of(path);
        let has_changed = || *lock(&self.tokens.seen) != stamp;
        if !has_changed() {
            return Ok(None);
        }
        std::thread::sleep(SETTLED_FOR);
        if Stamp::of(path) != stamp {
            return Ok(None);
        }
        // Recorded even if the file is broken, so that it is reported once.
        *lock(&self.tokens.seen) = stamp;
        let mut entries = Entries::read(path, self.tokens.defaults)?;
        let count = entries.tenants().count();
        let before = self.entries();
        let revoked = entries.inherit_revocations(&before);
        *self.tokens.entries.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(entries);
        // Only after the old tokens are refused.
        for grant in revoked {
            tracing::info!(token = %grant.token, tenant = %grant.tenant.name, "a token was revoked; its requests in progress are ended");
            grant.revoked.cancel();
        }
        Ok(Some(count))
    }

    fn entries(&self) -> Arc<Entries> {
        Arc::clone(&self.tokens.entries.read().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The token of a request.
fn bearer(headers: &HeaderMap) -> Result<&str, Denied> {
    let mut values = headers.get_all(AUTHORIZATION).iter();
    let value = values.next().ok_or(Denied::Missing)?;
    if values.next().is_some() {
        return Err(Denied::Malformed);
    }
    let (scheme, token) = value.to_str().ok().and_then(|text| text.split_once(' ')).ok_or(Denied::Malformed)?;
    let token = token.trim_matches(' ');
    if !scheme.eq_ignore_ascii_case("bearer") || token.is_empty() {
        return Err(Denied::Malformed);
    }
    Ok(token)
}

impl std::fmt::Debug for Access {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Access")
            .field("path", &self.tokens.path)
            .field("entries", &self.entries())
            .finish_non_exhaustive()
    }
}
