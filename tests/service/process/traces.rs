//! Traces to a collector.

use crate::support::{Capture, Elsewhere, TestApp};
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::trace::v1::Span;
use prost::Message as _;
use std::collections::HashMap;

#[tokio::test]
async fn requests_and_their_work_are_traced_below_the_clients_span() {
    let collector = Elsewhere::with(&[]).await;
    let mut app = TestApp::with_environment(&[("OTEL_EXPORTER_OTLP_ENDPOINT", &collector.address)]);
    let session = app.completed(Capture::tiny(), 2).await;
    let (trace, parent) = ("0af7651916cd43dd8448eb211c80319c", "b7ad6b7169203331");
    let traceparent = format!("00-{trace}-{parent}-01");
    app.get_with(&format!("/v1/sessions/{}", session.id), &[("traceparent", &traceparent)]).await.expect(200);
    app.get_with("/v1/sessions/none", &[]).await.problem(404, "not-found");
    app.terminate();
    assert!(app.ended().await.0.success());
    let mut spans: Vec<Span> = Vec::new();
    while collector.left() > 0 {
        let heard = collector.next().await;
        assert_eq!((heard.path.as_str(), heard.header("content-type")), ("/v1/traces", "application/x-protobuf"));
        let message = ExportTraceServiceRequest::decode(heard.body).expect("spans");
        spans.extend(message.resource_spans.into_iter().flat_map(|r| r.scope_spans).flat_map(|s| s.spans));
    }
    let by_name: HashMap<&str, &Span> = spans.iter().map(|span| (span.name.as_str(), span)).collect();
    let create = by_name["POST /v1/sessions"];
    assert_eq!(by_name["prepare"].parent_span_id, create.span_id, "preparing was asked for by creating");
    assert_eq!(by_name["complete"].parent_span_id, by_name["POST /v1/sessions/{id}/complete"].span_id);
    let traced = spans.iter().find(|span| hex(&span.trace_id) == trace).expect("the client's trace goes on");
    assert_eq!((traced.name.as_str(), hex(&traced.parent_span_id).as_str()), ("GET /v1/sessions/{id}", parent));
    assert!(app.log().contains(trace), "the log line says which trace it belongs to");
    assert!(spans.iter().all(|span| span.end_time_unix_nano >= span.start_time_unix_nano));
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
