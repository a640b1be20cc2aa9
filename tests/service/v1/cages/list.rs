//! `GET /v1/cages`, and whose designs are in it.

use crate::support::{Capture, TestApp};
use cager_proto::cage_messages::CageJobList;
use cager_proto::messages::Session;
use reqwest::multipart::Form;
use serde_json::json;

const ANNA: &str = "anna-has-a-long-secret";
const BERT: &str = "bert-has-a-long-secret";

#[tokio::test]
async fn designs_are_listed_newest_first() {
    let app = TestApp::start();
    let mut ids = Vec::new();
    for seed in 0..3 {
        let options = json!({"vertices": 32, "seed": seed, "time_limit_s": 10.0});
        ids.push(app.design(Capture::tiny(), &options).await.id);
    }
    let list: CageJobList = app.get("/v1/cages").await.is(200);
    assert_eq!(list.cages.iter().map(|job| &job.id).collect::<Vec<_>>(), ids.iter().rev().collect::<Vec<_>>());
    assert_eq!(list.next, None);
    let after: CageJobList = app.get(&format!("/v1/cages?after={}", ids[2])).await.is(200);
    assert_eq!(after.cages.len(), 2);
}

#[tokio::test]
async fn a_tenants_design_is_nobody_elses() {
    let app = TestApp::guarded(&[("anna", ANNA, "scope = \"admin\"\n"), ("bert", BERT, "")]);
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    let capture = Capture::tiny();
    let job = anna.design(capture, &json!({"vertices": 32, "time_limit_s": 10.0})).await;
    anna.designed(&job.id).await;
    for path in ["", "/events", "/cage.obj"] {
        bert.get(&format!("/v1/cages/{}{path}", job.id)).await.problem(404, "not-found");
    }
    bert.delete(&format!("/v1/cages/{}", job.id)).await.problem(404, "not-found");
    assert_eq!(bert.get("/v1/cages").await.is::<CageJobList>(200).cages, []);
    let parts = || {
        let rest = crate::support::file("rest.obj", &capture.rest.obj);
        Form::new().part("rest", rest).part("options", crate::support::text(&json!({"cage": {"id": job.id}})))
    };
    bert.create_with(parts(), None).await.problem(422, "invalid-options");
    anna.create_with(parts(), None).await.is::<Session>(201);
    // The same input of another tenant is designed again.
    let own = bert.design(capture, &json!({"vertices": 32, "time_limit_s": 10.0})).await;
    bert.designed(&own.id).await;
    assert_eq!(app.metric("cager_designs_total{result=\"completed\"}").await, 2.0);
}
