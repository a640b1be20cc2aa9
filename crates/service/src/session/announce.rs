//! What the receivers of webhooks are told of a session.

use super::{Phase, Session};
use crate::store::Kind;
use crate::webhooks::{About, Event, PendingMessage, Told};

impl Session {
    /// What messages about it are about.
    pub(super) fn about(&self) -> About {
        About { kind: Kind::Session, id: self.meta.id.clone(), tenant: self.meta.tenant.clone() }
    }

    /// Sends the stored message of a session that has ended, if some receiver has not acknowledged it. Blocks.
    pub(super) fn resend_undelivered(&self) {
        let ended = |due: &PendingMessage| match due.event {
            Event::Completed => matches!(self.status().phase, Phase::Completed(_)),
            _ => self.has_failed(),
        };
        if let Some(due) = self.webhooks.pending(&self.about()).filter(ended) {
            // The message contains frame counts; if frames cannot be read, that is logged.
            let _ = self.load();
            self.announce(due);
        }
    }

    /// Reports a failure whose message cannot be stored, because files are damaged or the disk refuses writes.
    pub(super) fn announce_unrecorded_failure(&self) {
        if let Some(due) = self.webhooks.message_for(&self.meta.tenant, Event::Failed) {
            self.announce(due);
        }
    }

    /// Sends a message to its receivers, in the background.
    pub(super) fn announce(&self, due: PendingMessage) {
        let told = Told::Session(Box::new(self.view_with(0)));
        self.webhooks.send(&self.about(), told, &self.deleted, due);
    }
}
