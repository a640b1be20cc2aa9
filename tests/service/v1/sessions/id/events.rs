//! `GET …/events`: progress as server-sent events.

use crate::support::{Capture, TestApp, piece};
use cager_proto::messages::{Progress, SessionState};
use futures_util::StreamExt as _;
use http::Method;
use std::time::Duration;

/// Events of a stream that has ended: id and progress.
fn events(text: &str) -> Vec<(String, Progress)> {
    let field = |event: &str, name: &str| {
        let value = event.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
        value.unwrap_or_else(|| panic!("no {name} in {event:?}")).to_owned()
    };
    let all = text.split("\n\n").filter(|event| !event.is_empty() && !event.starts_with(':'));
    all.map(|event| {
        assert_eq!(field(event, "event"), "progress");
        (field(event, "id"), serde_json::from_str(&field(event, "data")).expect("a progress"))
    })
    .collect()
}

#[tokio::test]
async fn progress_is_told_from_the_beginning_to_completion() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.create(capture).await;
    let path = format!("/v1/sessions/{}/events", session.id);
    let listen = async {
        let reply = app.get(&path).await.expect(200);
        assert_eq!(reply.header("content-type"), "text/event-stream");
        events(&reply.text())
    };
    let work = async {
        app.prepared(&session.id).await;
        for k in 0..4 {
            app.upload(&session.id, 10 * k, capture.raw(10 * k..10 * k + 10)).await;
            tokio::time::sleep(Duration::from_millis(150)).await;
        }
        app.complete(&session.id, 40).await.expect(200);
    };
    let (heard, ()) = tokio::join!(listen, work);
    assert!(heard.len() >= 3, "{heard:?}");
    assert!(heard.is_sorted_by_key(|(_, progress)| progress.solved), "{heard:?}");
    assert!(heard.iter().all(|(_, progress)| progress.solved <= progress.received), "{heard:?}");
    let last = &heard.last().expect("an event").1;
    assert_eq!(*last, Progress { state: SessionState::Completed, received: 40, solved: 40, coded: None });
    let ids: std::collections::BTreeSet<&String> = heard.iter().map(|(id, _)| id).collect();
    assert_eq!(ids.len(), heard.len(), "an id says what was told");
    // The client hears the same end.
    let by_client: Vec<_> = app.client().events(&session.id).collect().await;
    assert_eq!(by_client.last().expect("an event").as_ref().expect("a progress"), last);
}

#[tokio::test]
async fn what_was_heard_is_not_told_again() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..5)).await;
    let path = format!("/v1/sessions/{}/events", session.id);
    let mut response = app.open(&path).await;
    let first = piece("an event", &mut response).await.expect("a stream").expect("an event");
    let (id, progress) = events(std::str::from_utf8(&first).expect("UTF-8")).remove(0);
    assert_eq!((progress.state, progress.solved), (SessionState::Ready, 5));
    drop(response);
    // Back again, with nothing new.
    let back = app.request(Method::GET, &path).header("last-event-id", &id);
    let mut response = back.send().await.expect("an answer");
    assert!(tokio::time::timeout(Duration::from_millis(400), response.chunk()).await.is_err(), "nothing is new");
    app.upload(&session.id, 5, capture.raw(5..6)).await;
    let next = piece("an event", &mut response).await.expect("a stream").expect("an event");
    let (_, progress) = events(std::str::from_utf8(&next).expect("UTF-8")).remove(0);
    assert!(progress.received == 6, "{progress:?}");
    app.complete(&session.id, 6).await.expect(200);
    // Who has heard the last event hears that there are no more; who has not, hears it.
    let all = events(&app.get(&path).await.expect(200).text());
    let last = &all.last().expect("an event").0;
    assert!(app.get_with(&path, &[("last-event-id", last)]).await.expect(200).body.is_empty());
    let told = app.get_with(&path, &[("last-event-id", &id)]).await.expect(200).text();
    assert_eq!(events(&told).len(), 1);
}
