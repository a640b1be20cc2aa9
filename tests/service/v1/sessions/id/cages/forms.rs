//! Which cages come, and in which form.

use crate::support::{Capture, OCTETS, RECORDS, TestApp, cages_of, records};

#[tokio::test]
async fn raw_numbers_and_records_hold_the_same_cages() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/cages", session.id);
    assert!(app.get(&path).await.expect(200).body.is_empty(), "there are none yet");
    app.upload(&session.id, 0, capture.raw(0..30)).await;
    let unknowns = session.unknowns.expect("known");
    let raw = app.get_with(&path, &[("accept", OCTETS)]).await.expect(200);
    assert_eq!(raw.header("cache-control"), "no-store", "more may come");
    assert!(raw.headers.get("etag").is_none());
    let raw = cages_of(&raw.body, unknowns);
    let reply = app.get_with(&path, &[("accept", RECORDS)]).await.expect(200);
    assert_eq!(reply.header("content-type"), RECORDS);
    let cages = records(&reply.body, unknowns);
    assert!(cages.iter().map(|cage| cage.frame).eq(0..30));
    assert!(cages.iter().map(|cage| &cage.values).eq(&raw));
    let errors = app.errors(&session.id).await;
    assert!(cages.iter().map(|cage| (cage.l2, cage.linf)).eq(errors.iter().map(|error| (error.l2, error.linf))));
    assert_eq!(app.client().cages(&session.id, 0, 30).await.expect("cages"), cages);
    app.get_with(&path, &[("accept", "image/png")]).await.problem(406, "not-acceptable");
}

#[tokio::test]
async fn first_and_count_choose() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let unknowns = session.unknowns.expect("known");
    app.upload(&session.id, 0, capture.raw(0..10)).await;
    app.upload(&session.id, 12, capture.raw(12..14)).await;
    let all = cages_of(&app.cages(&session.id).await, unknowns);
    assert_eq!(all.len(), 10, "as far as there is no gap");
    let at = |query: &str| format!("/v1/sessions/{}/cages?{query}", session.id);
    let some = async |query: &str| cages_of(&app.get(&at(query)).await.expect(200).body, unknowns);
    assert_eq!(some("first=3&count=4").await, all[3..7]);
    assert_eq!(some("first=8").await, all[8..]);
    assert_eq!(some("first=12").await.len(), 2);
    assert!(some("first=10").await.is_empty() && some("first=4294967295").await.is_empty());
    assert!(some("first=5&count=0").await.is_empty());
    let problem = app.get(&at("first=8&count=6")).await.problem(409, "frames-missing");
    assert_eq!(problem.missing, Some(vec![[10, 12]]));
    for query in ["first=x", "count=-1", "frist=0", "follow=maybe"] {
        app.get(&at(query)).await.problem(400, "bad-request");
    }
}
