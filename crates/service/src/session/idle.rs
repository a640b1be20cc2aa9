//! Forgetting what sessions that nobody uses keep in memory. All of it is stored, and read again when it is asked for.

use super::Session;
use super::frames::Frames;
use super::groups::Groups;
use super::registry::Registry;
use crate::sync::lock;
use std::sync::Arc;
use std::sync::atomic::{Ordering, fence};
use std::time::{Duration, Instant};

/// How long the frames of a session stay in memory that nobody asks for: lists of sessions ask for those that they show.
pub(crate) const IDLE: Duration = Duration::from_secs(600);

impl Session {
    /// Says that somebody uses it now.
    pub(super) fn used(&self) {
        *lock(&self.last_used) = Instant::now();
    }

    /// Forgets what coding keeps in memory of a session that nobody uses.
    pub(crate) fn forget_if_idle(&self) {
        if lock(&self.lane).strong_count() == 0 && !lock(&self.waiting).busy {
            self.forget_coder();
        }
    }

    /// Takes its frames out of memory, which are loaded again when they are needed; `is_used` says whether anybody has the session. `None` where there are
    /// none, or it is used.
    fn unload(&self, is_used: impl Fn() -> bool) -> Option<(Frames, Groups)> {
        let appending = self.appending.try_lock().ok()?;
        let is_at_work = *appending || lock(&self.lane).strong_count() > 0 || lock(&self.waiting).busy;
        if is_at_work
            || is_used()
            || !self.loaded.load(Ordering::Acquire)
            || self.has_failed()
            || self.facts().is_none()
        {
            return None;
        }
        let (mut frames, mut groups) = (self.frames.try_lock().ok()?, self.groups.try_lock().ok()?);
        // Who comes by now waits for the first lock, and loads them.
        self.loaded.store(false, Ordering::SeqCst);
        fence(Ordering::SeqCst);
        if is_used() || frames.is_pending() || frames.is_empty() || !groups.are_stored() {
            self.loaded.store(true, Ordering::SeqCst);
            return None;
        }
        let is_sealed = frames.is_sealed();
        let taken = (std::mem::take(&mut *frames), std::mem::take(&mut *groups));
        if is_sealed {
            frames.seal();
        }
        Some(taken)
    }
}

impl Registry {
    /// Forgets the frames of sessions that nobody has used for so long; gives how many sessions these were. Blocks.
    pub(crate) fn unload(&self, idle: Duration) -> usize {
        let is_idle = |session: &&Arc<Session>| lock(&session.last_used).elapsed() >= idle;
        // Nobody finds a session meanwhile. Those who know it already are counted.
        let unloaded: Vec<_> = self.with_sessions(|sessions| {
            let unloaded = |session: &Arc<Session>| session.unload(|| Arc::strong_count(session) > 1);
            sessions.filter(is_idle).filter_map(unloaded).collect()
        });
        // To free them takes time, for which nobody waits.
        unloaded.len()
    }
}
