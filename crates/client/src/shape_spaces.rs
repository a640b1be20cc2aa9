//! Shape spaces: poses of one model, and the shapes between them.

use crate::body::{numbers, whole};
use crate::client::Client;
use crate::create::MeshFile;
use crate::error::ClientError;
use cager_proto::shape_messages::{ShapeSpace, ShapeSpaceOptions};
use reqwest::Method;

/// Longest body of a shape: that of 80 million points.
const POSE_BYTES: u64 = 1 << 30;

impl Client {
    /// Makes a shape space of poses that are meshes, perhaps on a cage of yours; or, without poses, of what the options name.
    ///
    /// # Errors
    /// [`ClientError::Refused`] for poses that do not go together, and those of the connection.
    pub async fn create_shape_space(
        &self,
        poses: &[MeshFile],
        cage: Option<&MeshFile>,
        options: &ShapeSpaceOptions,
    ) -> Result<ShapeSpace, ClientError> {
        let files = poses.iter().map(|pose| ("pose", pose)).chain(cage.map(|cage| ("cage", cage))).collect();
        self.create_job("shapespaces", files, options, None).await
    }

    /// The shape with these weights, one for each pose: x y z of every point.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 422 for weights that name no shape, 404 for a shape space that is unknown or was forgotten, and those of the
    /// connection.
    pub async fn pose(&self, id: &str, weights: &[f64]) -> Result<Vec<f32>, ClientError> {
        let weights: Vec<String> = weights.iter().map(ToString::to_string).collect();
        let query = [("weights", weights.join(","))];
        self.retrying(|| async {
            let request = self.request(Method::GET, &["v1", "shapespaces", id, "pose"], &query).await?;
            numbers(&whole(self, self.send(request).await?, POSE_BYTES).await?, f32::from_le_bytes)
        })
        .await
    }

    /// Forgets a shape space.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn delete_shape_space(&self, id: &str) -> Result<(), ClientError> {
        self.delete_job("shapespaces", id).await
    }
}
