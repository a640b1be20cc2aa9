//! Entry points for fuzz targets into request parsing. They panic if an invariant is violated.

use super::cage_jobs;
use super::frame_parser::{BodyLayout, FrameReader};
use super::ranged::Immutable;
use super::sessions;
use crate::admission::{Budget, Permit};
use crate::preparation::ValidOptions;
use crate::problem::ApiError;
use crate::service::Service;
use crate::session::create::NewSession;
use crate::session::facts::Facts;
use axum::body::Body;
use axum::extract::Request;
use axum::response::Response;
use bytes::Bytes;
use cager_core::inversion::Rows;
use cager_proto::messages::{CacheUse, ConditionNumber, PreparationSeconds};
use http::{HeaderMap, HeaderValue, header};
use std::io;
use std::sync::Arc;

/// Number of a frame, whether it has handle rows only, and its bytes.
pub type Frame = (u32, bool, Vec<u8>);

/// Layout of the frames in a body.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// Number of the first raw frame; None where they are records.
    pub first: Option<u32>,
    /// Whether raw frames have handle rows only.
    pub handle_rows: bool,
    /// Points of the session.
    pub points: u32,
    /// Handles of the session.
    pub handles: u32,
}

impl Frames {
    /// All frames of a body given in pieces, and the error that would end the response.
    pub fn read<'a>(self, pieces: impl Iterator<Item = &'a [u8]>) -> (Vec<Frame>, Result<(), ApiError>) {
        let rows = if self.handle_rows { Rows::Handles } else { Rows::All };
        let layout = self.first.map_or(BodyLayout::Records, |first| BodyLayout::Raw { first, rows });
        let mut reader = FrameReader::new(layout, &facts(self.points, self.handles));
        let mut frames = Vec::new();
        for mut piece in pieces {
            while !piece.is_empty() {
                let before = piece.len();
                match reader.push(&mut piece) {
                    Ok(Some(frame)) => frames.push((frame.frame, frame.rows == Rows::Handles, frame.bytes)),
                    Ok(None) => assert!(piece.len() < before, "nothing was taken of {before} bytes"),
                    Err(error) => return (frames, Err(error)),
                }
            }
        }
        let end = reader.finish();
        (frames, end)
    }
}

fn facts(points: u32, handle_count: u32) -> Facts {
    Facts {
        points,
        handles_digest: String::new(),
        unknowns: handle_count,
        handle_count,
        reads_handles_only: true,
        cage_vertices: handle_count,
        cage_faces: handle_count,
        spectrum: 0,
        condition_number: ConditionNumber { full: 1.0, handles: 1.0 },
        rank: handle_count,
        affine_reproduction_error: 0.0,
        cache: CacheUse::Miss,
        seconds: PreparationSeconds::default(),
        warnings: Vec::new(),
    }
}

/// Reads the multipart body that makes a session, and checks its options; gives the bytes of rest pose and cage.
///
/// # Errors
/// What the client would hear.
pub async fn new_session(
    service: &Arc<Service>,
    content_type: HeaderValue,
    pieces: Vec<Bytes>,
) -> Result<(usize, usize), ApiError> {
    let body = Body::from_stream(futures_util::stream::iter(pieces.into_iter().map(Ok::<_, io::Error>)));
    let mut request = Request::new(body);
    request.headers_mut().insert(header::CONTENT_TYPE, content_type);
    let tenant = service.access.tenant("local");
    let NewSession { uploaded, options, .. } = sessions::read(service, &tenant, request).await?;
    ValidOptions::of(&options)?;
    Ok((uploaded.rest.bytes.len(), uploaded.cage.map_or(0, |cage| cage.bytes.len())))
}

/// Reads the multipart body that asks for a cage; gives the bytes of rest pose and frames.
///
/// # Errors
/// What the client would hear.
pub async fn new_cage(
    service: &Arc<Service>,
    content_type: HeaderValue,
    pieces: Vec<Bytes>,
) -> Result<(usize, u64), ApiError> {
    let body = Body::from_stream(futures_util::stream::iter(pieces.into_iter().map(Ok::<_, io::Error>)));
    let mut request = Request::new(body);
    request.headers_mut().insert(header::CONTENT_TYPE, content_type);
    let tenant = service.access.tenant("local");
    let (new, _) = cage_jobs::create::read(service, &tenant, request).await?;
    Ok((new.rest.len(), new.frames.bytes()))
}

/// The response to a request for bytes that never change.
///
/// # Errors
/// What the client would hear.
pub fn immutable(content: Bytes, etag: &str, headers: &HeaderMap) -> Result<Response, ApiError> {
    let bytes = Immutable {
        length: content.len() as u64,
        etag: etag.to_owned(),
        media_type: "application/octet-stream",
        public: false,
        room: Permit::empty(&Budget::new(u64::MAX, false), ""),
        read: Arc::new(move |range| Ok(content.slice(range.start as usize..range.end as usize))),
    };
    let mut response = bytes.respond(headers);
    response.extensions_mut().remove::<ApiError>().map_or(Ok(response), Err)
}
