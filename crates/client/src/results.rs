//! Downloading the results of preparing and solving.

use crate::body::{numbers, whole};
use crate::client::Client;
use crate::error::{ClientError, Failure};
use crate::sessions::known;
use cager_proto::messages::{FrameErrors, FrameResult, RestCage};
use reqwest::header::{ACCEPT, HeaderMap};
use reqwest::{Method, Response};

/// Largest possible body of handle indices, in bytes.
const MAX_HANDLE_BYTES: u64 = 4 * u32::MAX as u64;

/// The coordinates `Φ` of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinates {
    /// Points of the model, n.
    pub rows: usize,
    /// Values of a cage: its unknowns m, and its face normals where they follow from them.
    pub columns: usize,
    /// `Φ`, row-major.
    pub values: Vec<f32>,
}

impl Client {
    /// Errors of all solved frames as fractions of the rest diagonal, ascending by frame.
    ///
    /// # Errors
    /// Those of the connection.
    pub async fn errors(&self, id: &str) -> Result<Vec<FrameResult>, ClientError> {
        let errors: FrameErrors = self.fetch(Method::GET, &["v1", "sessions", id, "errors"], &[]).await?;
        Ok(errors.frames)
    }

    /// Indices of the points that the inversion reads, in the order of the rows of a frame with
    /// [`Rows::Handles`](crate::Rows::Handles).
    ///
    /// # Errors
    /// [`ClientError::Refused`] where the session has none yet, and those of the connection.
    pub async fn handles(&self, id: &str) -> Result<Vec<u32>, ClientError> {
        self.retrying(|| async {
            let response = self.octets(&["v1", "sessions", id, "handles"]).await?;
            numbers(&whole(self, response, MAX_HANDLE_BYTES).await?, u32::from_le_bytes)
        })
        .await
    }

    /// The coordinates that turn cages into positions: `P = Φ·C`, or where there are more columns than unknowns, with the face
    /// normals that follow from them in addition: see `LocalDecoder`.
    ///
    /// # Errors
    /// [`ClientError::Refused`] where the session has none yet, and those of the connection.
    pub async fn coordinates(&self, id: &str) -> Result<Coordinates, ClientError> {
        let session = self.session(id).await?;
        self.retrying(|| async {
            let rows = known(id, "points", session.points)?;
            let unknowns = known(id, "unknowns", session.unknowns)?;
            let response = self.octets(&["v1", "sessions", id, "coordinates"]).await?;
            let found = number(response.headers(), "cager-rows")?;
            if found != rows {
                return Err(Failure::protocol(format!("cager-rows is {found}, but the session says {rows}")));
            }
            let columns = number(response.headers(), "cager-columns")?;
            let all = session.cage_vertices.unwrap_or(0).saturating_add(session.cage_faces.unwrap_or(0));
            if columns != unknowns && columns != all {
                let what = format!("cager-columns is {columns}, but the session says {unknowns} unknowns");
                return Err(Failure::protocol(what));
            }
            let bytes = bytes_of([4, u64::from(rows), u64::from(columns)])?;
            let body = whole(self, response, bytes).await?;
            if body.len() as u64 != bytes {
                return Err(Failure::protocol(format!("{} bytes are not {rows} × {columns} coordinates", body.len())));
            }
            let values = numbers(&body, f32::from_le_bytes)?;
            Ok(Coordinates { rows: rows as usize, columns: columns as usize, values })
        })
        .await
    }

    /// The rest cage: where normals follow from vertices, decoding needs it.
    ///
    /// # Errors
    /// [`ClientError::Refused`] where the session is not ready, and those of the connection.
    pub async fn cage(&self, id: &str) -> Result<RestCage, ClientError> {
        let session = self.session(id).await?;
        self.retrying(|| async {
            let vertices = known(id, "cage_vertices", session.cage_vertices)?;
            let faces = known(id, "cage_faces", session.cage_faces)?;
            let response = self.octets(&["v1", "sessions", id, "cage"]).await?;
            let bytes = 24 * u64::from(vertices) + 12 * u64::from(faces);
            let body = whole(self, response, bytes).await?;
            if body.len() as u64 != bytes {
                let what = format!("{} bytes are no cage of {vertices} vertices and {faces} faces", body.len());
                return Err(Failure::protocol(what));
            }
            let (points, corners) = body.split_at(24 * vertices as usize);
            let vertices = numbers(points, f64::from_le_bytes)?.as_chunks().0.to_vec();
            let faces = numbers(corners, u32::from_le_bytes)?.as_chunks().0.to_vec();
            Ok(RestCage { vertices, faces })
        })
        .await
    }

    /// A resource as bytes.
    async fn octets(&self, segments: &[&str]) -> Result<Response, Failure> {
        let request = self.request(Method::GET, segments, &[]).await?;
        self.send(request.header(ACCEPT, "application/octet-stream")).await
    }

    /// Positions of the model from cages, edited or not, by the service: `cages` holds whole frames of m × 3 values one after
    /// another, the result as many of n × 3. For many frames, call it for some at a time, or see
    /// `LocalDecoder`.
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] where `cages` does not hold whole frames, and those of the connection.
    pub async fn decode(&self, id: &str, cages: &[f32]) -> Result<Vec<f32>, ClientError> {
        let session = self.session(id).await?;
        let body: bytes::Bytes = cages.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.retrying(|| async {
            let frame = 3 * known(id, "unknowns", session.unknowns)? as usize;
            let points = known(id, "points", session.points)?;
            let frames = Self::whole_cages(cages, frame)?;
            let request = self.request(Method::POST, &["v1", "sessions", id, "decode"], &[]).await?;
            let request = request
                .header("content-type", "application/octet-stream")
                .header(ACCEPT, "application/octet-stream")
                .body(body.clone());
            let expected = bytes_of([12, u64::from(points), frames as u64])?;
            let positions = whole(self, self.send(request).await?, expected).await?;
            if positions.len() as u64 != expected {
                return Err(self.broken(format!("{} of {expected} bytes came", positions.len())));
            }
            numbers(&positions, f32::from_le_bytes)
        })
        .await
    }

    /// Number of cages of `frame` values each.
    pub(crate) fn whole_cages(cages: &[f32], frame: usize) -> Result<usize, ClientError> {
        if frame == 0 || !cages.len().is_multiple_of(frame) {
            let what = format!("{} values are no whole cages of {frame} each; give whole frames", cages.len());
            return Err(ClientError::Mismatch(what));
        }
        Ok(cages.len() / frame)
    }
}

pub(crate) fn number(headers: &HeaderMap, name: &str) -> Result<u32, Failure> {
    let value = headers.get(name).and_then(|value| value.to_str().ok()?.parse().ok());
    value.ok_or_else(|| Failure::protocol(format!("the header {name} is missing or no number")))
}

/// Product of sizes claimed by the service, checked for overflow.
fn bytes_of(factors: [u64; 3]) -> Result<u64, Failure> {
    let bytes = factors.into_iter().try_fold(1u64, u64::checked_mul);
    bytes.ok_or_else(|| Failure::protocol("it says that it has more numbers than there can be"))
}
