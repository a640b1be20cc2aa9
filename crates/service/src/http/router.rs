//! All routes of the service, and their middleware.

use super::audited::audited;
use super::content_encoding::decoded;
use super::extract::Caller;
use super::guarded::with_permit;
use super::respond::PROBLEM_JSON;
use super::{
    cage, cage_jobs, cages, capture_files, container, coordinates, decode, errors, events, exported, extract, frames,
    health, job_list, methods, openapi, origin, page, recoveries, sent, sessions, shape_spaces, transfers,
};
use crate::problem::{self, ApiError, ProblemKind};
use crate::service::Service;
use crate::telemetry::{RequestId, request_id, traces};
use axum::error_handling::HandleErrorLayer;
use axum::extract::{DefaultBodyLimit, MatchedPath, Request, State};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{BoxError, Router};
use cager_proto::messages::Problem;
use http::{Extensions, HeaderMap, HeaderValue, Method, StatusCode, Version, header};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tower::timeout::TimeoutLayer;
use tower::{ServiceBuilder, timeout};
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes that answer quickly.
fn quick() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new()
        .routes(routes!(sessions::list))
        .routes(routes!(sessions::get, sessions::rename, sessions::delete))
        .routes(routes!(coordinates::handles))
        .routes(routes!(coordinates::get))
        .routes(routes!(cage::get))
        .routes(routes!(errors::get))
        .routes(routes!(sent::get))
        .routes(routes!(events::get))
        .routes(routes!(cages::get))
        .routes(routes!(container::get))
        .routes(routes!(job_list::list))
        .routes(routes!(cage_jobs::jobs::list))
        .routes(routes!(cage_jobs::jobs::get, cage_jobs::jobs::delete))
        .routes(routes!(cage_jobs::events::get))
        .routes(routes!(cage_jobs::cage_obj::get))
        .routes(routes!(recoveries::jobs::list))
        .routes(routes!(recoveries::jobs::get, recoveries::jobs::delete))
        .routes(routes!(recoveries::jobs::complete))
        .routes(routes!(recoveries::events::get))
        .routes(routes!(recoveries::cages::get))
        .routes(routes!(recoveries::results::container))
        .routes(routes!(recoveries::results::report))
        .routes(routes!(recoveries::results::joints_csv))
        .routes(routes!(recoveries::results::joints_bvh))
        .routes(routes!(transfers::jobs::list))
        .routes(routes!(transfers::jobs::get, transfers::jobs::delete))
        .routes(routes!(transfers::jobs::events))
        .routes(routes!(transfers::results::frames))
        .routes(routes!(transfers::results::container))
        .routes(routes!(transfers::results::report))
        .routes(routes!(shape_spaces::list))
        .routes(routes!(shape_spaces::get, shape_spaces::delete))
        .routes(routes!(shape_spaces::pose))
}

/// Routes that take as long as their work.
fn completing() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new()
        .routes(routes!(sessions::complete))
        .routes(routes!(exported::get))
        .routes(routes!(capture_files::abc))
        .routes(routes!(capture_files::glb))
        .routes(routes!(capture_files::usdc))
}

/// Routes that stream their request bodies.
fn streaming() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new()
        .routes(routes!(sessions::create))
        .routes(routes!(frames::post))
        .routes(routes!(decode::post))
        .routes(routes!(cage_jobs::create::create))
        .routes(routes!(recoveries::create::create))
        .routes(routes!(recoveries::frames::post))
        .routes(routes!(transfers::create::create))
        .routes(routes!(shape_spaces::create))
}

/// Routes without authentication and limits, for probes.
fn probes() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new().routes(routes!(health::live)).routes(routes!(health::ready))
}

/// Routes outside all limits.
fn open() -> OpenApiRouter<Arc<Service>> {
    probes().routes(routes!(health::metrics))
}

/// The page and the OpenAPI document.
fn described() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new().routes(routes!(page::page)).routes(routes!(openapi::get))
}

/// Files that the page loads.
fn page_files() -> Router<Arc<Service>> {
    Router::new()
        .route("/assets/{name}", get(page::asset))
        .route(&format!("/{}", page::COMPONENT), get(page::component))
}

/// The OpenAPI document of all routes.
pub fn document() -> serde_json::Value {
    let routes = quick().merge(completing()).merge(streaming()).merge(open()).merge(described());
    openapi::finished(OpenApiRouter::with_openapi(openapi::Document::openapi()).merge(routes).to_openapi())
}

/// The service's routes.
pub fn router(service: Arc<Service>) -> Router {
    let request_timeout = Duration::from_secs(service.config.request_timeout_s);
    let in_time = ServiceBuilder::new()
        .layer(HandleErrorLayer::new(async |error: BoxError| refused(&error)))
        .layer(TimeoutLayer::new(request_timeout));
    let guarded = Router::from(quick())
        .layer(in_time)
        .merge(Router::from(completing()))
        .layer(from_fn_with_state(Arc::clone(&service), limit_requests))
        // Limited by memory and by the tenant's streams instead, so that slow bodies do not occupy the request slots that all tenants
        // share.
        .merge(Router::from(streaming()).layer(DefaultBodyLimit::disable()))
        .route_layer(from_fn_with_state(service.audit.clone(), audited))
        .route_layer(from_fn_with_state(Arc::clone(&service), extract::authenticate));
    let cors = origin::cors(&service.config);
    let routes = Router::from(open())
        .merge(guarded)
        .merge(Router::from(described()).merge(page_files()))
        .fallback(|| async { ApiError::new(problem::NOT_FOUND, "the routes are listed in /openapi.json") })
        .layer(from_fn_with_state(Arc::clone(&service), check_host_and_origin))
        .with_state(service);
    let routes = finished(routes);
    match cors {
        Some(cors) => routes.layer(cors),
        None => routes,
    }
}

/// Adds the middleware common to all routes: request ids, logging, problem details and content codings.
pub(super) fn finished(routes: Router) -> Router {
    routes
        .layer(CatchPanicLayer::custom(|panic: Box<dyn std::any::Any + Send>| {
            let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
            ApiError::internal(&format!("a request panicked: {text}")).into_response()
        }))
        .layer(from_fn(host))
        .layer(from_fn(without_range))
        .layer(from_fn(decoded))
        .layer(from_fn(finish))
        .layer(CompressionLayer::new().compress_when(is_worth_compressing))
        .layer(from_fn(request_id))
}

/// Health and metrics of a service, for the public listener.
pub fn seen(service: Arc<Service>) -> Router {
    Router::from(open()).with_state(service)
}

/// Health and metrics of a service, for operators.
pub fn seen_by_operators(service: Arc<Service>) -> Router {
    let metrics = |State(service): State<Arc<Service>>| async move { health::rendered_metrics(&service) };
    Router::from(probes()).route("/metrics", get(metrics)).with_state(service)
}

/// The router for connections beyond the limit: health and metrics, as `seen` has them, and 503 for everything else.
pub fn spare(seen: Router) -> Router {
    seen.fallback(|| async {
        metrics::counter!("cager_rejections_total", "reason" => "connections").increment(1);
        ApiError::new(problem::BUSY, "too many connections are open; try again in a moment").retry_after(2)
    })
    .layer(from_fn(finish))
    .layer(from_fn(request_id))
}

/// Without tokens, checks `Host` and `Origin`, except for probes.
async fn check_host_and_origin(
    State(service): State<Arc<Service>>,
    request: Request,
    next: Next,
) -> Result<Response, ApiError> {
    if !service.access.is_guarded() && !origin::is_probe(&request) {
        origin::check(&request, &service.config).inspect_err(|_| service.rejected("origin"))?;
    }
    Ok(next.run(request).await)
}

/// Whether to compress a response: text of 1 KiB or more. Binary numbers compress badly and are requested by range.
fn is_worth_compressing(_: StatusCode, _: Version, headers: &HeaderMap, _: &Extensions) -> bool {
    const MIN_BYTES: u64 = 1024;
    let text = |name| headers.get(name).and_then(|value: &HeaderValue| value.to_str().ok());
    let media_type = text(header::CONTENT_TYPE).and_then(|value| value.split(';').next()).unwrap_or_default();
    matches!(media_type, "application/json" | "text/html" | "text/javascript" | "text/css" | "image/svg+xml")
        && text(header::CONTENT_LENGTH)
            .and_then(|length| length.parse().ok())
            .is_none_or(|length: u64| length >= MIN_BYTES)
}

/// Takes a request permit until the response is complete; a large response keeps it until it is sent.
async fn limit_requests(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    request: Request,
    next: Next,
) -> Result<Response, ApiError> {
    let place = service.requests.try_take(&tenant.name, 1).map_err(|full| {
        service.rejected("requests");
        full.refusal("requests at a time").retry_after(1)
    })?;
    Ok(next.run(request).await.map(|body| with_permit(body, place)))
}

/// The response for an error of a middleware layer.
fn refused(error: &BoxError) -> ApiError {
    if error.is::<timeout::error::Elapsed>() {
        metrics::counter!("cager_rejections_total", "reason" => "timeout").increment(1);
        return ApiError::new(problem::BUSY, "the request took too long; try again later").retry_after(5);
    }
    ApiError::internal(error)
}

/// HTTP/1.1 requires exactly one `Host` header (RFC 9112, §3.2).
async fn host(request: Request, next: Next) -> Response {
    let named = request.headers().get_all(header::HOST).iter().count();
    if request.version() == Version::HTTP_11 && named != 1 {
        let detail = format!("the request has {named} Host headers; HTTP/1.1 wants one");
        return ApiError::new(problem::BAD_REQUEST, detail).into_response();
    }
    next.run(request).await
}

/// Ranges are of GET alone (RFC 9110, §14.2).
async fn without_range(mut request: Request, next: Next) -> Response {
    if request.method() == Method::HEAD {
        request.headers_mut().remove(header::RANGE);
    }
    next.run(request).await
}

/// Converts every error into problem details with the request id, and counts the request.
async fn finish(request: Request, next: Next) -> Response {
    let clock = Instant::now();
    let id = request.extensions().get::<RequestId>().cloned();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().map(|path| path.as_str().to_owned());
    let mut response = next.run(request).await;
    let status = response.status();
    let route = response.extensions().get::<MatchedPath>().map(|p| p.as_str().to_owned()).or(route);
    traces::name(method.as_str(), route.as_deref().unwrap_or("other"));
    metrics::counter!("cager_requests_total", "status" => status.as_u16().to_string()).increment(1);
    metrics::histogram!("cager_request_seconds", "route" => route.clone().unwrap_or_else(|| "other".to_owned()))
        .record(clock.elapsed().as_secs_f64());
    if status.is_client_error() || status.is_server_error() {
        let mut error = match response.extensions_mut().remove::<ApiError>() {
            Some(error) => error,
            None if is_problem(&response) => return response,
            None if status == StatusCode::METHOD_NOT_ALLOWED => {
                ApiError::new(kind_of(status), methods::refusal(route.as_deref()))
            }
            None => ApiError::new(kind_of(status), status.canonical_reason().unwrap_or("error").to_owned()),
        };
        let kind = &error.problem.kind;
        tracing::Span::current().record("problem", kind.strip_prefix(Problem::TYPE_PREFIX).unwrap_or(kind));
        error.problem.request_id = id.map(|id| id.0.to_string());
        let kept = [header::ALLOW, header::CONTENT_RANGE].map(|name| (response.headers_mut().remove(&name), name));
        let mut problem = error.into_response();
        problem.extensions_mut().remove::<ApiError>();
        for (value, name) in kept {
            if let Some(value) = value {
                problem.headers_mut().insert(name, value);
            }
        }
        return problem;
    }
    response
}

fn is_problem(response: &Response) -> bool {
    response.headers().get(header::CONTENT_TYPE).is_some_and(|value| value == PROBLEM_JSON)
}

/// The problem kind of an error response that did not come from a handler.
fn kind_of(status: StatusCode) -> ProblemKind {
    match status {
        StatusCode::METHOD_NOT_ALLOWED => problem::METHOD_NOT_ALLOWED,
        StatusCode::NOT_FOUND => problem::NOT_FOUND,
        StatusCode::PAYLOAD_TOO_LARGE => problem::TOO_LARGE,
        StatusCode::UNSUPPORTED_MEDIA_TYPE => problem::MEDIA_TYPE,
        StatusCode::REQUEST_TIMEOUT => problem::REQUEST_TIMEOUT,
        status if status.is_client_error() => problem::BAD_REQUEST,
        _ => problem::INTERNAL,
    }
}
