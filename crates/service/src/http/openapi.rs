//! The OpenAPI document, generated from the routes.

use super::frame_parser::RowsQuery;
use super::progress::Event;
use super::respond::PROBLEM_JSON;
use crate::problem;
use axum::response::IntoResponse;
use bytes::Bytes;
use cager_proto::cage_messages::{CageJob, CageJobList, CageOptions, CageProgress};
use cager_proto::job_messages::{Job, JobList};
use cager_proto::messages::{
    CageSource, FrameErrors, FrameResult, Problem, RestCage, Session, SessionList, SessionOptions,
};
use cager_proto::recovery_messages::{Recovery, RecoveryList, RecoveryOptions, RecoveryProgress};
use cager_proto::shape_messages::{ShapeSpace, ShapeSpaceList, ShapeSpaceOptions};
use cager_proto::transfer_messages::{Transfer, TransferList, TransferOptions, TransferProgress};
use http::header;
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::LazyLock;
use utoipa::openapi::encoding::EncodingBuilder;
use utoipa::openapi::path::{Operation, ParameterBuilder, ParameterIn};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{
    Content, ContentBuilder, HeaderBuilder, KnownFormat, ObjectBuilder, PathItem, Ref, RefOr, Response,
    ResponseBuilder, Schema, SchemaFormat, Type,
};
use utoipa::{IntoParams, Modify, OpenApi, ToSchema};

/// The path parameter of a session.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct Id {
    /// Id of the session.
    id: String,
}

/// The path parameter of a job, or of a shape space.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct JobId {
    /// Its id.
    id: String,
}

/// The parts of a request for a recovery.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct NewRecoveryForm {
    /// Mesh that is to move, with faces, a file whose name ends in .obj, .ply, .off, .stl, .glb, .abc or .usdc.
    #[schema(value_type = String, format = Binary)]
    template: Vec<u8>,
    /// Closed cage around it, a file of one of the same formats; one is made where it is left out.
    #[schema(value_type = String, format = Binary, required = false)]
    cage: Vec<u8>,
    /// Rig of a person, as `cager rig` writes it, in place of a cage.
    #[schema(value_type = String, format = Binary, required = false)]
    rig: Vec<u8>,
    /// Poses that are usual, as `cager manifold` writes them, with a rig.
    #[schema(value_type = String, format = Binary, required = false)]
    manifold: Vec<u8>,
    /// Choices.
    #[schema(required = false)]
    options: RecoveryOptions,
}

/// Frames of a recovery.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct SurfacesForm {
    /// Meshes or point clouds, each a part of its own, files whose names end in .obj, .ply, .off, .stl, .glb, .abc or .usdc.
    #[schema(value_type = Vec<String>, format = Binary)]
    frame: Vec<Vec<u8>>,
}

/// The parts of a request for a transfer.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct NewTransferForm {
    /// Source in its rest pose, with faces, a file whose name ends in .obj, .ply, .off, .stl, .glb, .abc or .usdc.
    #[schema(value_type = String, format = Binary, required = false)]
    source_rest: Vec<u8>,
    /// Its frames, points in the order of the rest pose: a file whose name ends in .npy (frames × points × 3), .pc2, .mdd, .mcx, .abc or .usdc (one mesh); else raw little-endian f32,
    /// frame after frame, whose number `options.frames` says.
    #[schema(value_type = String, format = Binary, required = false)]
    source_frames: Vec<u8>,
    /// Source with its frames, a container, in place of these two.
    #[schema(value_type = String, format = Binary, required = false)]
    source: Vec<u8>,
    /// Model that is to move, in its rest pose; a point cloud will do.
    #[schema(value_type = String, format = Binary)]
    target: Vec<u8>,
    /// Closed cage: around the source, or with the methods `public` and `rigid` around both, in the target's space; one is made where it is left out.
    #[schema(value_type = String, format = Binary, required = false)]
    cage: Vec<u8>,
    /// With `fitted`, vertices that correspond, where some are known: text with a vertex of the source and one of the target on each line, both counted
    /// from 0; # begins a comment.
    #[schema(value_type = String, format = Binary, required = false)]
    pairs: Vec<u8>,
    /// Choices.
    #[schema(required = false)]
    options: TransferOptions,
}

/// The parts of a request for a shape space.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct NewShapeSpaceForm {
    /// Poses, each a part of its own, files whose names end in .obj, .ply, .off, .stl, .glb, .abc or .usdc.
    #[schema(value_type = Vec<String>, format = Binary, required = false)]
    pose: Vec<Vec<u8>>,
    /// A container, of whose frames `options.frames` are the poses, in place of these.
    #[schema(value_type = String, format = Binary, required = false)]
    source: Vec<u8>,
    /// Closed cage around the first pose, or around the container's model in place of its own; one is made where it is left out.
    #[schema(value_type = String, format = Binary, required = false)]
    cage: Vec<u8>,
    /// Choices.
    #[schema(required = false)]
    options: ShapeSpaceOptions,
}

/// The parts of a request for a cage design.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct NewCageForm {
    /// Model in its rest pose, a file whose name ends in .obj, .ply, .off, .stl, .glb, .abc or .usdc.
    #[schema(value_type = String, format = Binary)]
    rest: Vec<u8>,
    /// Frames of its motion, points in the order of the rest pose: a file whose name ends in .npy (frames × points × 3), .pc2, .mdd, .mcx, .abc or .usdc (one mesh); else
    /// raw little-endian f32, frame after frame, whose number `options.frames` says.
    #[schema(value_type = String, format = Binary)]
    frames: Vec<u8>,
    /// Choices.
    #[schema(required = false)]
    options: CageOptions,
}

/// The parts of a request that decodes cages for another model.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct OtherModelForm {
    /// Model that lies in the rest cage, a file whose name ends in .obj, .ply, .off, .stl, .glb, .abc or .usdc. It comes first.
    #[schema(value_type = String, format = Binary)]
    model: Vec<u8>,
    /// m × 3 little-endian f32 for each cage, cage after cage.
    #[schema(value_type = String, format = Binary)]
    cages: Vec<u8>,
}

/// The parts of a request that creates a session.
#[derive(ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct NewSessionForm {
    /// Model in its rest pose, a file whose name ends in .obj, .ply, .off, .stl, .glb, .abc or .usdc.
    #[schema(value_type = String, format = Binary)]
    rest: Vec<u8>,
    /// Closed cage around it, a file of one of the same formats. Where it is left out, `options.cage` says where it comes from.
    #[schema(value_type = String, format = Binary, required = false)]
    cage: Vec<u8>,
    /// The matrix of the regularizer `matrix`: a sparse matrix in the Matrix Market format (coordinate), one column per vertex of
    /// the cage.
    #[schema(value_type = String, format = Binary, required = false)]
    regularizer_matrix: Vec<u8>,
    /// Choices.
    #[schema(required = false)]
    options: SessionOptions,
}

/// The document without its paths.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "CageR encoding service",
        description = "Turns animated mesh captures into cages: make a session from a rest pose and its cage, post frames, follow or download the cages.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
    ),
    components(schemas(CageJob, CageJobList, CageOptions, CageProgress, CageSource, Event, FrameErrors, FrameResult, Job, JobList, Problem, Recovery, RecoveryList, RecoveryOptions, RecoveryProgress, RestCage, RowsQuery, Session, SessionList, SessionOptions, ShapeSpace, ShapeSpaceList, ShapeSpaceOptions, Transfer, TransferList, TransferOptions, TransferProgress)),
    security(("token" = [])),
    tags(
        (name = "sessions", description = "Sessions and their progress"),
        (name = "frames", description = "Frames of a capture"),
        (name = "results", description = "What comes out"),
        (name = "jobs", description = "Designs, recoveries and transfers together"),
        (name = "cages", description = "Cages designed from a motion"),
        (name = "recoveries", description = "Animations recovered from surfaces without correspondence"),
        (name = "transfers", description = "Motions moved onto other models"),
        (name = "shapespaces", description = "Shapes between poses"),
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

/// This document.
#[utoipa::path(
    get, path = "/openapi.json", operation_id = "get_openapi", tag = "operation", security(()),
    responses((status = 200, description = "OpenAPI 3.1", content_type = "application/json", body = Object)),
)]
pub(crate) async fn get() -> impl IntoResponse {
    static DOCUMENT: LazyLock<Bytes> = LazyLock::new(|| Bytes::from(super::document().to_string()));
    ([(header::CONTENT_TYPE, "application/json")], DOCUMENT.clone())
}

/// Conditions of bytes that never change.
#[derive(IntoParams)]
#[into_params(parameter_in = Header)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct Conditions {
    /// One range of bytes, for example `bytes=0-1023`; anything else is ignored.
    #[param(rename = "Range")]
    range: Option<String>,
    /// The range applies only to this `ETag`; otherwise the full content is sent.
    #[param(rename = "If-Range")]
    if_range: Option<String>,
    /// `ETag`s of the client's copies: 304 if one of them is current.
    #[param(rename = "If-None-Match")]
    if_none_match: Option<String>,
}

/// The document of these routes, with what every route takes and answers.
pub(crate) fn finished(mut document: utoipa::openapi::OpenApi) -> Value {
    let mut statuses: BTreeMap<u16, Vec<&str>> = BTreeMap::new();
    for kind in problem::ALL {
        statuses.entry(kind.status.as_u16()).or_default().push(kind.word);
    }
    for (path, item) in &mut document.paths.paths {
        let guarded = path.starts_with("/v1/");
        for operation in operations(item) {
            for (status, words) in &statuses {
                if can_answer(*status, guarded, path, operation) {
                    let response = problem_response(words);
                    operation.responses.responses.entry(status.to_string()).or_insert(RefOr::T(response));
                }
            }
            describe_bytes(operation);
            describe_headers(operation);
        }
    }
    let mut document = serde_json::to_value(&document).unwrap_or_default();
    fix_u32_ranges(&mut document);
    let schemas = &mut document["components"]["schemas"];
    let forms = ["NewSessionForm", "NewCageForm", "NewRecoveryForm", "OtherModelForm", "SurfacesForm"];
    for form in forms.into_iter().chain(["NewTransferForm", "NewShapeSpaceForm"]) {
        schemas[form]["additionalProperties"] = false.into();
    }
    document
}

/// Corrects the range of u32 fields, which are declared as `int32`.
fn fix_u32_ranges(value: &mut Value) {
    if value["format"] == "int32" && value["minimum"].as_u64().is_some() {
        value["format"] = "int64".into();
        value["maximum"] = u32::MAX.into();
    }
    match value {
        Value::Object(fields) => fields.values_mut().for_each(fix_u32_ranges),
        Value::Array(items) => items.iter_mut().for_each(fix_u32_ranges),
        _ => {}
    }
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    [&mut item.get, &mut item.post, &mut item.patch, &mut item.delete].into_iter().filter_map(Option::as_mut)
}

/// Whether a route can answer with a problem of this status.
fn can_answer(status: u16, guarded: bool, path: &str, operation: &Operation) -> bool {
    let takes_body = operation.request_body.is_some();
    let in_session = path.contains("{id}");
    let forms = operation.responses.responses.values().filter_map(|response| match response {
        RefOr::T(response) => Some(response.content.len()),
        RefOr::Ref(_) => None,
    });
    let is_export = takes(operation, "format") || operation.operation_id.as_deref().is_some_and(is_capture_file);
    let negotiates = forms.max().unwrap_or(0) > 1 && !is_export;
    match status {
        // Whatever the route: a request that is broken or stalls, too many connections, a fault of the service.
        400 | 405 | 408 | 431 | 500 | 503 => true,
        507 => path == "/readyz" || takes_body || is_export,
        401 | 403 if path == "/metrics" => true,
        _ if !guarded => false,
        401 | 403 | 429 => true,
        404 => in_session,
        406 => negotiates,
        409 => in_session || takes_body,
        410 => in_session,
        413 => takes_body || is_export,
        415 | 422 => takes_body,
        416 => takes(operation, "Range"),
        _ => false,
    }
}

/// Whether an operation is an export with an address of its own.
fn is_capture_file(id: &str) -> bool {
    id.starts_with("get_capture_")
}

fn takes(operation: &Operation, parameter: &str) -> bool {
    let parameters = operation.parameters.iter().flatten();
    parameters.into_iter().any(|known| matches!(known, RefOr::T(known) if known.name == parameter))
}

/// Declares binary bodies as binary strings rather than arrays of numbers.
fn describe_bytes(operation: &mut Operation) {
    for response in operation.responses.responses.values_mut() {
        if let RefOr::T(response) = response {
            response.content.iter_mut().for_each(|(media_type, content)| describe_content(media_type, content));
        }
    }
    if let Some(RefOr::T(body)) = &mut operation.request_body {
        body.content.iter_mut().for_each(|(media_type, content)| describe_content(media_type, content));
    }
}

fn describe_content(media_type: &str, content: &mut RefOr<Content>) {
    let is_bytes = media_type == "application/octet-stream"
        || ["application/vnd.cager", "model/"].iter().any(|kind| media_type.starts_with(kind));
    let RefOr::T(content) = content else { return };
    if is_bytes {
        let format = SchemaFormat::KnownFormat(KnownFormat::Binary);
        content.schema = Some(ObjectBuilder::new().schema_type(Type::String).format(Some(format)).build().into());
    }
    if media_type == "multipart/form-data" {
        let files: &[_] = match form(content) {
            "OtherModelForm" => &[("model", "obj")],
            "SurfacesForm" => &[("frame", "ply")],
            "NewRecoveryForm" => &[("template", "obj"), ("cage", "obj"), ("rig", "json"), ("manifold", "json")],
            "NewCageForm" => &[("rest", "obj"), ("frames", "npy")],
            "NewTransferForm" => &[
                ("source_rest", "obj"),
                ("source_frames", "npy"),
                ("source", "cager"),
                ("target", "obj"),
                ("cage", "obj"),
            ],
            "NewShapeSpaceForm" => &[("pose", "obj"), ("source", "cager"), ("cage", "obj")],
            _ => &[("rest", "obj"), ("cage", "obj")],
        };
        for (part, ending) in files {
            let example = format!("form-data; name=\"{part}\"; filename=\"{part}.{ending}\"");
            let name = HeaderBuilder::new()
                .description(Some("With a file name, whose extension says the format"))
                .schema(Some(text()))
                .example(Some(example.into()));
            let part_headers = EncodingBuilder::new().header("Content-Disposition", name.build());
            content.encoding.insert((*part).to_owned(), part_headers.build());
        }
        if !matches!(form(content), "OtherModelForm" | "SurfacesForm") {
            let options = EncodingBuilder::new().content_type(Some("application/json".to_owned()));
            content.encoding.insert("options".to_owned(), options.build());
        }
    }
}

/// The name of the form that a body is.
fn form(content: &Content) -> &str {
    match &content.schema {
        Some(RefOr::Ref(form)) => form.ref_location.rsplit('/').next().unwrap_or_default(),
        _ => "",
    }
}

/// The header that every request may have, and those that responses have.
fn describe_headers(operation: &mut Operation) {
    let id = ParameterBuilder::new()
        .name("x-request-id")
        .parameter_in(ParameterIn::Header)
        .description(Some(
            "Request identifier for the log, 1 to 64 letters, digits, or . _ -; anything else is replaced by a generated one",
        ))
        .schema(Some(text()));
    operation.parameters.get_or_insert_default().push(RefOr::T(id.build()));
    let has_range = takes(operation, "Range");
    for (status, response) in &mut operation.responses.responses {
        let RefOr::T(response) = response else { continue };
        let mut add = |name: &str, schema: RefOr<Schema>, description: &str| {
            let header = HeaderBuilder::new().description(Some(description)).schema(Some(schema)).build();
            response.headers.entry(name.to_owned()).or_insert(RefOr::T(header));
        };
        add("x-request-id", text(), "Identifier of the request, also in the service's log");
        match status.as_str() {
            "401" => add("WWW-Authenticate", text(), "`Bearer`"),
            "405" => add("Allow", text(), "Methods that the address takes"),
            "409" | "429" | "503" | "507" => {
                add("Retry-After", whole_number(), "Seconds after which to try again");
            }
            "200" | "206" | "304" if has_range => {
                add("ETag", text(), "Identifies the content, which never changes; only for completed sessions");
                add("Accept-Ranges", text(), "`bytes`, where `Range` is taken");
                add("Cache-Control", text(), "How long the response may be cached");
                add("Vary", text(), "Request headers that select the response");
                if status == "206" {
                    add("Content-Range", text(), "The range in the response, and the full length");
                }
            }
            _ => {}
        }
    }
}

fn text() -> RefOr<Schema> {
    ObjectBuilder::new().schema_type(Type::String).build().into()
}

fn whole_number() -> RefOr<Schema> {
    ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(0)).build().into()
}

fn problem_response(words: &[&str]) -> Response {
    let kinds: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
    ResponseBuilder::new()
        .description(format!("Problem: {}", kinds.join(", ")))
        .content(PROBLEM_JSON, ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build())
        .build()
}
