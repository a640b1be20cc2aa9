//! Protection against requests from other web pages, and CORS.
//!
//! A service without tokens trusts every client that reaches it, and a browser reaches it for any page. Pages of other sites are recognised
//! by `Origin`, and DNS rebinding by `Host`.

use crate::config::ServeConfig;
use crate::problem::{self, ApiError};
use axum::extract::Request;
use http::{HeaderName, HeaderValue, Method, header};
use std::net::IpAddr;
use std::time::Duration;
use tower_http::cors::CorsLayer;

/// Refuses requests that a browser sends for a page of another site.
///
/// # Errors
/// 403, which says how to allow it.
pub(super) fn check(request: &Request, config: &ServeConfig) -> Result<(), ApiError> {
    let host = host_of(request);
    if !is_known(host, &config.allowed_hosts) {
        let detail =
            format!("the service is not known as {host:?}; ask for localhost, or add the name to allowed_hosts");
        return Err(ApiError::new(problem::FORBIDDEN, detail));
    }
    match text(request, header::ORIGIN) {
        Some(origin) if !is_same(origin, host) && !config.allowed_origins.iter().any(|allowed| allowed == origin) => {
            let detail = format!("pages of {origin} may not use this service; add the origin to allowed_origins");
            Err(ApiError::new(problem::FORBIDDEN, detail))
        }
        _ => Ok(()),
    }
}

/// Whether `Host` is `localhost` or an IP address.
pub(super) fn is_this_machine(request: &Request) -> bool {
    is_known(host_of(request), &[])
}

/// Whether a request asks for health, which everybody may.
pub(super) fn is_probe(request: &Request) -> bool {
    matches!(request.uri().path(), "/healthz" | "/readyz")
}

fn text(request: &Request, name: HeaderName) -> Option<&str> {
    request.headers().get(name).and_then(|value| value.to_str().ok())
}

fn host_of(request: &Request) -> &str {
    // In HTTP/2 the host is part of the URI.
    let authority = request.uri().authority().map(http::uri::Authority::as_str);
    authority.or_else(|| text(request, header::HOST)).unwrap_or_default()
}

/// Whether a host is `localhost`, an IP address, or allowed.
fn is_known(host: &str, allowed: &[String]) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok()
        || allowed.iter().any(|known| known.eq_ignore_ascii_case(name) || known.eq_ignore_ascii_case(host))
}

/// Whether the origin is that of the service itself.
fn is_same(origin: &str, host: &str) -> bool {
    origin.split_once("://").is_some_and(|(_, of)| of.eq_ignore_ascii_case(host))
}

/// CORS headers for the allowed origins; `None` if there are no allowed origins.
pub(super) fn cors(config: &ServeConfig) -> Option<CorsLayer> {
    let origins: Vec<HeaderValue> = config.allowed_origins.iter().filter_map(|origin| origin.parse().ok()).collect();
    let name = HeaderName::from_static;
    let asked = [
        header::ACCEPT,
        header::AUTHORIZATION,
        header::CONTENT_ENCODING,
        header::CONTENT_TYPE,
        header::IF_NONE_MATCH,
        header::IF_RANGE,
        header::RANGE,
        name("idempotency-key"),
        name("last-event-id"),
        name("x-request-id"),
    ];
    let shown = [
        header::CONTENT_DISPOSITION,
        header::CONTENT_RANGE,
        header::ETAG,
        header::LOCATION,
        header::RETRY_AFTER,
        header::WWW_AUTHENTICATE,
        name("cager-bound"),
        name("cager-columns"),
        name("cager-faces"),
        name("cager-frames"),
        name("cager-outside"),
        name("cager-rows"),
        name("cager-vertices"),
        name("x-request-id"),
    ];
    let methods = [Method::GET, Method::HEAD, Method::POST, Method::PATCH, Method::DELETE];
    let layer = CorsLayer::new().allow_methods(methods).allow_headers(asked).expose_headers(shown);
    (!origins.is_empty()).then(|| layer.allow_origin(origins).max_age(Duration::from_secs(3600)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed(host: &str, origin: Option<&str>, config: &ServeConfig) -> bool {
        let mut request = http::Request::builder().uri("/v1/sessions").header(header::HOST, host);
        if let Some(origin) = origin {
            request = request.header(header::ORIGIN, origin);
        }
        check(&request.body(axum::body::Body::empty()).unwrap(), config).is_ok()
    }

    #[test]
    fn other_pages_and_other_names_are_refused() {
        let usual = ServeConfig::default();
        for host in ["localhost", "localhost:8080", "LOCALHOST:1", "127.0.0.1:8080", "[::1]:8080", "10.0.0.7"] {
            assert!(allowed(host, None, &usual), "{host}");
            assert!(allowed(host, Some(&format!("http://{host}")), &usual), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example:8080", "", "[::1", "127.0.0.1.evil.example"] {
            assert_eq!(allowed(host, None, &usual), host == "[::1", "{host}");
        }
        for origin in ["http://evil.example", "null", "http://localhost:9", "https://localhost:8080.evil.example"] {
            assert!(!allowed("localhost:8080", Some(origin), &usual), "{origin}");
        }
        let open = ServeConfig {
            allowed_hosts: vec!["farm.studio".to_owned()],
            allowed_origins: vec!["https://tools.studio".to_owned()],
            ..ServeConfig::default()
        };
        assert!(allowed("farm.studio:443", Some("https://tools.studio"), &open));
        assert!(!allowed("farm.studio", Some("https://other.studio"), &open));
    }
}
