//! Creating a session: two files and some choices in one request.

use crate::body::json;
use crate::client::Client;
use crate::error::{ClientError, Failure};
use bytes::Bytes;
use cager_proto::messages::{Session, SessionOptions};
use futures_util::stream;
use reqwest::multipart::{Form, Part};
use reqwest::{Body, Method};
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of a file handed to the connection at once.
const CHUNK_BYTES: usize = 256 << 10;

/// A file, above all of a mesh: its bytes, and a name whose extension tells the format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFile {
    /// File name, such as `rest.obj`.
    pub name: String,
    /// Contents.
    pub bytes: Bytes,
}

impl MeshFile {
    /// A file of this name with these contents.
    pub fn new(name: impl Into<String>, bytes: impl Into<Bytes>) -> Self {
        Self { name: name.into(), bytes: bytes.into() }
    }
}

/// What a session is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct NewSession {
    /// The model in its rest pose.
    pub rest: MeshFile,
    /// The cage around it; without one the service makes one, or takes a designed one, as [`SessionOptions::cage`] says.
    pub cage: Option<MeshFile>,
    /// The matrix of the regularizer `matrix`: a file in the Matrix Market format.
    pub regularizer_matrix: Option<MeshFile>,
    /// Choices; what is left out has the service's default.
    pub options: SessionOptions,
    /// Makes the request idempotent; random if not given. A key stored by the caller lets a restarted program find its session again.
    pub idempotency_key: Option<String>,
}

impl NewSession {
    /// A session of a model and its cage with the service's defaults.
    pub fn new(rest: MeshFile, cage: MeshFile) -> Self {
        Self {
            rest,
            cage: Some(cage),
            regularizer_matrix: None,
            options: SessionOptions::default(),
            idempotency_key: None,
        }
    }
}

impl Client {
    /// Creates a session. It prepares in the background, see [`Client::wait_ready`].
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] for an option that is NaN or infinite, [`ClientError::Refused`] for bad geometry or options, and
    /// those of the connection.
    pub async fn create(&self, new: &NewSession) -> Result<Session, ClientError> {
        refuse_not_finite(&new.options)?;
        let key = new.idempotency_key.clone().unwrap_or_else(random_key);
        let options = serde_json::to_string(&new.options)
            .map_err(|error| ClientError::Mismatch(format!("the options: {error}")))?;
        let files = [Some(&new.rest), new.cage.as_ref(), new.regularizer_matrix.as_ref()];
        let bytes = files.into_iter().flatten().map(|file| file.bytes.len() as u64).sum();
        self.retrying(|| async {
            let sent = Arc::new(AtomicU64::new(0));
            let options = Part::text(options.clone()).mime_str("application/json");
            let mut form = Form::new()
                .part("options", options.map_err(|error| self.network(&error))?)
                .part("rest", part(&new.rest, &sent));
            if let Some(cage) = &new.cage {
                form = form.part("cage", part(cage, &sent));
            }
            if let Some(matrix) = &new.regularizer_matrix {
                form = form.part("regularizer_matrix", part(matrix, &sent));
            }
            let request = self.request(Method::POST, &["v1", "sessions"], &[]).await?;
            let request = request.header("Idempotency-Key", &key).multipart(form);
            // The answer comes when a cage is made, where none was sent.
            let session: Session = json(self, self.send_for_work(request, &sent, bytes).await?).await?;
            Ok::<_, Failure>(session)
        })
        .await
    }
}

/// JSON cannot represent them: they would be sent as `null`, and the service would use its default.
fn refuse_not_finite(options: &SessionOptions) -> Result<(), ClientError> {
    let SessionOptions {
        name: _,
        coordinates: _,
        handles: _,
        handle_count: _,
        regularizer: _,
        spectrum: _,
        lambda,
        cage: _,
        flip_cage: _,
        frame_rate,
        frames: _,
        max_error,
        mean_error,
        target_size: _,
        quality: _,
        exact_rest: _,
    } = options;
    let numbers =
        [("lambda", lambda), ("frame_rate", frame_rate), ("max_error", max_error), ("mean_error", mean_error)];
    for (name, value) in numbers {
        if let Some(value) = value.filter(|value| !value.is_finite()) {
            return Err(ClientError::Mismatch(format!("{name}: is {value}; give a finite number, or leave it out")));
        }
    }
    Ok(())
}

pub(crate) fn part(file: &MeshFile, sent: &Arc<AtomicU64>) -> Part {
    let length = file.bytes.len() as u64;
    let sent = Arc::clone(sent);
    let chunks = stream::unfold(file.bytes.clone(), move |mut rest| {
        let chunk = rest.split_to(rest.len().min(CHUNK_BYTES));
        sent.fetch_add(chunk.len() as u64, Ordering::Relaxed);
        async move { (!chunk.is_empty()).then_some((Ok::<_, Infallible>(chunk), rest)) }
    });
    Part::stream_with_length(Body::wrap_stream(chunks), length).file_name(plain_name(&file.name))
}

/// The service wants the extension; other letters are written in so many ways in a form that some servers lose them.
fn plain_name(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_') { c } else { '_' }).collect()
}

pub(crate) fn random_key() -> String {
    format!("{:032x}", fastrand::u128(..))
}
