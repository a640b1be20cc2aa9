//! Access tokens of an OpenID Connect provider: JSON Web Tokens (RFC 7519, RFC 9068), checked against the provider's key set (RFC 7517).
//!
//! A token is accepted if the provider signed it for this service's audience and it has not expired. A claim names the tenant, and `scope`
//! (a string separated by spaces, or a list; also `scp`) the permissions: `cager:read`, `cager:write` or `cager:admin`.

use super::file::is_name;
use super::signatures::{self, ALGORITHMS};
use super::{Denied, Scope};
use crate::http_client::Client;
use crate::sync::lock;
use jsonwebtoken::errors::ErrorKind;
use jsonwebtoken::jwk::{Jwk, KeyOperations, PublicKeyUse};
use jsonwebtoken::{Algorithm, DecodingKey, Validation, decode, decode_header};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::{Duration, Instant, SystemTime};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

/// Longest token accepted, in bytes.
const MAX_TOKEN_BYTES: usize = 16 << 10;
/// Longest response of the provider, in bytes.
const MAX_ANSWER_BYTES: usize = 1 << 20;
/// Interval between fetches of the key set, and the retry interval after a failure.
const REFRESH_INTERVAL: Duration = Duration::from_secs(300);
const RETRY_AFTER: Duration = Duration::from_secs(10);
/// Shortest interval between fetches caused by unknown keys.
const UNKNOWN_KEY_INTERVAL: Duration = Duration::from_secs(5);
/// How long a request waits for a fetch.
const FETCH_TIMEOUT: Duration = Duration::from_secs(2);
/// Longest token name in the log, in characters.
const NAME_CHARACTERS: usize = 64;

/// A trusted OpenID Connect provider, and how its tokens are interpreted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OidcSettings {
    /// The provider: what its tokens have as `iss`.
    pub issuer: String,
    /// What tokens for this service have in `aud`.
    pub audience: String,
    /// Address of the key set; by default taken from the provider's discovery document.
    pub keys: Option<String>,
    /// The claim that names the tenant.
    pub tenant: String,
}

/// The claims of a verified token.
pub(super) struct VerifiedClaims {
    pub(super) tenant: String,
    pub(super) name: String,
    pub(super) scope: Scope,
    /// When it expires.
    pub(super) expires: Instant,
}

/// A trusted provider with its current keys.
pub(super) struct Provider {
    trust: OidcSettings,
    client: Client,
    keys: RwLock<Arc<Keys>>,
    fetching: Mutex<Fetching>,
}

/// State of fetching the key set: one fetch at a time, shared by all who wait.
#[derive(Default)]
struct Fetching {
    /// Closed when the running fetch ends.
    runs: Option<watch::Receiver<()>>,
    ended: Option<Instant>,
    failed: bool,
}

type Keys = Option<Vec<Key>>;

struct Key {
    id: Option<String>,
    /// If the key restricts its use to one algorithm, that one.
    algorithm: Option<Algorithm>,
    key: DecodingKey,
}

#[derive(Deserialize)]
struct KeySet {
    keys: Vec<Value>,
}

#[derive(Deserialize)]
struct Description {
    issuer: String,
    jwks_uri: String,
}

impl Provider {
    pub(super) fn new(trust: OidcSettings) -> Result<Self, String> {
        signatures::install();
        let client = Client::new().map_err(|error| error.to_string())?;
        for (setting, address) in [("oidc_issuer", Some(&trust.issuer)), ("oidc_keys", trust.keys.as_ref())] {
            if let Some(address) = address {
                let url = crate::http_client::address(address).map_err(|why| format!("{setting}: {why}"))?;
                client.of(&url).map_err(|why| format!("{setting}: {why}"))?;
            }
        }
        Ok(Self { trust, client, keys: RwLock::default(), fetching: Mutex::default() })
    }

    /// Fetches the key set periodically until `stop`.
    pub(super) async fn watch(self: Arc<Self>, stop: CancellationToken) {
        loop {
            if let Some(mut fetch) = self.fetch_unless_within(Duration::ZERO) {
                let _ = fetch.changed().await;
            }
            let wait = if lock(&self.fetching).failed { RETRY_AFTER } else { REFRESH_INTERVAL };
            if stop.run_until_cancelled(tokio::time::sleep(wait)).await.is_none() {
                return;
            }
        }
    }

    /// The running fetch, or a new one; `None` if the last one ended within this time. The channel closes when the fetch ends.
    fn fetch_unless_within(self: &Arc<Self>, within: Duration) -> Option<watch::Receiver<()>> {
        let mut fetching = lock(&self.fetching);
        if let Some(runs) = &fetching.runs {
            return Some(runs.clone());
        }
        if fetching.ended.is_some_and(|ended| ended.elapsed() < within) {
            return None;
        }
        let (over, runs) = watch::channel(());
        fetching.runs = Some(runs.clone());
        drop(fetching);
        let provider = Arc::clone(self);
        tokio::spawn(async move {
            let fetched = match provider.fetch().await {
                Ok(keys) if keys.is_empty() => {
                    Err("the key set has no key that signatures can be checked with".to_owned())
                }
                fetched => fetched,
            };
            let failed = fetched.is_err();
            match fetched {
                Ok(keys) => *provider.keys.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(Some(keys)),
                Err(why) => {
                    tracing::error!(%why, "the key set of the OpenID Connect provider cannot be fetched; the known keys stay valid");
                }
            }
            *lock(&provider.fetching) = Fetching { runs: None, ended: Some(Instant::now()), failed };
            drop(over);
        });
        Some(runs)
    }

    /// Verifies a token and returns its claims.
    pub(super) async fn verified(self: &Arc<Self>, token: &str) -> Result<VerifiedClaims, Denied> {
        if token.len() > MAX_TOKEN_BYTES {
            return Err(Denied::Unknown);
        }
        let header = decode_header(token).map_err(|_| Denied::Unknown)?;
        // Critical header parameters must be understood (RFC 7515, §4.1.11); none are supported.
        if !ALGORITHMS.contains(&header.alg) || header.crit.is_some() {
            return Err(Denied::Unknown);
        }
        let id = header.kid.as_deref();
        let mut keys = self.candidate_keys(id, header.alg);
        if keys.as_ref().is_none_or(Vec::is_empty) && !self.has(id) {
            // The provider may have rotated its keys.
            if let Some(mut fetch) = self.fetch_unless_within(UNKNOWN_KEY_INTERVAL) {
                let _ = tokio::time::timeout(FETCH_TIMEOUT, fetch.changed()).await;
            }
            keys = self.candidate_keys(id, header.alg);
            let fetching = lock(&self.fetching);
            let recent = fetching.ended.is_some_and(|ended| ended.elapsed() < FETCH_TIMEOUT);
            if keys.as_ref().is_none_or(Vec::is_empty) && (fetching.runs.is_some() || fetching.failed || !recent) {
                return Err(Denied::NoKeys);
            }
        }
        let mut denied = Denied::Unknown;
        for key in keys.unwrap_or_default() {
            match self.check(token, &key, header.alg) {
                // Signed with another key; try the next.
                Err(Denied::Unknown) => {}
                Err(why) => denied = why,
                Ok(verified) => return Ok(verified),
            }
        }
        Err(denied)
    }

    /// Whether a key with this id is known.
    fn has(&self, id: Option<&str>) -> bool {
        let keys = Arc::clone(&self.keys.read().unwrap_or_else(PoisonError::into_inner));
        id.is_some() && keys.as_ref().as_ref().is_some_and(|keys| keys.iter().any(|key| key.id.as_deref() == id))
    }

    /// The known keys that fit a token's header; `None` before the first fetch.
    fn candidate_keys(&self, id: Option<&str>, algorithm: Algorithm) -> Option<Vec<DecodingKey>> {
        let keys = Arc::clone(&self.keys.read().unwrap_or_else(PoisonError::into_inner));
        let fits = |key: &&Key| {
            (id.is_none() || key.id.as_deref() == id)
                && key.key.family() == algorithm.family()
                && key.algorithm.is_none_or(|only| only == algorithm)
        };
        Some(keys.as_ref().as_ref()?.iter().filter(fits).map(|key| key.key.clone()).collect())
    }

    fn check(&self, token: &str, key: &DecodingKey, algorithm: Algorithm) -> Result<VerifiedClaims, Denied> {
        let mut validation = Validation::new(algorithm);
        validation.set_required_spec_claims(&["exp", "iss", "aud"]);
        validation.set_issuer(&[&self.trust.issuer]);
        validation.set_audience(&[&self.trust.audience]);
        validation.validate_nbf = true;
        let claims = decode::<Map<String, Value>>(token, key, &validation).map_err(|error| match error.kind() {
            ErrorKind::ExpiredSignature => Denied::Expired,
            ErrorKind::MissingRequiredClaim(claim) if claim == "exp" => Denied::NoExpiry,
            ErrorKind::InvalidIssuer | ErrorKind::InvalidAudience | ErrorKind::MissingRequiredClaim(_) => {
                Denied::WrongIssuerOrAudience
            }
            _ => Denied::Unknown,
        })?;
        let claims = claims.claims;
        let text = |name: &str| claims.get(name).and_then(Value::as_str);
        // The validation would accept a list of issuers.
        if text("iss") != Some(&self.trust.issuer) {
            return Err(Denied::WrongIssuerOrAudience);
        }
        let tenant = text(&self.trust.tenant).filter(|name| is_name(name)).ok_or(Denied::NoTenant)?.to_owned();
        let scope = scope(&claims).ok_or(Denied::NoScope)?;
        let name = text("sub").or_else(|| text("client_id")).unwrap_or_default();
        let name = name.chars().filter(|c| !c.is_control()).take(NAME_CHARACTERS).collect();
        let expires = claims.get("exp").and_then(Value::as_f64).unwrap_or_default();
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
        let left = Duration::try_from_secs_f64(expires + validation.leeway as f64 - now).unwrap_or_default();
        // Bounds expiry times that are centuries away.
        let expires =
            Instant::now().checked_add(left.min(Duration::from_secs(u32::MAX.into()))).ok_or(Denied::Unknown)?;
        Ok(VerifiedClaims { tenant, name, scope, expires })
    }

    async fn fetch(&self) -> Result<Vec<Key>, String> {
        let address = match &self.trust.keys {
            Some(address) => address.clone(),
            None => {
                let issuer = &self.trust.issuer;
                let address = format!("{}/.well-known/openid-configuration", issuer.trim_end_matches('/'));
                let description: Description = self.get(&address).await?;
                if description.issuer != *issuer {
                    return Err(format!("{address} describes {:?}, and oidc_issuer is {issuer:?}", description.issuer));
                }
                description.jwks_uri
            }
        };
        let set: KeySet = self.get(&address).await?;
        // Keys that cannot be parsed are ignored (RFC 7517, §5).
        Ok(set.keys.into_iter().filter_map(|jwk| key(&serde_json::from_value(jwk).ok()?)).collect())
    }

    async fn get<T: DeserializeOwned>(&self, address: &str) -> Result<T, String> {
        let url = crate::http_client::address(address)?;
        let failed = |error: reqwest::Error| format!("{address}: {error}");
        let request = self.client.get(&url).map_err(|why| format!("{address}: {why}"))?;
        let answer = request.send().await.and_then(reqwest::Response::error_for_status);
        let mut answer = answer.map_err(failed)?;
        let mut bytes = Vec::new();
        while let Some(chunk) = answer.chunk().await.map_err(failed)? {
            if bytes.len() + chunk.len() > MAX_ANSWER_BYTES {
                return Err(format!("{address}: answers with more than {MAX_ANSWER_BYTES} bytes"));
            }
            bytes.extend_from_slice(&chunk);
        }
        serde_json::from_slice(&bytes).map_err(|error| format!("{address}: {error}"))
    }
}

/// A key of the set, if it can verify signatures.
fn key(jwk: &Jwk) -> Option<Key> {
    if jwk.common.public_key_use.as_ref().is_some_and(|purpose| *purpose != PublicKeyUse::Signature) {
        return None;
    }
    if jwk.common.key_operations.as_ref().is_some_and(|uses| !uses.contains(&KeyOperations::Verify)) {
        return None;
    }
    let algorithm = jwk.common.key_algorithm.map(|algorithm| algorithm.to_string().parse().ok());
    let key = DecodingKey::from_jwk(jwk).ok()?;
    // An unknown algorithm excludes the key.
    let algorithm = match algorithm {
        Some(None) => return None,
        Some(known) => known,
        None => None,
    };
    let usable = ALGORITHMS.iter().any(|algorithm| algorithm.family() == key.family());
    usable.then(|| Key { id: jwk.common.key_id.clone(), algorithm, key })
}

/// The most powerful scope of a token.
fn scope(claims: &Map<String, Value>) -> Option<Scope> {
    let words = ["scope", "scp"].into_iter().filter_map(|name| claims.get(name)).flat_map(|value| match value {
        Value::String(text) => text.split(' ').collect::<Vec<_>>(),
        Value::Array(items) => items.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    });
    words
        .filter_map(|word| match word {
            "cager:read" => Some(Scope::Read),
            "cager:write" => Some(Scope::Write),
            "cager:admin" => Some(Scope::Admin),
            _ => None,
        })
        .max()
}
