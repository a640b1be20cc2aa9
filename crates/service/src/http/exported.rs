//! `GET /v1/sessions/{id}/export`: the decoded frames of a completed session as a file of other programs.

use super::extract::{Query, RequestedSession};
use super::openapi;
use super::ranged::{Immutable, is_known};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::{Phase, Session};
use crate::store::{Completion, StoreError};
use crate::tasks::blocking;
use axum::extract::State;
use axum::response::{IntoResponse as _, Response};
use cager_capture::decode::{DecodeError, Decoding, decode};
use cager_capture::memory::Memory;
use cager_formats::Target;
use http::header::{CONTENT_DISPOSITION, ETAG};
use http::{HeaderMap, HeaderValue, StatusCode};
use serde::Deserialize;
use std::fs::File;
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::sync::Arc;

/// Bytes of a file beside its positions: its faces, and what the format adds.
const FACE_BYTES: u64 = 32;
const FILE_BYTES: u64 = 1 << 16;
/// Memory for frames on their way from the container to the file.
const BUFFERS: u64 = 256 << 20;

/// A file's format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Format {
    Abc,
    Glb,
    Mdd,
    Npy,
    Pc2,
    Usdc,
    Usdz,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Self::Abc => "abc",
            Self::Glb => "glb",
            Self::Mdd => "mdd",
            Self::Npy => "npy",
            Self::Pc2 => "pc2",
            Self::Usdc => "usdc",
            Self::Usdz => "usdz",
        }
    }

    fn media_type(self) -> &'static str {
        match self {
            Self::Glb => "model/gltf-binary",
            Self::Usdc => "model/vnd.usd",
            Self::Usdz => "model/vnd.usdz+zip",
            Self::Abc | Self::Mdd | Self::Npy | Self::Pc2 => "application/octet-stream",
        }
    }
}

/// Which file.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct ExportQuery {
    /// Its format.
    #[param(inline)]
    format: Format,
}

/// The frames of a completed session, decoded: Alembic (`abc`), USD (`usdc`, `usdz`), glTF with morph targets (`glb`), or a cache of points (`npy`, `pc2`, `mdd`). It is
/// what `cager decode` writes of the container.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/export", operation_id = "export_session", tag = "results",
    params(openapi::Id, ExportQuery, openapi::Conditions),
    responses(
        (status = 200, description = "The file", content(
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "model/gltf-binary"), (Vec<u8> = "model/vnd.usd"),
            (Vec<u8> = "model/vnd.usdz+zip"),
        )),
        (status = 206, description = "The range asked for", content(
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "model/gltf-binary"), (Vec<u8> = "model/vnd.usd"),
            (Vec<u8> = "model/vnd.usdz+zip"),
        )),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    Query(ExportQuery { format }): Query<ExportQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    file(&service, &session, &tenant, format, &headers).await
}

/// The file in this format, or what of it was asked for.
///
/// # Errors
/// A session that is not completed; no room; storage errors.
pub(super) async fn file(
    service: &Arc<Service>,
    session: &Arc<Session>,
    tenant: &Tenant,
    format: Format,
    headers: &HeaderMap,
) -> Result<Response, ApiError> {
    let Phase::Completed(completion) = session.status().phase else {
        if let Some(problem) = session.container_problem() {
            return Err(problem);
        }
        let detail =
            "files are written of completed sessions; post {\"frames\": F} to complete, or decode cages as they come";
        return Err(ApiError::new(problem::NOT_COMPLETED, detail));
    };
    let etag = format!("{}-{}", completion.container_digest, format.extension());
    if is_known(headers, &format!("\"{etag}\"")) {
        return Ok((StatusCode::NOT_MODIFIED, [(ETAG, format!("\"{etag}\""))]).into_response());
    }
    // What it contains is called as at first, so that its bytes stay the same.
    let name = file_name(session.meta.options.name.as_deref(), format.extension());
    let (file, length, space) = made(service, session, &tenant.name, &completion, (format, &name)).await?;
    let read = move |range: Range<u64>| {
        // Its disk space is held while it is sent.
        let _space = &space;
        let mut bytes = vec![0; (range.end - range.start) as usize];
        file.read_exact_at(&mut bytes, range.start)?;
        Ok(bytes.into())
    };
    let mut response = Immutable {
        length,
        etag,
        media_type: format.media_type(),
        public: !service.access.is_guarded(),
        room: Permit::empty(&service.download_memory, &tenant.name),
        read: Arc::new(read),
    }
    .respond_readable(headers)
    .await;
    let name = file_name(session.name().as_deref(), format.extension());
    let name = HeaderValue::try_from(format!("attachment; filename=\"{name}\"")).map_err(|e| ApiError::internal(&e))?;
    response.headers_mut().insert(CONTENT_DISPOSITION, name);
    Ok(response)
}

/// The file, which has no name any more, with its length and its disk space.
async fn made(
    service: &Arc<Service>,
    session: &Arc<Session>,
    tenant: &str,
    completion: &Completion,
    (format, name): (Format, &str),
) -> Result<(File, u64, Permit), ApiError> {
    let facts = session.facts().ok_or_else(|| ApiError::internal(&"a completed session without facts"))?;
    let (points, frames) = (u64::from(facts.points), u64::from(completion.frames));
    let positions = 12 * points * frames;
    let bytes = positions + FACE_BYTES * 2 * points + FILE_BYTES;
    // Principal components are found of all frames at once.
    let kept = if format == Format::Glb { 2 * positions } else { 0 };
    if bytes > service.spool_space.most() || kept > service.decoding_memory.most() {
        let detail = format!(
            "its {frames} frames of {points} points make a file that is too large to be written here; download capture.cager and decode it: cager decode capture.cager -o FILE.{}",
            format.extension()
        );
        return Err(ApiError::new(problem::TOO_LARGE, detail));
    }
    if bytes > service.store.free_bytes() / 2 {
        return Err(no_room());
    }
    let mut space = Permit::empty(&service.spool_space, tenant);
    space.grow(bytes).map_err(|full| {
        service.rejected("spool_space");
        full.refusal("disk space for files on their way")
    })?;
    let coordinates = 4 * points * u64::from(facts.unknowns);
    let working = async {
        let memory = service.decoding_memory.take(tenant, coordinates + kept + BUFFERS).await;
        (service.exporting.take(tenant, 1).await, memory)
    };
    let places = tokio::select! {
        places = working => places,
        () = session.deleted().cancelled() => return Err(crate::session::gone()),
        () = service.stopping().cancelled() => return Err(super::waiting::stopping()),
    };
    let container = service.store.container_path(&session.meta.id);
    // What it contains is called as it is.
    let (folder, name) = (service.store.scratch(), name.to_owned());
    let (coders, of, completion) = (Arc::clone(&service.coders), Arc::clone(session), completion.clone());
    let written = blocking(move || {
        // Disk and memory are held until it is done, also where nobody waits any more.
        let _places = places;
        of.open_container(&completion)?;
        let written = coders.install(|| write(&container, &folder, &name)).map_err(|error| {
            tracing::error!(session = %of.meta.id, %error, "a file of its frames could not be written");
            if of.is_going() { crate::session::gone() } else { refused(&folder, &error) }
        });
        written.map(|(file, length)| (file, length, space))
    });
    written.await?
}

fn write(container: &Path, folder: &Path, name: &str) -> anyhow::Result<(File, u64)> {
    let what = Decoding { memory: Some(Memory::at_most(4 * BUFFERS)), ..Decoding::default() };
    std::fs::create_dir(folder)?;
    let output = folder.join(name);
    let written = decode(container, Target::New(output.clone()), what, &mut |_| ());
    let opened = File::open(&output).and_then(|file| Ok((file.metadata()?.len(), file)));
    // What is left of it, also where it could not be written.
    std::fs::remove_dir_all(folder)?;
    written?;
    let (length, file) = opened?;
    Ok((file, length))
}

fn refused(folder: &Path, error: &anyhow::Error) -> ApiError {
    use io::ErrorKind::{InvalidData, InvalidInput, Other, UnexpectedEof};
    if let Some(DecodeError::Formats(cager_formats::Error::Unsupported { what, .. })) = error.downcast_ref() {
        let detail = format!("a file of this format {what}; or download capture.cager and decode it: cager decode");
        return ApiError::new(problem::INVALID_OPTIONS, detail);
    }
    let mut kinds = error.chain().filter_map(|cause| Some(cause.downcast_ref::<io::Error>()?.kind()));
    // These are of what was read, others of the disk.
    let by_disk = kinds.find(|kind| !matches!(kind, InvalidData | InvalidInput | Other | UnexpectedEof));
    match by_disk.map(|kind| StoreError::of(folder, "write", kind.into())) {
        Some(StoreError::Full { .. }) => no_room(),
        Some(error) => error.into(),
        None => ApiError::internal(&"the file could not be written; the log has the reason"),
    }
}

fn no_room() -> ApiError {
    let detail =
        "the service's disk has no room for the file; try again later, or decode the container yourself: cager decode";
    ApiError::new(problem::STORAGE_FULL, detail).retry_after(60)
}

/// The session's name as the name of a file.
fn file_name(name: Option<&str>, extension: &str) -> String {
    let letter = |letter: char| if letter.is_ascii_alphanumeric() || "-_".contains(letter) { letter } else { '_' };
    let stem: String = name.unwrap_or_default().chars().take(80).map(letter).collect();
    let stem = if stem.chars().all(|letter| letter == '_') { "capture" } else { &stem };
    format!("{stem}.{extension}")
}

#[cfg(test)]
mod tests {
    use super::file_name;

    #[test]
    fn names_of_files_are_plain() {
        assert_eq!(file_name(Some("walk 01"), "abc"), "walk_01.abc");
        assert_eq!(file_name(Some("../\"x\"\r\n"), "glb"), "____x___.glb");
        assert_eq!(file_name(Some("山"), "usdc"), "capture.usdc");
        assert_eq!(file_name(None, "npy"), "capture.npy");
    }
}
