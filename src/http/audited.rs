//! Requests that change something, for the audit file.

use super::extract::{Caller, TokenName, only_reads};
use crate::audit::Change;
use crate::service::Service;
use crate::tasks::blocking;
use crate::telemetry::RequestId;
use axum::extract::{ConnectInfo, Request, State};
use axum::middleware::Next;
use axum::response::Response;
use http::header;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::SystemTime;

/// Notes the request, after it has been answered, if it may change something.
pub(super) async fn audited(State(service): State<Arc<Service>>, request: Request, next: Next) -> Response {
    if !service.audit.is_on() || only_reads(&request) {
        return next.run(request).await;
    }
    let peer = request.extensions().get::<ConnectInfo<SocketAddr>>().map(|peer| peer.0.ip());
    let tenant = request.extensions().get::<Caller>().map(|caller| caller.0.name.clone());
    let token = request.extensions().get::<TokenName>().map(|token| Arc::clone(&token.0));
    let id = request.extensions().get::<RequestId>().map(|id| id.0.to_string());
    let (action, path) = (request.method().clone(), request.uri().path().to_owned());
    let response = next.run(request).await;
    let made = response.headers().get(header::LOCATION).and_then(|made| made.to_str().ok()).map(str::to_owned);
    let (status, audit) = (response.status().as_u16(), service.audit.clone());
    // It is there before the answer is.
    let noted = blocking(move || {
        audit.note(&Change {
            time: SystemTime::now(),
            tenant: tenant.as_deref(),
            token: token.as_deref().filter(|token| !token.is_empty()),
            peer,
            action: action.as_str(),
            path: &path,
            made: made.as_deref(),
            status,
            request_id: id.as_deref(),
        });
    });
    let _ = noted.await;
    response
}
