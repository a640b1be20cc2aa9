//! Has a service design a cage from evenly spaced frames of a local capture.

use super::{RemoteError, RemoteProgress};
use cager_cages::{DesignOptions, Goal, Style};
use cager_capture::design::of_stages;
use cager_client::cage_messages::{CageJob, CageOptions, CageState, CageStyle};
use cager_client::{Client, ClientError, FrameSource, MeshFile, NewCage};
use cager_proto::report::{DesignReport, StageReport};
use futures_util::StreamExt as _;
use std::time::Duration;

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

/// Has the service design a cage; returns the finished design, which stays on the service. Reads
/// `frames` from the beginning.
pub(super) async fn design(
    client: &Client,
    address: &str,
    rest: &MeshFile,
    frames: &mut impl FrameSource,
    options: &DesignOptions,
    progress: &mut (dyn FnMut(RemoteProgress<'_>) + Send),
) -> Result<CageJob, RemoteError> {
    let mut new = NewCage::of_frames(rest.clone(), frames)?;
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
        seed: Some(options.seed),
        time_limit_s: options.time_limit.map(|limit| limit.as_secs_f64()),
        ..new.options
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
    of_stages(stages.collect(), job.error.unseen, options, job.sampled_frames as usize, job.timed_out)
}
