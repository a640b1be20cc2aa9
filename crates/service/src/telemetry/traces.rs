//! Traces in OpenTelemetry's form: a span for each request, with what it makes the service compute below it. Sent by OTLP over HTTP where
//! the environment names a collector, `OTEL_EXPORTER_OTLP_ENDPOINT`; headers, sampler, service name and resource attributes are taken from
//! the variables of that standard as well. Without a collector nothing is recorded.

use crate::http_client::Client;
use async_trait::async_trait;
use axum::extract::Request;
use bytes::Bytes;
use http::StatusCode;
use opentelemetry::propagation::TextMapPropagator as _;
use opentelemetry::trace::{SpanKind, Status, TraceContextExt as _, Tracer as _};
use opentelemetry::{Context, KeyValue, global};
use opentelemetry_http::{HeaderExtractor, HttpClient, HttpError};
use opentelemetry_otlp::{SpanExporter, WithHttpConfig as _};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::SdkTracerProvider;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use tokio::runtime::Handle;

const COLLECTORS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];
const SCOPE: &str = "cager";
const PROTOCOL: &str = "http/protobuf";

static PROVIDER: OnceLock<SdkTracerProvider> = OnceLock::new();

/// Begins to send spans, if the environment says where to. Within a tokio runtime, once per process.
///
/// # Errors
/// What the environment says cannot be followed.
pub fn begin() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let Some(name) = COLLECTORS.into_iter().find(|name| variable(name).is_some()) else { return Ok(()) };
    let disabled = variable("OTEL_SDK_DISABLED").is_some_and(|value| value.eq_ignore_ascii_case("true"));
    if disabled || variable("OTEL_TRACES_EXPORTER").is_some_and(|value| value == "none") {
        return Ok(());
    }
    let protocol = variable("OTEL_EXPORTER_OTLP_TRACES_PROTOCOL").or_else(|| variable("OTEL_EXPORTER_OTLP_PROTOCOL"));
    if let Some(protocol) = protocol.filter(|protocol| protocol != PROTOCOL) {
        tracing::warn!(%protocol, "traces are sent as {PROTOCOL}, the only protocol that this program has");
    }
    let client = Client::new()?;
    if let Some(Ok(collector)) = variable(name).map(|address| address.parse()) {
        client.of(&collector).map_err(|error| format!("{name}: {error}"))?;
    }
    let sender = Sender { client, runtime: Handle::current(), failing: Arc::default() };
    let exporter = SpanExporter::builder().with_http().with_http_client(sender).build();
    let exporter = exporter.map_err(|error| format!("{name}: {error}"))?;
    let mut resource = Resource::builder().with_attribute(KeyValue::new("service.version", env!("CARGO_PKG_VERSION")));
    let attributes = variable("OTEL_RESOURCE_ATTRIBUTES").unwrap_or_default();
    if variable("OTEL_SERVICE_NAME").is_none() && !attributes.contains("service.name=") {
        resource = resource.with_service_name(SCOPE);
    }
    let provider = SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource.build()).build();
    global::set_tracer_provider(provider.clone());
    let _ = PROVIDER.set(provider);
    tracing::info!(by = name, "traces are sent");
    Ok(())
}

/// Exports the remaining spans. Blocks for a few seconds at most.
pub fn end() {
    if let Some(provider) = PROVIDER.get()
        && let Err(error) = provider.shutdown()
    {
        tracing::warn!(%error, "the last traces could not be sent");
    }
}

fn is_enabled() -> bool {
    PROVIDER.get().is_some()
}

/// HTTP client for the exporter, whose thread has no tokio runtime.
#[derive(Debug)]
struct Sender {
    client: Client,
    runtime: Handle,
    /// Whether the last attempt failed, so that only changes are logged.
    failing: Arc<AtomicBool>,
}

#[async_trait]
impl HttpClient for Sender {
    async fn send_bytes(&self, request: Request<Bytes>) -> Result<http::Response<Bytes>, HttpError> {
        let client = self.client.clone();
        let sent = self.runtime.spawn(async move {
            let request: reqwest::Request = request.try_into()?;
            let answer = client.of(request.url())?.execute(request).await?;
            let mut response = http::Response::new(Bytes::new());
            *response.status_mut() = answer.status();
            *response.headers_mut() = answer.headers().clone();
            Ok::<_, HttpError>(response)
        });
        let sent = sent.await?;
        let why = match &sent {
            Ok(response) if response.status().is_success() => None,
            Ok(response) => Some(format!("the collector answered {}", response.status())),
            Err(error) => Some(error.to_string()),
        };
        match (&why, self.failing.swap(why.is_some(), Relaxed)) {
            (Some(why), false) => tracing::warn!(why, "traces cannot be sent"),
            (None, true) => tracing::info!("traces are sent again"),
            _ => {}
        }
        Ok(sent?)
    }
}

/// The span of a request; a child of the client's span if `traceparent` names it.
pub(super) fn request(request: &Request) -> Context {
    if !is_enabled() {
        return Context::new();
    }
    let parent = TraceContextPropagator::new().extract(&HeaderExtractor(request.headers()));
    let method = request.method().as_str().to_owned();
    let span = global::tracer(SCOPE).span_builder(method.clone()).with_kind(SpanKind::Server);
    let span = span.with_attributes([KeyValue::new("http.request.method", method)]);
    let span = span.start_with_context(&global::tracer(SCOPE), &parent);
    parent.with_span(span)
}

/// The trace id of a request, if it is recorded.
pub(super) fn trace_id(request: &Context) -> Option<String> {
    let span = request.span();
    span.is_recording().then(|| span.span_context().trace_id().to_string())
}

/// Names the current request's span after its route.
pub(crate) fn name(method: &str, route: &str) {
    if is_enabled() {
        let context = Context::current();
        context.span().update_name(format!("{method} {route}"));
        context.span().set_attribute(KeyValue::new("http.route", route.to_owned()));
    }
}

/// Ends the span of a request; `None` if the client disconnected before the response.
pub(super) fn ended(request: &Context, status: Option<StatusCode>) {
    let span = request.span();
    if let Some(status) = status {
        span.set_attribute(KeyValue::new("http.response.status_code", i64::from(status.as_u16())));
        if status.is_server_error() {
            span.set_status(Status::error(status.to_string()));
        }
    }
    span.end();
}

/// A child span of `parent` that ends when it is dropped.
pub(crate) struct TraceSpan(Context);

impl TraceSpan {
    /// Begins it.
    pub(crate) fn begin(name: &'static str, parent: &Context) -> Self {
        if !is_enabled() {
            return Self(Context::new());
        }
        Self(parent.with_span(global::tracer(SCOPE).start_with_context(name, parent)))
    }
}

impl Drop for TraceSpan {
    fn drop(&mut self) {
        self.0.span().end();
    }
}
