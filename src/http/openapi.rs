//! The OpenAPI document, made from the routes.

use super::respond::PROBLEM_JSON;
use crate::problem;
use cager_proto::messages::{FrameErrors, FrameResult, Problem, Progress, Session, SessionList, SessionOptions};
use std::collections::BTreeMap;
use utoipa::openapi::path::Operation;
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{ContentBuilder, HeaderBuilder, ObjectBuilder, Ref, RefOr, ResponseBuilder, Type};
use utoipa::{IntoParams, Modify, OpenApi, ToSchema};

/// The path parameter of a session.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct Id {
    /// Id of the session.
    id: String,
}

/// The parts that make a session.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct NewSessionForm {
    /// Model in its rest pose, a file whose name ends in .obj, .ply, .off, .stl or .glb.
    #[schema(value_type = String, format = Binary)]
    rest: Vec<u8>,
    /// Closed cage around it, a file of one of the same formats.
    #[schema(value_type = String, format = Binary)]
    cage: Vec<u8>,
    /// Choices.
    options: Option<SessionOptions>,
}

/// The document without its paths.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "CageR encoding service",
        description = "Turns animated mesh captures into cages: make a session from a rest pose and its cage, post frames, follow or download the cages.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
    ),
    components(schemas(FrameErrors, FrameResult, Problem, Progress, Session, SessionList, SessionOptions)),
    security(("token" = [])),
    tags(
        (name = "sessions", description = "Sessions and their progress"),
        (name = "frames", description = "Frames of a capture"),
        (name = "results", description = "What comes out"),
        (name = "operation", description = "For operators"),
    ),
    modifiers(&Token),
)]
pub(crate) struct Document;

struct Token;

impl Modify for Token {
    fn modify(&self, openapi: &mut utoipa::openapi::OpenApi) {
        let scheme = HttpBuilder::new()
            .scheme(HttpAuthScheme::Bearer)
            .description(Some("Needed where the service has a tokens file"))
            .build();
        openapi.components.get_or_insert_default().add_security_scheme("token", SecurityScheme::Http(scheme));
    }
}

/// Adds what every route can answer.
pub(crate) fn with_problems(mut document: utoipa::openapi::OpenApi) -> utoipa::openapi::OpenApi {
    let mut statuses: BTreeMap<u16, Vec<&str>> = BTreeMap::new();
    for kind in problem::ALL {
        statuses.entry(kind.status.as_u16()).or_default().push(kind.word);
    }
    for (path, item) in &mut document.paths.paths {
        let guarded = path.starts_with("/v1/");
        let operations: [&mut Option<Operation>; 4] = [&mut item.get, &mut item.post, &mut item.put, &mut item.delete];
        for operation in operations.into_iter().flatten() {
            for (status, words) in &statuses {
                if guarded || matches!(status, 405 | 500 | 503 | 507) {
                    let response = problem_response(*status, words);
                    operation.responses.responses.entry(status.to_string()).or_insert(RefOr::T(response));
                }
            }
        }
    }
    document
}

fn problem_response(status: u16, words: &[&str]) -> utoipa::openapi::Response {
    let kinds: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
    let mut response = ResponseBuilder::new()
        .description(format!("Problem: {}", kinds.join(", ")))
        .content(PROBLEM_JSON, ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build());
    if matches!(status, 409 | 429 | 503 | 507) {
        let seconds = ObjectBuilder::new().schema_type(Type::Integer).build();
        let header = HeaderBuilder::new().description(Some("Seconds after which trying again makes sense"));
        response = response.header("Retry-After", header.schema(Some(seconds)).build());
    }
    response.build()
}
