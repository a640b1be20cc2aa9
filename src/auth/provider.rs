//! Access tokens of an OpenID Connect provider: JSON Web Tokens (RFC 7519, RFC 9068), checked against the provider's key set (RFC 7517).
//!
//! Taken are tokens that the provider signed for this service's audience and that have not expired. A claim names the tenant, and `scope`
//! (a text with spaces, or a list; `scp` as well) what may be done: `cager:read`, `cager:write` or `cager:admin`.

use super::file::is_name;
use super::signatures::{self, ALGORITHMS};
use super::{Denied, Scope};
use crate::outgoing::Client;
use crate::session::lock;
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

/// Longest token that is looked at, in bytes.
const MAX_TOKEN_BYTES: usize = 16 << 10;
/// Longest answer of the provider, in bytes.
const MAX_ANSWER_BYTES: usize = 1 << 20;
/// How often the keys are fetched, and how soon again where that failed.
const REFRESH_EVERY: Duration = Duration::from_secs(300);
const RETRY_AFTER: Duration = Duration::from_secs(10);
/// Shortest time from the end of a fetch to the next one for tokens with keys that are not known.
const UNKNOWN_KEY_EVERY: Duration = Duration::from_secs(5);
/// How long a request waits for a fetch.
const FETCHED_WITHIN: Duration = Duration::from_secs(2);
/// Longest name of a bearer in the log, in characters.
const NAME_CHARACTERS: usize = 64;

/// Which provider is trusted, and how its tokens are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trust {
    /// The provider: what its tokens have as `iss`.
    pub issuer: String,
    /// What tokens for this service have in `aud`.
    pub audience: String,
    /// Address of the key set; without one the provider's own description says it.
    pub keys: Option<String>,
    /// The claim that names the tenant.
    pub tenant: String,
}

/// What a token said.
pub(super) struct Claimed {
    pub(super) tenant: String,
    pub(super) name: String,
    pub(super) scope: Scope,
    /// When it expires.
    pub(super) expires: Instant,
}

/// A trusted provider with the keys that it has at the moment.
pub(super) struct Provider {
    trust: Trust,
    client: Client,
    keys: RwLock<Arc<Keys>>,
    fetching: Mutex<Fetching>,
}

/// One fetch at a time, which goes on whoever waits for it.
#[derive(Default)]
struct Fetching {
    /// Closed when the one that runs ends.
    runs: Option<watch::Receiver<()>>,
    ended: Option<Instant>,
    failed: bool,
}

type Keys = Option<Vec<Key>>;

struct Key {
    id: Option<String>,
    /// Where the key says so, the only algorithm it is for.
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
    pub(super) fn new(trust: Trust) -> Result<Self, String> {
        signatures::install();
        let client = Client::new().map_err(|error| error.to_string())?;
        for (setting, address) in [("oidc_issuer", Some(&trust.issuer)), ("oidc_keys", trust.keys.as_ref())] {
            if let Some(address) = address {
                crate::outgoing::address(address).map_err(|why| format!("{setting}: {why}"))?;
            }
        }
        Ok(Self { trust, client, keys: RwLock::default(), fetching: Mutex::default() })
    }

    /// Fetches the keys now and then, until `stop`.
    pub(super) async fn watch(self: Arc<Self>, stop: CancellationToken) {
        loop {
            if let Some(mut fetch) = self.fetch_unless_within(Duration::ZERO) {
                let _ = fetch.changed().await;
            }
            let wait = if lock(&self.fetching).failed { RETRY_AFTER } else { REFRESH_EVERY };
            if stop.run_until_cancelled(tokio::time::sleep(wait)).await.is_none() {
                return;
            }
        }
    }

    /// The fetch that runs, or one that is begun now; none where the last one ended within this time. It is over when the channel is closed.
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
                    tracing::error!(%why, "the keys of the tokens' provider cannot be fetched; those known stay");
                }
            }
            *lock(&provider.fetching) = Fetching { runs: None, ended: Some(Instant::now()), failed };
            drop(over);
        });
        Some(runs)
    }

    /// What a token says, if it is to be believed.
    pub(super) async fn claimed(self: &Arc<Self>, token: &str) -> Result<Claimed, Denied> {
        if token.len() > MAX_TOKEN_BYTES {
            return Err(Denied::Unknown);
        }
        let header = decode_header(token).map_err(|_| Denied::Unknown)?;
        // What `crit` names has to be understood (RFC 7515, §4.1.11), and nothing that can be named is.
        if !ALGORITHMS.contains(&header.alg) || header.crit.is_some() {
            return Err(Denied::Unknown);
        }
        let id = header.kid.as_deref();
        let mut keys = self.fitting(id, header.alg);
        if keys.as_ref().is_none_or(Vec::is_empty) && !self.has(id) {
            // The provider may have changed its keys since.
            if let Some(mut fetch) = self.fetch_unless_within(UNKNOWN_KEY_EVERY) {
                let _ = tokio::time::timeout(FETCHED_WITHIN, fetch.changed()).await;
            }
            keys = self.fitting(id, header.alg);
            let fetching = lock(&self.fetching);
            let recent = fetching.ended.is_some_and(|ended| ended.elapsed() < FETCHED_WITHIN);
            if keys.as_ref().is_none_or(Vec::is_empty) && (fetching.runs.is_some() || fetching.failed || !recent) {
                return Err(Denied::NoKeys);
            }
        }
        let mut denied = Denied::Unknown;
        for key in keys.unwrap_or_default() {
            match self.check(token, &key, header.alg) {
                // The signature is another key's; one of the others may fit.
                Err(Denied::Unknown) => {}
                Err(why) => denied = why,
                Ok(claimed) => return Ok(claimed),
            }
        }
        Err(denied)
    }

    /// Whether there is a key of this name.
    fn has(&self, id: Option<&str>) -> bool {
        let keys = Arc::clone(&self.keys.read().unwrap_or_else(PoisonError::into_inner));
        id.is_some() && keys.as_ref().as_ref().is_some_and(|keys| keys.iter().any(|key| key.id.as_deref() == id))
    }

    /// The keys that a token with such a header may be signed with; `None` before there were any.
    fn fitting(&self, id: Option<&str>, algorithm: Algorithm) -> Option<Vec<DecodingKey>> {
        let keys = Arc::clone(&self.keys.read().unwrap_or_else(PoisonError::into_inner));
        let fits = |key: &&Key| {
            (id.is_none() || key.id.as_deref() == id)
                && key.key.family() == algorithm.family()
                && key.algorithm.is_none_or(|only| only == algorithm)
        };
        Some(keys.as_ref().as_ref()?.iter().filter(fits).map(|key| key.key.clone()).collect())
    }

    fn check(&self, token: &str, key: &DecodingKey, algorithm: Algorithm) -> Result<Claimed, Denied> {
        let mut validation = Validation::new(algorithm);
        validation.set_required_spec_claims(&["exp", "iss", "aud"]);
        validation.set_issuer(&[&self.trust.issuer]);
        validation.set_audience(&[&self.trust.audience]);
        validation.validate_nbf = true;
        let claims = decode::<Map<String, Value>>(token, key, &validation).map_err(|error| match error.kind() {
            ErrorKind::ExpiredSignature => Denied::Expired,
            ErrorKind::MissingRequiredClaim(claim) if claim == "exp" => Denied::NoExpiry,
            ErrorKind::InvalidIssuer | ErrorKind::InvalidAudience | ErrorKind::MissingRequiredClaim(_) => {
                Denied::NotForUs
            }
            _ => Denied::Unknown,
        })?;
        let claims = claims.claims;
        let text = |name: &str| claims.get(name).and_then(Value::as_str);
        // Taken from a list, `iss` would be one of several.
        if text("iss") != Some(&self.trust.issuer) {
            return Err(Denied::NotForUs);
        }
        let tenant = text(&self.trust.tenant).filter(|name| is_name(name)).ok_or(Denied::NoTenant)?.to_owned();
        let scope = scope(&claims).ok_or(Denied::NoScope)?;
        let name = text("sub").or_else(|| text("client_id")).unwrap_or_default();
        let name = name.chars().filter(|c| !c.is_control()).take(NAME_CHARACTERS).collect();
        let expires = claims.get("exp").and_then(Value::as_f64).unwrap_or_default();
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
        let left = Duration::try_from_secs_f64(expires + validation.leeway as f64 - now).unwrap_or_default();
        // Centuries ahead is as good as never.
        let expires =
            Instant::now().checked_add(left.min(Duration::from_secs(u32::MAX.into()))).ok_or(Denied::Unknown)?;
        Ok(Claimed { tenant, name, scope, expires })
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
        // What is not understood is left out (RFC 7517, §5).
        Ok(set.keys.into_iter().filter_map(|jwk| key(&serde_json::from_value(jwk).ok()?)).collect())
    }

    async fn get<T: DeserializeOwned>(&self, address: &str) -> Result<T, String> {
        let url = crate::outgoing::address(address)?;
        let failed = |error: reqwest::Error| format!("{address}: {error}");
        let answer = self.client.get(&url).send().await.and_then(reqwest::Response::error_for_status);
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

/// A key of the set, if signatures can be checked with it.
fn key(jwk: &Jwk) -> Option<Key> {
    if jwk.common.public_key_use.as_ref().is_some_and(|purpose| *purpose != PublicKeyUse::Signature) {
        return None;
    }
    if jwk.common.key_operations.as_ref().is_some_and(|uses| !uses.contains(&KeyOperations::Verify)) {
        return None;
    }
    let algorithm = jwk.common.key_algorithm.map(|algorithm| algorithm.to_string().parse().ok());
    let key = DecodingKey::from_jwk(jwk).ok()?;
    // One that says its algorithm, and that is not known here.
    let algorithm = match algorithm {
        Some(None) => return None,
        Some(known) => known,
        None => None,
    };
    let usable = ALGORITHMS.iter().any(|algorithm| algorithm.family() == key.family());
    usable.then(|| Key { id: jwk.common.key_id.clone(), algorithm, key })
}

/// The widest of the scopes that a token has.
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
