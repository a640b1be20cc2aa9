//! Moving another model by the cages of a session.

use crate::body::{numbers, whole};
use crate::client::Client;
use crate::create::{MeshFile, part};
use crate::error::{ClientError, Failure};
use crate::results::number;
use crate::sessions::known;
use reqwest::Method;
use reqwest::header::ACCEPT;
use reqwest::multipart::Form;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Most points of a file with so many bytes: a GLB may show a mesh many times.
fn most_points(bytes: usize) -> u64 {
    (1 << 16) + 2 * bytes as u64
}

/// Another model, moved.
#[derive(Clone, Debug, PartialEq)]
pub struct MovedModel {
    /// Frames one after another, each with 3 values for every point of the model.
    pub positions: Vec<f32>,
    /// Points of the model outside the rest cage; they follow it less and less with distance.
    pub outside: u32,
    /// Points of the model beside poles of the cage's coordinates: they follow the nearest places of the session's own model.
    pub bound: u32,
}

impl Client {
    /// Moves another model that lies in the session's rest cage, such as a garment or the same model at another resolution. `cages`, edited or not, holds
    /// whole frames of m × 3 values one after another.
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] where `cages` does not hold whole frames, [`ClientError::Refused`] for a model that cannot be read or lies too far from the
    /// cage, and those of the connection.
    pub async fn decode_model(&self, id: &str, model: &MeshFile, cages: &[f32]) -> Result<MovedModel, ClientError> {
        let session = self.session(id).await?;
        let body: bytes::Bytes = cages.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.retrying(|| async {
            let frames = Self::whole_cages(cages, 3 * known(id, "unknowns", session.unknowns)? as usize)?;
            let sent = Arc::new(AtomicU64::new(0));
            let cages = MeshFile::new("cages.f32", body.clone());
            let form = Form::new().part("model", part(model, &sent)).part("cages", part(&cages, &sent));
            let request = self.request(Method::POST, &["v1", "sessions", id, "decode"], &[]).await?;
            let request = request.header(ACCEPT, "application/octet-stream").multipart(form);
            let response = self.send_counted(request, &sent).await?;
            let outside = number(response.headers(), "cager-outside")?;
            // Services before this version bind none.
            let bound = number(response.headers(), "cager-bound").unwrap_or(0);
            let most = most_points(model.bytes.len()).saturating_mul(12 * frames as u64);
            let bytes = whole(self, response, most).await?;
            if !bytes.len().is_multiple_of(12 * frames.max(1)) {
                return Err(self.broken(format!("{} bytes are no {frames} whole frames", bytes.len())));
            }
            Ok::<_, Failure>(MovedModel { positions: numbers(&bytes, f32::from_le_bytes)?, outside, bound })
        })
        .await
    }
}
