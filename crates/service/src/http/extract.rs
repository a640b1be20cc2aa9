//! Extractors: the tenant, the tenant's session or job, validated queries and bodies.

use super::guarded::revocable;
use super::listen::ConnectionHandle;
use super::waiting::body_error;
use crate::auth::{Denied, Grant, Scope, Tenant};
use crate::jobs::{Job, Run, Work, kind_of};
use crate::problem::{self, ApiError};
use crate::resources::Resources;
use crate::service::Service;
use crate::session::Session;
use crate::store::Kind;
use axum::extract::rejection::{JsonRejection, QueryRejection};
use axum::extract::{FromRequestParts, Path, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use cager_proto::object::Object;
use http::request::Parts;
use http::{HeaderMap, header};
use std::convert::Infallible;
use std::sync::Arc;

/// The authenticated tenant. Rejects with 401 if the middleware did not run or found no valid token.
#[derive(Clone)]
pub(crate) struct Caller(pub(crate) Arc<Tenant>);

/// The name of the request's token; empty in a service without tokens.
#[derive(Clone)]
pub(super) struct TokenName(pub(super) Arc<str>);

/// Authenticates the request before anything else of it is processed.
pub(crate) async fn authenticate(
    State(service): State<Arc<Service>>,
    mut request: axum::extract::Request,
    next: Next,
) -> Response {
    let grant = match granted(&service, request.headers()).await {
        Ok(grant) => grant,
        Err(denied) => return denied.into_response(),
    };
    if grant.scope == Scope::Read && !only_reads(&request) {
        service.rejected("scope");
        let detail = "this token may look and decode, but change nothing; use one whose scope is write";
        return ApiError::new(problem::FORBIDDEN, detail).into_response();
    }
    if let Some(connection) = request.extensions().get::<ConnectionHandle>() {
        connection.caller_is_known();
    }
    request.extensions_mut().insert(Caller(Arc::clone(&grant.tenant)));
    request.extensions_mut().insert(TokenName(Arc::clone(&grant.token)));
    if !service.access.is_guarded() {
        return next.run(request).await;
    }
    let request = request.map(|body| revocable(body, &grant));
    let response = next.run(request).await;
    // Bodies in memory are sent completely; streams end when the token is revoked.
    match http_body::Body::size_hint(response.body()).exact() {
        Some(_) => response,
        None => response.map(|body| revocable(body, &grant)),
    }
}

/// Whether a request changes nothing: decoding does not, although it is a POST.
pub(super) fn only_reads(request: &axum::extract::Request) -> bool {
    request.method().is_safe() || request.uri().path().ends_with("/decode")
}

/// Authenticates the request and records tenant and token in the log.
pub(super) async fn granted(resources: &Resources, headers: &HeaderMap) -> Result<Grant, ApiError> {
    let grant = resources.access.grant(headers).await.map_err(|denied| {
        resources.rejected("unauthorized");
        match denied {
            Denied::NoKeys => ApiError::new(problem::BUSY, denied.to_string()).retry_after(5),
            denied => ApiError::new(problem::UNAUTHORIZED, denied.to_string()),
        }
    })?;
    tracing::Span::current().record("tenant", &*grant.tenant.name).record("token", &*grant.token);
    Ok(grant)
}

impl<S: Sync> FromRequestParts<S> for Caller {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiError> {
        let caller = parts.extensions.get::<Self>().cloned();
        caller.ok_or_else(|| ApiError::new(problem::UNAUTHORIZED, "send Authorization: Bearer and your token"))
    }
}

/// A resource that belongs to a tenant.
pub(crate) trait TenantResource: Send + Sync + Sized {
    const KIND: Kind;

    /// The tenant's resource with this id.
    fn find(service: &Service, tenant: &str, id: &str) -> Result<Arc<Self>, ApiError>;
}

impl TenantResource for Session {
    const KIND: Kind = Kind::Session;

    fn find(service: &Service, tenant: &str, id: &str) -> Result<Arc<Self>, ApiError> {
        service.registry.find(tenant, id)
    }
}

impl<W: Run> TenantResource for Job<W> {
    const KIND: Kind = kind_of::<W>();

    fn find(service: &Service, tenant: &str, id: &str) -> Result<Arc<Self>, ApiError> {
        W::jobs(service).find(tenant, id)
    }
}

/// The tenant's session or job named in the path. Rejects with 404 if it does not exist or belongs to another tenant.
pub(crate) struct Requested<T>(pub(crate) Arc<T>);

impl<T: TenantResource> FromRequestParts<Arc<Service>> for Requested<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, service: &Arc<Service>) -> Result<Self, ApiError> {
        let Caller(tenant) = Caller::from_request_parts(parts, service).await?;
        let id = Path::<String>::from_request_parts(parts, service).await;
        let missing = || ApiError::new(problem::NOT_FOUND, format!("the id of the {} is missing", T::KIND.name()));
        let Path(id) = id.map_err(|_| missing())?;
        T::find(service, &tenant.name, &id).map(Self)
    }
}

/// The tenant's session named in the path, with its frames loaded. Rejects as [`Requested`], and with 503 if its files cannot be read.
pub(crate) struct RequestedSession {
    pub(crate) tenant: Arc<Tenant>,
    pub(crate) session: Arc<Session>,
}

impl FromRequestParts<Arc<Service>> for RequestedSession {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, service: &Arc<Service>) -> Result<Self, ApiError> {
        let Caller(tenant) = Caller::from_request_parts(parts, service).await?;
        let Requested(session) = Requested::<Session>::from_request_parts(parts, service).await?;
        match session.ensure_loaded().await {
            // For a failed session the failure is all there is to know.
            Err(_) if session.has_failed() => {}
            loaded => loaded?,
        }
        Ok(Self { tenant, session })
    }
}

/// The tenant's job named in the path. Rejects as [`Requested`].
pub(crate) struct RequestedJob<W: Work> {
    pub(crate) tenant: Arc<Tenant>,
    pub(crate) job: Arc<Job<W>>,
}

impl<W: Run> FromRequestParts<Arc<Service>> for RequestedJob<W> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, service: &Arc<Service>) -> Result<Self, ApiError> {
        let Caller(tenant) = Caller::from_request_parts(parts, service).await?;
        let Requested(job) = Requested::<Job<W>>::from_request_parts(parts, service).await?;
        Ok(Self { tenant, job })
    }
}

/// A parsed query string. Rejects with 400.
pub(crate) struct Query<T>(pub(crate) T);

impl<S: Sync + Send, T: serde::de::DeserializeOwned> FromRequestParts<S> for Query<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match <axum::extract::Query<T> as FromRequestParts<S>>::from_request_parts(parts, state).await {
            Ok(axum::extract::Query(query)) => Ok(Self(query)),
            Err(QueryRejection::FailedToDeserializeQueryString(error)) => {
                Err(ApiError::new(problem::BAD_REQUEST, format!("query: {}", what_to_give(&error.body_text()))))
            }
            Err(other) => Err(ApiError::new(problem::BAD_REQUEST, format!("query: {other}"))),
        }
    }
}

/// What is wrong with a query, as a request to those who wrote it.
fn what_to_give(error: &str) -> String {
    let said = error.strip_prefix("Failed to deserialize query string: ").unwrap_or(error);
    let told = [
        ("invalid digit found in string", "give a whole number, 0 or more"),
        ("cannot parse integer from empty string", "give a whole number, 0 or more"),
        ("number too large to fit in target type", "give a smaller number"),
        ("provided string was not `true` or `false`", "give true or false"),
    ];
    told.iter().fold(said.to_owned(), |said, (was, is)| said.replace(was, is))
}

/// Most bytes of a JSON body: what the router's extractors take by default.
const JSON_BYTES: u64 = 2 << 20;

/// A JSON body. Rejects with 400, 413, 415 or 422.
pub(crate) struct Body<T>(pub(crate) T);

impl<S: Sync + Send, T: serde::de::DeserializeOwned> axum::extract::FromRequest<S> for Body<T> {
    type Rejection = ApiError;

    async fn from_request(request: axum::extract::Request, state: &S) -> Result<Self, ApiError> {
        let declared = http_body::Body::size_hint(request.body()).lower();
        if declared > JSON_BYTES {
            let detail = format!("the body has {declared} bytes, and a JSON body may have {JSON_BYTES}");
            return Err(ApiError::new(problem::TOO_LARGE, detail).limit(JSON_BYTES));
        }
        match <axum::Json<Object<T>> as axum::extract::FromRequest<S>>::from_request(request, state).await {
            Ok(axum::Json(Object(body))) => Ok(Self(body)),
            Err(JsonRejection::MissingJsonContentType(_)) => {
                Err(ApiError::new(problem::MEDIA_TYPE, "send the body as application/json"))
            }
            Err(JsonRejection::JsonDataError(error)) => {
                Err(ApiError::new(problem::INVALID_OPTIONS, format!("body: {}", error.body_text())))
            }
            Err(error) if error.status() == http::StatusCode::PAYLOAD_TOO_LARGE => {
                Err(ApiError::new(problem::TOO_LARGE, "the body is larger than a JSON body may be"))
            }
            Err(JsonRejection::BytesRejection(error)) => Err(body_error(&error)),
            Err(error) => Err(ApiError::new(problem::BAD_REQUEST, format!("body: {}", error.body_text()))),
        }
    }
}

/// The response format that the client prefers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Accept {
    /// Nothing in particular.
    Anything,
    Json,
    /// Frame records.
    Records,
    /// Newline-delimited JSON.
    Ndjson,
    Binary,
    /// No format that any route offers.
    Other,
}

impl Accept {
    /// The supported media type with the greatest weight (RFC 9110, §12.5.1); among equals the first.
    pub(crate) fn of(headers: &HeaderMap) -> Self {
        let Some(accept) = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok()) else {
            return Self::Anything;
        };
        let known = |part: &str| match part.split(';').next().unwrap_or_default().trim().to_ascii_lowercase().as_str() {
            "*/*" | "application/*" | "" => Some(Self::Anything),
            "application/json" => Some(Self::Json),
            cager_proto::record::MEDIA_TYPE => Some(Self::Records),
            "application/x-ndjson" | "application/ndjson" | "application/jsonl" => Some(Self::Ndjson),
            "application/octet-stream" => Some(Self::Binary),
            _ => None,
        };
        let mut best = (0.0, Self::Other);
        for part in accept.split(',') {
            if let Some(kind) = known(part)
                && weight(part) > best.0
            {
                best = (weight(part), kind);
            }
        }
        best.1
    }
}

/// The weight `q` of a media range; 1 if absent or malformed.
fn weight(part: &str) -> f32 {
    let weights =
        part.split(';').skip(1).filter_map(|parameter| parameter.trim().strip_prefix(['q', 'Q'])?.strip_prefix('='));
    weights.last().and_then(|q| q.trim().parse().ok()).filter(|q| (0.0..=1.0).contains(q)).unwrap_or(1.0)
}

impl<S: Sync> FromRequestParts<S> for Accept {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        Ok(Self::of(&parts.headers))
    }
}

/// Most characters of an idempotency key.
const KEY_CHARACTERS: usize = 255;

/// The value of `Idempotency-Key`.
///
/// # Errors
/// A key that is empty, too long or not ASCII.
pub(crate) fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    match headers.get("idempotency-key").map(|value| value.to_str()) {
        None => Ok(None),
        Some(Ok(key)) if (1..=KEY_CHARACTERS).contains(&key.len()) => Ok(Some(key.to_owned())),
        Some(_) => {
            let detail = format!("Idempotency-Key: give 1 to {KEY_CHARACTERS} visible ASCII characters");
            Err(ApiError::new(problem::BAD_REQUEST, detail))
        }
    }
}

/// The media type of a body in lower case, without parameters.
pub(crate) fn content_type(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_TYPE)?.to_str().ok()?;
    Some(value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_are_told_what_to_give() {
        assert_eq!(
            what_to_give("Failed to deserialize query string: first: invalid digit found in string"),
            "first: give a whole number, 0 or more"
        );
        assert_eq!(what_to_give("unknown field `x`"), "unknown field `x`");
    }

    #[test]
    fn the_greatest_weight_decides() {
        let of = |value: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::ACCEPT, http::HeaderValue::from_static(value));
            Accept::of(&headers)
        };
        assert_eq!(Accept::of(&HeaderMap::new()), Accept::Anything);
        assert_eq!(of("application/json"), Accept::Json);
        assert_eq!(of("application/json;q=0.4, application/octet-stream"), Accept::Binary);
        assert_eq!(of("application/octet-stream ; q=0.2, application/json; charset=utf-8 ;q=0.9"), Accept::Json);
        assert_eq!(of("application/json, application/octet-stream"), Accept::Json);
        assert_eq!(of("application/json;q=0, text/html"), Accept::Other);
        assert_eq!(of("text/html, */*;q=0.1"), Accept::Anything);
        assert_eq!(of("application/json;q=nonsense"), Accept::Json);
    }
}
