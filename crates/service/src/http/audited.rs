//! Requests that change something, for the audit file.

use super::extract::{Caller, TokenName, only_reads};
use crate::audit::{Audit, Change};
use crate::tasks::blocking;
use crate::telemetry::RequestId;
use axum::extract::{ConnectInfo, Request, State};
use axum::middleware::Next;
use axum::response::Response;
use http::{Method, header};
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::SystemTime;

/// Notes the request, after it has been answered, if it may change something.
pub(super) async fn audited(State(audit): State<Audit>, request: Request, next: Next) -> Response {
    if !audit.is_on() || only_reads(&request) {
        return next.run(request).await;
    }
    let mut noted = Noted {
        audit,
        peer: request.extensions().get::<ConnectInfo<SocketAddr>>().map(|peer| peer.0.ip()),
        tenant: request.extensions().get::<Caller>().map(|caller| caller.0.name.clone()),
        token: request.extensions().get::<TokenName>().map(|token| Arc::clone(&token.0)),
        id: request.extensions().get::<RequestId>().map(|id| id.0.to_string()),
        action: request.method().clone(),
        path: request.uri().path().to_owned(),
        made: None,
        status: None,
    };
    let response = next.run(request).await;
    let made = response.headers().get(header::LOCATION).and_then(|made| made.to_str().ok());
    noted.made = made.map(str::to_owned);
    noted.status = Some(response.status().as_u16());
    // It is there before the answer is.
    let _ = blocking(move || drop(noted)).await;
    response
}

/// A request that is noted when it is over, also where its client has not waited.
struct Noted {
    audit: Audit,
    peer: Option<IpAddr>,
    tenant: Option<String>,
    token: Option<Arc<str>>,
    id: Option<String>,
    action: Method,
    path: String,
    made: Option<String>,
    status: Option<u16>,
}

impl Drop for Noted {
    fn drop(&mut self) {
        self.audit.note(&Change {
            time: SystemTime::now(),
            tenant: self.tenant.as_deref(),
            token: self.token.as_deref().filter(|token| !token.is_empty()),
            peer: self.peer,
            action: self.action.as_str(),
            path: &self.path,
            made: self.made.as_deref(),
            status: self.status,
            request_id: self.id.as_deref(),
        });
    }
}
