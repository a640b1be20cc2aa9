//! `GET /v1/jobs`: designs, recoveries and transfers in one list.

use super::extract::{Caller, Query};
use super::respond::JsonResult;
use super::sessions::{PAGE, PageQuery, page_of};
use crate::cage_job::CageDesign;
use crate::jobs::{Job as Known, Phase, Run};
use crate::recovery::Recovery;
use crate::service::Service;
use crate::store::{JobMeta as _, RecordMeta as _};
use crate::transfers::Transfer;
use axum::Json;
use axum::extract::State;
use cager_proto::job_messages::{Job, JobKind, JobList};
use cager_proto::messages::JobState;
use std::sync::Arc;

/// Lists the tenant's designs, recoveries and transfers, newest first, a hundred at a time.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs", params(PageQuery), responses((status = 200, description = "A page of jobs", body = JobList)))]
pub(crate) async fn list(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    Query(query): Query<PageQuery>,
) -> JsonResult<JobList> {
    let after = query.after()?;
    let mut jobs = of::<CageDesign>(&service, &tenant.name, after, JobKind::Cage);
    jobs.extend(of::<Recovery>(&service, &tenant.name, after, JobKind::Recovery));
    jobs.extend(of::<Transfer>(&service, &tenant.name, after, JobKind::Transfer));
    // Ids are in order of creation.
    jobs.sort_unstable_by(|a, b| b.id.cmp(&a.id));
    let (jobs, next) = page_of(jobs, |job| job.id.clone());
    Ok(Json(JobList { jobs, next }))
}

/// The first jobs of a kind after this id, one more than a page has.
fn of<W: Run>(service: &Service, tenant: &str, after: Option<&str>, kind: JobKind) -> Vec<Job> {
    W::jobs(service).page(tenant, after, PAGE + 1).iter().map(|job| told(&**job, kind)).collect()
}

fn told<W: Run>(job: &Known<W>, kind: JobKind) -> Job {
    let (state, detail) = match job.phase() {
        Phase::Running if !W::is_idle(&job.status()) => (JobState::Running, None),
        Phase::Waiting | Phase::Running => (JobState::Queued, None),
        Phase::Completed(_) => (JobState::Completed, None),
        Phase::Failed(problem) => (JobState::Failed, Some(problem.detail)),
    };
    Job {
        kind,
        id: job.id().to_owned(),
        name: job.meta.name().map(str::to_owned),
        state,
        created: job.meta.created_ms() as f64 / 1e3,
        url: format!("{}/{}", W::LIST, job.id()),
        detail,
    }
}
