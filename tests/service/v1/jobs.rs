//! `/v1/jobs`: designs, recoveries and transfers in one list.

use super::{recoveries, transfers};
use crate::support::{Capture, TestApp};
use cager_proto::job_messages::{JobKind, JobList};
use cager_proto::messages::JobState;
use serde_json::{Value, json};

#[tokio::test]
async fn jobs_of_all_kinds_are_in_one_list_the_newest_first() {
    let app = TestApp::guarded(&[("a", "token-of-a-tenant-a", ""), ("b", "token-of-a-tenant-b", "")]);
    let (mine, other) = (app.caller(Some("token-of-a-tenant-a")), app.caller(Some("token-of-a-tenant-b")));
    let cage = mine.design(Capture::tiny(), &json!({"vertices": 32, "time_limit_s": 10.0, "name": "a cage"})).await;
    let transfer = transfers::created(&mine, &json!({"align": "none", "name": "a motion"})).await;
    let recovery = recoveries::created(&mine, &json!({"points": 800})).await;
    mine.designed(&cage.id).await;
    let JobList { jobs, next } = mine.get("/v1/jobs").await.is(200);
    assert_eq!(next, None);
    let found: Vec<_> = jobs.iter().map(|job| (job.kind, &job.id[..], job.name.as_deref(), job.created)).collect();
    let expected = [
        (JobKind::Recovery, &recovery.id[..], None, recovery.created),
        (JobKind::Transfer, &transfer.id[..], Some("a motion"), transfer.created),
        (JobKind::Cage, &cage.id[..], Some("a cage"), cage.created),
    ];
    assert_eq!(found, expected);
    // A recovery without frames waits for them.
    assert_eq!((jobs[0].state, jobs[2].state), (JobState::Queued, JobState::Completed));
    for job in &jobs {
        let one: Value = mine.get(&job.url).await.is(200);
        assert_eq!(one["id"], job.id);
    }
    let after: JobList = mine.get(&format!("/v1/jobs?after={}", transfer.id)).await.is(200);
    assert_eq!(after.jobs, jobs[2..]);
    let none: JobList = other.get("/v1/jobs").await.is(200);
    assert!(none.jobs.is_empty(), "{none:?}");
}
