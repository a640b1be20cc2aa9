//! What is told of a job whatever its kind: in the list of all, and to those who want to know when one ends.

use super::{Job, Phase, Run, Work, kind_of};
use crate::service::Service;
use crate::store::{JobMeta as _, RecordMeta as _};
use crate::webhooks::{About, Event, PendingMessage, Told};
use cager_proto::job_messages::Job as View;
use cager_proto::messages::JobState;

impl<W: Work> Job<W> {
    /// The job as lists of all kinds have it.
    pub(crate) fn summary(&self) -> View {
        let (state, detail) = match self.phase() {
            Phase::Running if !W::is_idle(&self.status()) => (JobState::Running, None),
            Phase::Waiting | Phase::Running => (JobState::Queued, None),
            Phase::Completed(_) => (JobState::Completed, None),
            Phase::Failed(problem) => (JobState::Failed, Some(problem.detail)),
        };
        View {
            kind: W::KIND,
            id: self.id().to_owned(),
            name: self.meta.name().map(str::to_owned),
            state,
            created: self.meta.created_ms() as f64 / 1e3,
            url: format!("{}/{}", W::LIST, self.id()),
            detail,
        }
    }

    /// What messages about it are about.
    pub(super) fn about(&self) -> About {
        About { kind: kind_of::<W>(), id: self.id().to_owned(), tenant: self.meta.tenant().to_owned() }
    }
}

impl Service {
    /// Sends a message about a job that is over to its receivers, in the background.
    pub(super) fn announce<W: Work>(&self, job: &Job<W>, due: PendingMessage) {
        self.webhooks.send(&job.about(), Told::Job(job.summary()), job.deleted(), due);
    }

    /// Sends the stored message about a job that is over, if some receiver has not acknowledged it. Blocks.
    pub(super) fn resend_undelivered<W: Run>(&self, job: &Job<W>) {
        let ended = |due: &PendingMessage| match job.phase() {
            Phase::Completed(_) => due.event == Event::JobCompleted,
            Phase::Failed(_) => due.event == Event::JobFailed,
            Phase::Waiting | Phase::Running => false,
        };
        if let Some(due) = self.webhooks.pending(&job.about()).filter(ended) {
            self.announce(job, due);
        }
    }

    /// Sends a message that is not stored: of a job that was completed when it was made, or that a restart begins
    /// again.
    pub(crate) fn announce_unrecorded<W: Work>(&self, job: &Job<W>, event: Event) {
        if let Some(due) = self.webhooks.message_for(job.meta.tenant(), event) {
            self.announce(job, due);
        }
    }
}
