//! Has a service design a cage from evenly spaced frames of a local capture.

use super::{RemoteError, RemoteProgress};
use cager_cages::{DesignOptions, Goal, Style};
use cager_capture::design::of_stages;
use cager_client::cage_messages::{CageJob, CageOptions, CageState, CageStyle};
use cager_client::{Client, ClientError, FrameSource, MeshFile, NewCage};
use cager_proto::report::{DesignReport, StageReport};
use futures_util::StreamExt as _;
use std::io;
use std::time::Duration;

/// Most frames sent; a design samples no more.
const MAX_SAMPLED_FRAMES: u32 = 160;
/// Most bytes of frames sent, unless two frames are larger.
const MAX_SAMPLE_BYTES: usize = 512 << 20;
/// Longest wait for a design, its turn included.
const DESIGN_TIMEOUT: Duration = Duration::from_secs(3600);

/// Where the cage of a capture comes from.
#[derive(Clone, Copy, Debug)]
pub enum RemoteCage<'a> {
    /// This file.
    File(&'a std::path::Path),
    /// These bytes of a file.
    Mesh(&'a MeshFile),
    /// The service designs it from the capture.
    Designed(&'a DesignOptions),
}

/// Has the service design a cage; returns the finished design, which stays on the service. Reads `frames` from the beginning.
pub(super) async fn design(
    client: &Client,
    address: &str,
    rest: &MeshFile,
    frames: &mut impl FrameSource,
    options: &DesignOptions,
    progress: &mut (dyn FnMut(RemoteProgress<'_>) + Send),
) -> Result<CageJob, RemoteError> {
    let (count, bytes) = sample(frames)?;
    let mut new = NewCage::new(rest.clone(), MeshFile::new("frames.f32", bytes));
    let (vertices, mean_error) = match options.goal {
        Goal::Vertices(vertices) => (Some(u32::try_from(vertices).unwrap_or(u32::MAX)), None),
        Goal::MeanError(error) => (None, Some(error)),
    };
    let style = match options.style {
        Style::Free => CageStyle::Free,
        Style::Editable => CageStyle::Editable,
    };
    new.options = CageOptions {
        vertices,
        mean_error,
        style: Some(style),
        frames: Some(count),
        seed: Some(options.seed),
        time_limit_s: options.time_limit.map(|limit| limit.as_secs_f64()),
        ..CageOptions::default()
    };
    let id = client.design_cage(&new).await?.id;
    drop(new);
    progress(RemoteProgress::Design(&id));
    match follow(client, &id, progress).await {
        Ok(job) => Ok(job),
        // There is nothing to look at, and the error says it all.
        Err(error @ RemoteError::Client(ClientError::NoCage(_))) => {
            super::clean_up(client, async |client| client.delete_cage(&id).await).await;
            Err(error)
        }
        Err(error) => Err(RemoteError::of_design(error, &id, address)),
    }
}

async fn follow(
    client: &Client,
    id: &str,
    progress: &mut (dyn FnMut(RemoteProgress<'_>) + Send),
) -> Result<CageJob, RemoteError> {
    let mut events = client.cage_events(id);
    while let Some(told) = events.next().await {
        let told = told?;
        progress(RemoteProgress::Designing(&told));
        if told.state == CageState::Completed {
            break;
        }
    }
    // The final state, with the reason if the design failed.
    Ok(client.wait_cage(id, DESIGN_TIMEOUT).await?)
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

/// What is worth telling of a design that a service made.
pub(super) fn report_of_job(job: &CageJob, options: &DesignOptions) -> DesignReport {
    let stages = job.stages.iter().map(|stage| StageReport {
        name: stage.name.clone(),
        vertices: stage.vertices as usize,
        designed_error: stage.error.designed.unwrap_or(0.0),
        held_back_error: stage.error.held_back.unwrap_or(0.0),
        condition_number: stage.condition_number,
        singular: stage.singular,
        seconds: stage.seconds,
    });
    of_stages(stages.collect(), options, job.sampled_frames as usize, job.timed_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_client::MemoryFrames;

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
