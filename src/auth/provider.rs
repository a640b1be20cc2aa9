//! Access tokens of an OpenID Connect provider: JSON Web Tokens (RFC 7519, RFC 9068), checked against the provider's key set (RFC 7517).
//!
//! Taken are tokens that the provider signed for this service's audience and that have not expired. A claim names the tenant, and `scope`
//! (a text with spaces, or a list; `scp` as well) what may be done: `cager:read`, `cager:write` or `cager:admin`.

use super::file::is_name;
use super::signatures::{self, ALGORITHMS};
use super::{Denied, Scope};
use jsonwebtoken::errors::ErrorKind;
use jsonwebtoken::jwk::{Jwk, JwkSet, PublicKeyUse};
use jsonwebtoken::{Algorithm, DecodingKey, Validation, decode, decode_header};
use reqwest::{Client, Url};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant, SystemTime};
use tokio_util::sync::CancellationToken;

/// Longest token that is looked at, in bytes.
const MAX_TOKEN_BYTES: usize = 16 << 10;
/// Longest answer of the provider, in bytes.
const MAX_ANSWER_BYTES: usize = 1 << 20;
/// How often the keys are fetched, and how soon again where that failed.
const REFRESH_EVERY: Duration = Duration::from_secs(300);
const RETRY_AFTER: Duration = Duration::from_secs(10);
/// Shortest time between two fetches for tokens with keys that are not known.
const UNKNOWN_KEY_EVERY: Duration = Duration::from_secs(5);
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
    /// When they were last asked for; held while they are.
    fetching: tokio::sync::Mutex<Option<Instant>>,
}

type Keys = Option<Vec<Key>>;

struct Key {
    id: Option<String>,
    /// Where the key says so, the only algorithm it is for.
    algorithm: Option<Algorithm>,
    key: DecodingKey,
}

#[derive(Deserialize)]
struct Description {
    issuer: String,
    jwks_uri: String,
}

impl Provider {
    pub(super) fn new(trust: Trust) -> Result<Self, String> {
        signatures::install();
        let client = crate::outgoing::client().map_err(|error| error.to_string())?;
        for (setting, address) in [("oidc_issuer", Some(&trust.issuer)), ("oidc_keys", trust.keys.as_ref())] {
            if let Some(address) = address {
                crate::outgoing::address(address).map_err(|why| format!("{setting}: {why}"))?;
            }
        }
        Ok(Self { trust, client, keys: RwLock::default(), fetching: tokio::sync::Mutex::default() })
    }

    /// Fetches the keys now and then, until `stop`.
    pub(super) async fn watch(&self, stop: CancellationToken) {
        loop {
            let wait = match self.refresh(Duration::ZERO).await {
                Ok(()) => REFRESH_EVERY,
                Err(why) => {
                    tracing::error!(%why, "the keys of the tokens' provider cannot be fetched; those known stay");
                    RETRY_AFTER
                }
            };
            if stop.run_until_cancelled(tokio::time::sleep(wait)).await.is_none() {
                return;
            }
        }
    }

    /// What a token says, if it is to be believed.
    pub(super) async fn claimed(&self, token: &str) -> Result<Claimed, Denied> {
        if token.len() > MAX_TOKEN_BYTES {
            return Err(Denied::Unknown);
        }
        let header = decode_header(token).map_err(|_| Denied::Unknown)?;
        if !ALGORITHMS.contains(&header.alg) {
            return Err(Denied::Unknown);
        }
        let id = header.kid.as_deref();
        let mut keys = self.fitting(id, header.alg);
        if keys.as_ref().is_none_or(Vec::is_empty) {
            // The provider may have changed its keys since.
            let _ = self.refresh(UNKNOWN_KEY_EVERY).await;
            keys = self.fitting(id, header.alg);
        }
        let mut denied = if keys.is_some() { Denied::Unknown } else { Denied::NoKeys };
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
            ErrorKind::InvalidIssuer | ErrorKind::InvalidAudience | ErrorKind::MissingRequiredClaim(_) => {
                Denied::NotForUs
            }
            _ => Denied::Unknown,
        })?;
        let claims = claims.claims;
        let text = |name: &str| claims.get(name).and_then(Value::as_str);
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

    /// Fetches the keys, unless that was done within `within`.
    async fn refresh(&self, within: Duration) -> Result<(), String> {
        let mut asked = self.fetching.lock().await;
        if asked.is_some_and(|asked| asked.elapsed() < within) {
            return Ok(());
        }
        *asked = Some(Instant::now());
        let keys = self.fetch().await?;
        if keys.is_empty() {
            return Err("the key set has no key that signatures can be checked with".to_owned());
        }
        *self.keys.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(Some(keys));
        Ok(())
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
        let set: JwkSet = self.get(&address).await?;
        Ok(set.keys.iter().filter_map(key).collect())
    }

    async fn get<T: DeserializeOwned>(&self, address: &str) -> Result<T, String> {
        let url: Url = crate::outgoing::address(address)?;
        let failed = |error: reqwest::Error| format!("{address}: {error}");
        let answer = self.client.get(url).send().await.and_then(reqwest::Response::error_for_status);
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
