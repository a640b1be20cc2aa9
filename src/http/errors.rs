//! `GET /v1/sessions/{id}/errors`: errors of every solved frame.

use super::extract::Found;
use super::frames::result_of;
use super::openapi;
use axum::Json;
use cager_proto::messages::FrameErrors;

/// Errors of all solved frames, ascending, as fractions of the rest diagonal.
#[utoipa::path(get, path = "/v1/sessions/{id}/errors", operation_id = "get_errors", tag = "results", params(openapi::Id), responses((status = 200, description = "The errors", body = FrameErrors)))]
pub(crate) async fn get(Found { session, .. }: Found) -> Json<FrameErrors> {
    let frames = session.frames().entries().map(result_of).collect();
    Json(FrameErrors { frames })
}
