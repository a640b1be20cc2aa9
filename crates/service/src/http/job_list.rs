//! `GET /v1/jobs`: designs, recoveries and transfers in one list.

use super::extract::{Caller, Query};
use super::respond::JsonResult;
use super::sessions::{PAGE, PageQuery, page_of};
use crate::cage_job::CageDesign;
use crate::jobs::Run;
use crate::recovery::Recovery;
use crate::service::Service;
use crate::transfers::Transfer;
use axum::Json;
use axum::extract::State;
use cager_proto::job_messages::{Job, JobList};
use std::sync::Arc;

/// Lists the tenant's designs, recoveries and transfers, newest first, a hundred at a time.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs", params(PageQuery), responses((status = 200, description = "A page of jobs", body = JobList)))]
pub(crate) async fn list(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    Query(query): Query<PageQuery>,
) -> JsonResult<JobList> {
    let after = query.after()?;
    let mut jobs = of::<CageDesign>(&service, &tenant.name, after);
    jobs.extend(of::<Recovery>(&service, &tenant.name, after));
    jobs.extend(of::<Transfer>(&service, &tenant.name, after));
    // Ids are in order of creation.
    jobs.sort_unstable_by(|a, b| b.id.cmp(&a.id));
    let (jobs, next) = page_of(jobs, |job| job.id.clone());
    Ok(Json(JobList { jobs, next }))
}

/// The first jobs of a kind after this id, one more than a page has.
fn of<W: Run>(service: &Service, tenant: &str, after: Option<&str>) -> Vec<Job> {
    W::jobs(service).page(tenant, after, PAGE + 1).iter().map(|job| job.summary()).collect()
}
