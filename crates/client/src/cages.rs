//! Cage designs: requesting, following and downloading.

use crate::client::Client;
use crate::create::MeshFile;
use crate::error::ClientError;
use crate::events::{Events, EventsOf};
use crate::jobs::finite;
use crate::source::FrameSource;
use bytes::Bytes;
use cager_proto::cage_messages::{CageJob, CageJobList, CageOptions, CageProgress, CageState};
use cager_proto::messages::Problem;
use futures_util::stream::BoxStream;
use reqwest::Method;
use std::io;
use std::time::{Duration, Instant};

/// Polling intervals of [`Client::wait_cage`].
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const MAX_PAUSE: Duration = Duration::from_secs(2);

/// Most frames sent; a design samples no more.
const MAX_SAMPLED_FRAMES: u32 = 160;

/// Most bytes of frames sent, unless two frames are larger.
const MAX_SAMPLE_BYTES: usize = 512 << 20;

/// What a cage is designed from.
#[derive(Clone, Debug, PartialEq)]
pub struct NewCage {
    /// The model in its rest pose.
    pub rest: MeshFile,
    /// Frames of its motion: a file whose name ends in `.npy`, or raw little-endian f32, whose number
    /// [`CageOptions::frames`] says. Evenly spaced ones, 160 at most, are enough.
    pub frames: MeshFile,
    /// Choices; what is left out has the service's default.
    pub options: CageOptions,
    /// Makes the request idempotent; random if not given.
    pub idempotency_key: Option<String>,
}

impl NewCage {
    /// A cage with the service's defaults.
    pub fn new(rest: MeshFile, frames: MeshFile) -> Self {
        Self { rest, frames, options: CageOptions::default(), idempotency_key: None }
    }

    /// A cage designed from evenly spaced frames of a capture, the first and the last among them. `frames` is read from the beginning and
    /// left there.
    ///
    /// # Errors
    /// [`ClientError::Source`].
    pub fn of_frames(rest: MeshFile, frames: &mut impl FrameSource) -> Result<Self, ClientError> {
        let (count, bytes) = sample(frames)?;
        let options = CageOptions { frames: Some(count), ..CageOptions::default() };
        Ok(Self { options, ..Self::new(rest, MeshFile::new("frames.f32", bytes)) })
    }
}

impl Client {
    /// Requests a cage design. It runs in the background, see [`Client::wait_cage`] and [`Client::cage_events`]; a session uses the cage by
    /// [`SessionOptions::cage`](cager_proto::messages::SessionOptions::cage).
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] for an option that is NaN or infinite, [`ClientError::Refused`] for bad input, and those of the
    /// connection.
    pub async fn design_cage(&self, new: &NewCage) -> Result<CageJob, ClientError> {
        finite([("mean_error", &new.options.mean_error), ("time_limit_s", &new.options.time_limit_s)])?;
        let files = vec![("rest", &new.rest), ("frames", &new.frames)];
        self.create_job("cages", files, &new.options, new.idempotency_key.clone()).await
    }

    /// A cage design as it is now.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn cage_job(&self, id: &str) -> Result<CageJob, ClientError> {
        self.fetch(Method::GET, &["v1", "cages", id], &[]).await
    }

    /// All cage designs, newest first, page after page.
    ///
    /// # Errors
    /// Those of the connection.
    pub async fn cage_jobs(&self) -> Result<Vec<CageJob>, ClientError> {
        let mut all = Vec::new();
        let mut query = Vec::new();
        loop {
            let page: CageJobList = self.fetch(Method::GET, &["v1", "cages"], &query).await?;
            let grew = !page.cages.is_empty();
            all.extend(page.cages);
            match page.next {
                None => return Ok(all),
                // An empty page with a `next` would loop for ever.
                Some(_) if !grew => return Err(ClientError::Protocol("its list of cages has no end".to_owned())),
                Some(next) => query = vec![("after", next)],
            }
        }
    }

    /// Progress of a design as it happens, until the cage is there or cannot be; that is the last item. A broken connection is taken up
    /// again after the last event.
    ///
    /// An error, such as [`ClientError::Refused`] for a design that was deleted, ends the stream.
    pub fn cage_events(&self, id: &str) -> BoxStream<'static, Result<CageProgress, ClientError>> {
        let is_last = |progress: &CageProgress| progress.state.is_final();
        Events::stream(self, EventsOf { resource: "cages", id: id.to_owned() }, is_last)
    }

    /// Waits until a cage is designed.
    ///
    /// # Errors
    /// [`ClientError::NoCage`] with the reason where none could be, [`ClientError::NotDesigned`] after `limit`, and those of the
    /// connection.
    pub async fn wait_cage(&self, id: &str, limit: Duration) -> Result<CageJob, ClientError> {
        let clock = Instant::now();
        let mut pause = FIRST_PAUSE;
        loop {
            let job = self.cage_job(id).await?;
            match job.state {
                CageState::Completed => return Ok(job),
                CageState::Failed => return Err(ClientError::NoCage(Box::new(reason(job)))),
                CageState::Queued | CageState::Running => {}
            }
            let waited = clock.elapsed();
            if waited >= limit {
                return Err(ClientError::NotDesigned { id: id.to_owned(), waited });
            }
            tokio::time::sleep(pause.min(limit - waited)).await;
            pause = pause.mul_f64(1.25).min(MAX_PAUSE);
        }
    }

    /// The best cage of a design so far, and in the end its result: an OBJ file.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 where there is none yet, and those of the connection.
    pub async fn cage_obj(&self, id: &str) -> Result<Bytes, ClientError> {
        self.retrying(|| async {
            let request = self.request(Method::GET, &["v1", "cages", id, "cage.obj"], &[]).await?;
            let response = self.send(request).await?;
            response.bytes().await.map_err(|error| self.network(&error))
        })
        .await
    }

    /// Deletes a cage design; one that runs stops. Sessions that took its cage keep it.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 404 for an unknown id, and those of the connection.
    pub async fn delete_cage(&self, id: &str) -> Result<(), ClientError> {
        self.delete_job("cages", id).await
    }
}

/// Why there is no cage.
fn reason(job: CageJob) -> Problem {
    job.problem.unwrap_or_else(|| Problem {
        kind: "about:blank".to_owned(),
        title: "No cage could be designed".to_owned(),
        detail: "the service does not say why; look at its log".to_owned(),
        ..Problem::default()
    })
}

/// Number and bytes of evenly spaced frames, including the first and the last.
fn sample(frames: &mut impl FrameSource) -> Result<(u32, Vec<u8>), ClientError> {
    let frame_bytes = 12 * frames.points().max(1);
    let most = u32::try_from(MAX_SAMPLE_BYTES / frame_bytes).unwrap_or(u32::MAX).clamp(2, MAX_SAMPLED_FRAMES);
    let all = match frames.frames() {
        Some(all) => all,
        None => counted(frames)?,
    };
    let count = all.min(most);
    let mut bytes = Vec::with_capacity(count as usize * frame_bytes);
    let mut values = Vec::new();
    for k in 0..count {
        let wanted = if count > 1 { u64::from(k) * u64::from(all - 1) / u64::from(count - 1) } else { 0 };
        let frame = wanted as u32;
        let failed = |cause| ClientError::Source { frame, cause };
        frames.seek(frame).map_err(failed)?;
        if !frames.read(&mut values).map_err(failed)? {
            let what = format!("frame {frame} is not there any more; get the capture again");
            return Err(failed(io::Error::other(what)));
        }
        bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
    }
    frames.seek(0).map_err(|cause| ClientError::Source { frame: 0, cause })?;
    Ok((count, bytes))
}

/// Counts the frames of a source of unknown length by reading it.
fn counted(frames: &mut impl FrameSource) -> Result<u32, ClientError> {
    let (mut frame, mut values) = (0, Vec::new());
    frames.seek(0).map_err(|cause| ClientError::Source { frame, cause })?;
    while frames.read(&mut values).map_err(|cause| ClientError::Source { frame, cause })? {
        frame += 1;
    }
    Ok(frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::MemoryFrames;

    #[test]
    fn frames_are_sampled_evenly_from_the_first_to_the_last() {
        let values: Vec<f32> = (0..400).flat_map(|t| [t as f32; 6]).collect();
        let (count, bytes) = sample(&mut MemoryFrames::new(2, values)).expect("frames");
        assert_eq!((count, bytes.len()), (160, 160 * 24));
        let first = |frame: usize| f32::from_le_bytes(bytes[24 * frame..][..4].try_into().expect("four bytes"));
        assert_eq!([first(0), first(159)], [0.0, 399.0]);
        assert!((1..160).all(|k| (2.0..=3.0).contains(&(first(k) - first(k - 1)))));
        let (count, _) = sample(&mut MemoryFrames::new(2, vec![0.0; 18])).expect("frames");
        assert_eq!(count, 3);
    }
}
