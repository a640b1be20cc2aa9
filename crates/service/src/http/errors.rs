//! `GET /v1/sessions/{id}/errors`: errors of every solved frame.

use super::extract::RequestedSession;
use super::openapi;
use super::solved_frames::result_of;
use crate::problem::ApiError;
use crate::tasks::blocking;
use axum::response::{IntoResponse, Response};
use cager_proto::messages::FrameErrors;
use http::header::CONTENT_TYPE;

/// Errors of all solved frames, ascending, as fractions of the rest diagonal.
#[utoipa::path(get, path = "/v1/sessions/{id}/errors", operation_id = "get_errors", tag = "results", params(openapi::Id), responses((status = 200, description = "The errors", body = FrameErrors)))]
pub(crate) async fn get(RequestedSession { session, .. }: RequestedSession) -> Result<Response, ApiError> {
    // Of a long capture that is work for another thread than those that answer.
    let body = blocking(move || {
        let frames: Vec<_> = session.frames().entries().map(result_of).collect();
        serde_json::to_vec(&FrameErrors { frames })
    });
    let body = body.await?.map_err(|error| ApiError::internal(&error))?;
    Ok(([(CONTENT_TYPE, "application/json")], body).into_response())
}
