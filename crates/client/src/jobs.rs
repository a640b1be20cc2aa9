//! What jobs of all kinds share: creating and deleting them.

use crate::body::json;
use crate::client::Client;
use crate::create::{MeshFile, part, random_key};
use crate::error::{ClientError, Failure};
use cager_proto::job_messages::{Job, JobList};
use reqwest::Method;
use reqwest::multipart::{Form, Part};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Refuses options that JSON cannot hold.
///
/// # Errors
/// [`ClientError::Mismatch`].
pub(crate) fn finite<'a>(
    options: impl IntoIterator<Item = (&'static str, &'a Option<f64>)>,
) -> Result<(), ClientError> {
    for (name, value) in options {
        if let Some(value) = value.filter(|value| !value.is_finite()) {
            return Err(ClientError::Mismatch(format!("{name}: is {value}; give a finite number, or leave it out")));
        }
    }
    Ok(())
}

impl Client {
    /// Creates a job from files and options, once for a key, over as many connections as it takes.
    pub(crate) async fn create_job<T: DeserializeOwned>(
        &self,
        resource: &str,
        files: Vec<(&'static str, &MeshFile)>,
        options: &impl Serialize,
        key: Option<String>,
    ) -> Result<T, ClientError> {
        let key = key.unwrap_or_else(random_key);
        let options =
            serde_json::to_string(options).map_err(|error| ClientError::Mismatch(format!("the options: {error}")))?;
        let bytes = files.iter().map(|(_, file)| file.bytes.len() as u64).sum();
        self.retrying(|| async {
            let sent = Arc::new(AtomicU64::new(0));
            let options = Part::text(options.clone()).mime_str("application/json");
            let form = Form::new().part("options", options.map_err(|error| self.network(&error))?);
            let form = files.iter().fold(form, |form, (name, file)| form.part(*name, part(file, &sent)));
            let request = self.request(Method::POST, &["v1", resource], &[]).await?;
            let request = request.header("Idempotency-Key", &key).multipart(form);
            let made: T = json(self, self.send_for_work(request, &sent, bytes).await?).await?;
            Ok::<_, Failure>(made)
        })
        .await
    }

    /// Designs, recoveries and transfers, newest first, page after page.
    ///
    /// # Errors
    /// Those of the connection.
    pub async fn jobs(&self) -> Result<Vec<Job>, ClientError> {
        self.pages("jobs", |JobList { jobs, next }| (jobs, next)).await
    }

    /// Deletes a job, once, over as many connections as it takes.
    pub(crate) async fn delete_job(&self, resource: &str, id: &str) -> Result<(), ClientError> {
        let asked = AtomicBool::new(false);
        self.retrying(|| async {
            let request = self.request(Method::DELETE, &["v1", resource, id], &[]).await?;
            let again = asked.swap(true, Ordering::Relaxed);
            match self.send(request).await {
                // An earlier attempt deleted it, and its answer was lost.
                Err(failure) if again && failure.status() == Some(404) => Ok(()),
                answer => answer.map(drop),
            }
        })
        .await
    }
}
