//! Transfers, independent of HTTP: the motion of one model moved onto another in the background, as `cager transfer` does it. What was sent is stored until
//! the job is over, so that a restart begins it again and comes to the same result.

mod create;
mod run;
mod valid_options;
mod view;

pub(crate) use create::NewTransfer;
use create::pairs_of;
pub(crate) use valid_options::check_options;
pub(crate) use view::TransferFrames;

use crate::config::ServeConfig;
use crate::jobs::{Job, Phase, Work};
use crate::problem;
use crate::store::{Store, StoredPart, TransferMeta};
use cager_proto::job_messages::JobKind;
use cager_proto::transfer_messages::TransferStage;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fs::File;
use std::sync::Arc;

/// Motions moved onto other models.
pub(crate) struct Transfer;

/// A transfer in memory.
pub(crate) type TransferJob = Job<Transfer>;

impl Work for Transfer {
    type Meta = TransferMeta;
    type Finished = Finished;
    type Progress = Progress;

    const KIND: JobKind = JobKind::Transfer;
    const NAME: &'static str = "transfer";
    const LIST: &'static str = "/v1/transfers";
    const ENDED: &'static str = "cager_transfers_total";
    const FAILED: problem::ProblemKind = problem::TRANSFER_FAILED;
    const UNFINISHED: &'static str =
        "results are written when the transfer is completed; wait until its state is completed";
    const QUEUE: &'static str = "transfer_queue";

    fn most_waiting(config: &ServeConfig) -> usize {
        config.max_transfer_queue
    }

    fn files(finished: &Finished) -> Cow<'_, [StoredPart]> {
        (&finished.files).into()
    }

    fn forget_input(store: &Store, id: &str) {
        store.forget_transfer_input(id);
    }

    fn enter(progress: &mut Progress, phase: &Phase<Finished>) {
        progress.stage = matches!(phase, Phase::Running).then_some(TransferStage::Preparing);
        progress.live = None;
    }
}

/// What is known of a transfer that is not over.
#[derive(Default)]
pub(crate) struct Progress {
    stage: Option<TransferStage>,
    /// Frames that are moved.
    moved: u32,
    /// Where these are, points × 3 numbers in double precision each.
    live: Option<Arc<File>>,
}

/// Results of a completed transfer, without its files.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct Finished {
    pub(crate) frames: u32,
    pub(crate) cage_vertices: u32,
    pub(crate) warnings: Vec<String>,
    /// The results.
    pub(crate) files: Vec<StoredPart>,
}
