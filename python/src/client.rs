//! A client of the encoding service, whose calls are awaited.

use crate::arguments;
use crate::arrays::model;
use crate::call::{Call, awaitable, blocking};
use crate::encode::Asked;
use crate::fault::Fault;
use crate::follow::Cages;
use crate::geometry::{cage_mesh, system};
use crate::kept_frames::KeptFrames;
use crate::meaning;
use crate::remote_encode::{Encoding, checked, encode};
use cager_client::ClientError;
use cager_formats::{AtomicFile, Target, commit_together};
use pyo3::prelude::*;
use serde::Serialize;
use std::path::PathBuf;

/// A client of one service.
#[pyclass(frozen, module = "cager")]
pub(crate) struct Client {
    client: cager_client::Client,
    url: String,
}

#[pymethods]
impl Client {
    #[new]
    #[pyo3(signature = (url, token=None))]
    fn new(url: String, token: Option<&str>) -> Result<Self, Fault> {
        let client = cager_client::Client::new(&url)?;
        Ok(Self { client: token.map_or(client.clone(), |token| client.with_token(token)), url })
    }

    fn __repr__(&self) -> String {
        format!("<cager.Client of {}>", self.url)
    }

    /// Encodes a capture on the service.
    #[pyo3(signature = (rest, faces, frames, cage=None, max_error=None, mean_error=None, on_progress=None, *, vertices=None, seed=0, coordinates="mvc", frame_rate=None, unit=None, up=None, start=None, times=None, force=false, name=None, keep=false))]
    #[expect(clippy::too_many_arguments, reason = "arguments with names")]
    fn encode<'py>(
        &self,
        py: Python<'py>,
        rest: &Bound<'py, PyAny>,
        faces: Option<&Bound<'py, PyAny>>,
        frames: &Bound<'py, PyAny>,
        cage: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
        max_error: Option<f64>,
        mean_error: Option<f64>,
        on_progress: Option<Py<PyAny>>,
        #[pyo3(from_py_with = arguments::vertices)] vertices: Option<usize>,
        #[pyo3(from_py_with = arguments::seed)] seed: u64,
        coordinates: &str,
        frame_rate: Option<f64>,
        unit: Option<&Bound<'py, PyAny>>,
        up: Option<&str>,
        start: Option<f64>,
        times: Option<&Bound<'py, PyAny>>,
        force: bool,
        name: Option<String>,
        keep: bool,
    ) -> Result<Bound<'py, PyAny>, Fault> {
        let rest = model(rest, faces, ["rest", "faces"])?;
        let mesh = cage.map(|(vertices, faces)| cage_mesh(&vertices, &faces)).transpose()?;
        let system = system(coordinates, "coordinates")?;
        let units = meaning::units(unit, up)?;
        let asked = Asked { max_error, mean_error, vertices, seed, system, frame_rate, units, force };
        asked.check(mesh.is_some())?;
        let frames = KeptFrames::new(frames, "frames", rest.points.len())?;
        let numbers = meaning::numbers(start, times, frames.count())?;
        let (client, url) = (self.client.clone(), self.url.clone());
        let job = Encoding { client, url, rest, mesh, frames, numbers, asked, name, keep };
        awaitable(py, move |call| encode(job, on_progress, call))
    }

    /// A session as it is now.
    fn session<'py>(&self, py: Python<'py>, id: String) -> Result<Bound<'py, PyAny>, Fault> {
        let client = self.client.clone();
        told(py, &self.url, async move { client.session(&id).await })
    }

    /// All sessions, newest first.
    fn sessions<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Fault> {
        let client = self.client.clone();
        told(py, &self.url, async move { client.sessions().await })
    }

    /// Deletes a session with all its results.
    fn delete<'py>(&self, py: Python<'py>, id: String) -> Result<Bound<'py, PyAny>, Fault> {
        let client = self.client.clone();
        told(py, &self.url, async move { client.delete(&id).await })
    }

    /// Writes the container of a completed session; it appears whole or not at all.
    #[pyo3(signature = (id, path, overwrite=false))]
    fn download<'py>(
        &self,
        py: Python<'py>,
        id: String,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        overwrite: bool,
    ) -> Result<Bound<'py, PyAny>, Fault> {
        let (client, url) = (self.client.clone(), self.url.clone());
        let download = async move {
            let mut file = AtomicFile::create(if overwrite { Target::Replacing(path) } else { Target::New(path) })?;
            client.download(&id, &mut file).await.map_err(unwritten)?;
            blocking(move || {
                file.complete()?;
                checked(file.reader()?)?;
                Ok(commit_together(vec![file])?)
            })
            .await
        };
        awaitable(py, async move |Call { mut stop, .. }: Call| {
            stop.or(download).await.map_err(|fault| fault.of_service(&url))?;
            Ok(|py: Python<'_>| Ok(py.None()))
        })
    }

    /// The cages of a session as they are solved.
    #[pyo3(signature = (id, first=0))]
    fn follow(&self, id: &str, #[pyo3(from_py_with = arguments::first)] first: u32) -> Cages {
        Cages::new(self.client.follow(id, first), self.url.clone())
    }
}

/// What a call says, in the types of JSON.
fn told<'py, T: Serialize + Send + 'static>(
    py: Python<'py>,
    url: &str,
    work: impl Future<Output = Result<T, ClientError>> + Send + 'static,
) -> Result<Bound<'py, PyAny>, Fault> {
    let url = url.to_owned();
    awaitable(py, async move |Call { mut stop, .. }: Call| {
        let said = stop.or(async { Ok(work.await?) }).await.map_err(|fault| fault.of_service(&url))?;
        let text = serde_json::to_string(&said).map_err(|error| Fault::Told(error.to_string()))?;
        Ok(move |py: Python<'_>| Ok(py.import("json")?.call_method1("loads", (text,))?.unbind()))
    })
}

/// A file that cannot be written names itself.
fn unwritten(error: ClientError) -> Fault {
    match error {
        ClientError::Output(cause) => match cause.downcast::<cager_formats::Error>() {
            Ok(named) => named.into(),
            Err(cause) => ClientError::Output(cause).into(),
        },
        error => error.into(),
    }
}
