//! `GET …/events`: progress of a design.

use crate::support::{Capture, Inside, SlowDesigns, piece};
use cager_proto::cage_messages::{CageProgress, CageState};
use http::Method;
use serde_json::json;
use std::sync::Arc;

/// Ids and progress of events.
fn events(text: &str) -> Vec<(String, CageProgress)> {
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
async fn the_error_is_seen_to_fall_until_the_cage_is_there() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |_| ()).await;
    let job = app.design(Capture::tiny(), &json!({})).await;
    let path = format!("/v1/cages/{}/events", job.id);
    let mut response = app.open(&path).await;
    assert_eq!(response.headers()["content-type"], "text/event-stream");
    let mut heard = Vec::new();
    while heard.len() < 4 {
        let more = piece("an event", &mut response).await.expect("a stream").expect("an event");
        heard.extend(events(std::str::from_utf8(&more).expect("UTF-8")));
    }
    let errors: Vec<f64> = heard.iter().filter_map(|(_, progress)| progress.error).collect();
    assert!(errors.len() >= 2 && errors.is_sorted_by(|a, b| a > b), "{heard:?}");
    let (id, last) = heard.pop().expect("an event");
    assert!(last.state == CageState::Running && last.vertices.is_some());
    slow.release();
    let back = app.request(Method::GET, &path).header("last-event-id", &id).send().await.expect("an answer");
    let rest = events(&back.text().await.expect("a stream"));
    assert!(rest.iter().all(|(other, _)| *other != id), "{rest:?}");
    let (id, last) = rest.last().expect("an event");
    assert_eq!((last.state, last.fraction), (CageState::Completed, 1.0));
    // Who has heard the end hears that there is no more.
    assert!(app.get_with(&path, &[("last-event-id", id)]).await.expect(200).body.is_empty());
}
