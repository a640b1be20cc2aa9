//! What the service has said so far, and whether it still says so.

use crate::capture::{Errors, Reference};
use crate::process::{Door, HANG};
use cager_client::{Client, messages::SessionState};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// What runs when a process is killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Phase {
    Create,
    Prepare,
    Upload,
    Complete,
    Delete,
}

pub(crate) const PHASES: [Phase; 5] = [Phase::Create, Phase::Prepare, Phase::Upload, Phase::Complete, Phase::Delete];

/// What is known of one session.
#[derive(Clone)]
pub(crate) struct Known {
    pub(crate) reference: Arc<Reference>,
    pub(crate) only_handles: bool,
    /// Frames whose records have come back.
    pub(crate) answered: BTreeMap<u32, Option<Errors>>,
    pub(crate) completed: bool,
}

/// What all workers have heard.
#[derive(Default)]
pub(crate) struct Ledger {
    sessions: Mutex<HashMap<String, Known>>,
    /// Names of sessions that were asked for; each is made once.
    names: Mutex<BTreeSet<String>>,
    deleted: Mutex<BTreeSet<String>>,
    violations: Mutex<Vec<String>>,
    active: [AtomicUsize; PHASES.len()],
    entered: [tokio::sync::Notify; PHASES.len()],
    pub(crate) answers: AtomicUsize,
    pub(crate) frames_checked: AtomicUsize,
    pub(crate) cages_checked: AtomicUsize,
    pub(crate) containers: AtomicUsize,
    pub(crate) deletions: AtomicUsize,
}

/// A phase lasts as long as this lives.
pub(crate) struct InPhase<'a>(&'a Ledger, Phase);

impl Drop for InPhase<'_> {
    fn drop(&mut self) {
        self.0.active[self.1 as usize].fetch_sub(1, Ordering::SeqCst);
    }
}

impl Ledger {
    pub(crate) fn enter(&self, phase: Phase) -> InPhase<'_> {
        self.active[phase as usize].fetch_add(1, Ordering::SeqCst);
        self.entered[phase as usize].notify_waiters();
        InPhase(self, phase)
    }

    pub(crate) async fn entered(&self, phase: Phase) {
        self.entered[phase as usize].notified().await;
    }

    pub(crate) fn active(&self) -> impl Iterator<Item = Phase> {
        PHASES.into_iter().filter(|&phase| self.active[phase as usize].load(Ordering::SeqCst) > 0)
    }

    pub(crate) fn violation(&self, what: impl Into<String>) {
        self.violations.lock().unwrap().push(what.into());
    }

    pub(crate) fn violations(&self) -> Vec<String> {
        self.violations.lock().unwrap().clone()
    }

    pub(crate) fn asked_for(&self, name: &str) {
        self.names.lock().unwrap().insert(name.to_owned());
    }

    pub(crate) fn created(&self, id: &str, reference: &Arc<Reference>, only_handles: bool) {
        let known =
            Known { reference: Arc::clone(reference), only_handles, answered: BTreeMap::new(), completed: false };
        self.sessions.lock().unwrap().entry(id.to_owned()).or_insert(known);
    }

    /// A frame's record came back. Not measured ones have no errors.
    pub(crate) fn answered(&self, id: &str, frame: u32, errors: Option<Errors>) {
        self.answers.fetch_add(1, Ordering::Relaxed);
        let mut sessions = self.sessions.lock().unwrap();
        let Some(known) = sessions.get_mut(id) else { return };
        let expected = (!known.only_handles).then(|| known.reference.errors[frame as usize]);
        if errors != expected {
            self.violation(format!("{id}: frame {frame} was answered {errors:?} instead of {expected:?}"));
        }
        known.answered.insert(frame, errors);
    }

    pub(crate) fn completed(&self, id: &str) {
        if let Some(known) = self.sessions.lock().unwrap().get_mut(id) {
            known.completed = true;
        }
    }

    /// From here on it may be there or not.
    pub(crate) fn deleting(&self, id: &str) {
        self.sessions.lock().unwrap().remove(id);
    }

    pub(crate) fn deleted(&self, id: &str) {
        self.deletions.fetch_add(1, Ordering::Relaxed);
        self.deleted.lock().unwrap().insert(id.to_owned());
    }

    fn known(&self, id: &str) -> Option<Known> {
        self.sessions.lock().unwrap().get(id).cloned()
    }

    /// The sessions that are known, and not being deleted.
    pub(crate) fn ids(&self) -> Vec<String> {
        self.sessions.lock().unwrap().keys().cloned().collect()
    }

    /// Whether all that was said still holds.
    pub(crate) async fn check(&self, server: &Door) {
        self.check_some(server, None, usize::MAX).await;
    }

    /// As [`Self::check`], of at most so many sessions: the newest, on which somebody may have been at work, and some others. One may be
    /// `hurt`: it may fail.
    pub(crate) async fn check_some(&self, server: &Door, hurt: Option<&str>, most: usize) {
        let client = server.client();
        let deleted = self.deleted.lock().unwrap().clone();
        let mut ids = self.ids();
        // Their ids are in the order of time.
        ids.sort_unstable_by(|a, b| b.cmp(a));
        if let Some(older) = ids.get_mut(most / 2..) {
            fastrand::shuffle(older);
        }
        ids.truncate(most);
        ids.extend(hurt.map(str::to_owned));
        let listed = match timeout(HANG, client.sessions()).await {
            Ok(Ok(listed)) => listed,
            other => return self.violation(format!("the sessions are not listed: {:?}", other.map(|r| r.map(drop)))),
        };
        let mut names = BTreeSet::new();
        let is_hurt = |id: &str| hurt == Some(id);
        let failed = |id: &str| listed.iter().any(|s| s.id == id && s.state == SessionState::Failed);
        for session in &listed {
            let name = session.name.clone().unwrap_or_default();
            if !self.names.lock().unwrap().contains(&name) {
                self.violation(format!("{}: nobody asked for {name:?}", session.id));
            }
            if deleted.contains(&session.id) {
                self.violation(format!("{} was deleted and is there again", session.id));
            }
            if !names.insert(name.clone()) {
                self.violation(format!("{}: {name} was made twice", session.id));
            }
            if session.state == SessionState::Failed && !is_hurt(&session.id) {
                self.violation(format!("{} failed: {:?}", session.id, session.problem));
            }
        }
        for id in ids {
            // What was answered before the look is there afterwards.
            let Some(known) = self.known(&id) else { continue };
            // It says that it is damaged, or is not listed because not even its name can be read.
            if is_hurt(&id) && (failed(&id) || listed.iter().all(|session| session.id != id)) {
                continue;
            }
            match is_hurt(&id) {
                true => self.told(&id, self.check_hurt(&client, server, &id, &known).await),
                false => self.told(&id, self.check_session(&client, server, &id, &known).await),
            }
        }
    }

    /// As [`Self::check`], of one session.
    pub(crate) async fn check_one(&self, server: &Door, id: &str) {
        if let Some(known) = self.known(id) {
            self.told(id, self.check_session(&server.client(), server, id, &known).await);
        }
    }

    fn told(&self, id: &str, checked: Result<(), String>) {
        // It may have been deleted meanwhile.
        if let Err(error) = checked
            && self.known(id).is_some()
        {
            self.violation(format!("{id}: {error}"));
        }
    }

    async fn check_session(&self, client: &Client, server: &Door, id: &str, known: &Known) -> Result<(), String> {
        let state = self.check_frames(client, id, known).await?;
        if !known.completed {
            return Ok(());
        }
        if state != SessionState::Completed {
            return Err(format!("it was completed and is {state:?}"));
        }
        self.check_container(server, id, known).await
    }

    /// What a session whose files are not as they should be says, it has to say rightly; it may say that it cannot.
    async fn check_hurt(&self, client: &Client, server: &Door, id: &str, known: &Known) -> Result<(), String> {
        let path = format!("/v1/sessions/{id}");
        let first = known.answered.keys().next().map(|frame| format!("{path}/cages?first={frame}&count=1"));
        for path in [path.clone(), format!("{path}/errors")].into_iter().chain(first) {
            match server.get(&path).await {
                Some(200) => {}
                Some(404 | 410) => return Err(format!("{path} is not there although nothing was deleted")),
                _ => return Ok(()),
            }
        }
        self.check_frames(client, id, known).await?;
        if !known.completed {
            return Ok(());
        }
        // A container that is damaged is noticed some time after the start, and written again from the log.
        let (clock, frames) = (Instant::now(), known.reference.count());
        let wish = serde_json::json!({ "frames": frames });
        loop {
            let request = server.with_token(reqwest::Client::new().post(server.url(&format!("{path}/complete"))));
            let completed = request.json(&wish).send().await;
            match completed.map_err(|error| error.to_string())?.status().as_u16() {
                200 => {}
                503 => return Ok(()),
                status => return Err(format!("it was completed, and completing it again answers {status}")),
            }
            // The client asks again for long where a container cannot be read.
            if server.get(&format!("{path}/capture.cager")).await == Some(503) {
                return Ok(());
            }
            match self.check_container(server, id, known).await {
                Err(error) if clock.elapsed() > HANG => return Err(error),
                Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
                Ok(()) => return Ok(()),
            }
        }
    }

    async fn check_frames(&self, client: &Client, id: &str, known: &Known) -> Result<SessionState, String> {
        let text = |error: cager_client::ClientError| error.to_string();
        let session = client.session(id).await.map_err(text)?;
        let missing = &session.frames.missing;
        if let Some(lost) = known.answered.keys().find(|&&f| missing.iter().any(|[a, b]| (*a..*b).contains(&f))) {
            return Err(format!("frame {lost} was answered and is missing now"));
        }
        if !known.answered.is_empty() && session.state != SessionState::Preparing {
            let bits = |x: Option<f32>| x.map(f32::to_bits);
            let told = client.errors(id).await.map_err(text)?;
            let told: BTreeMap<u32, _> = told.iter().map(|r| (r.frame, bits(r.l2).zip(bits(r.linf)))).collect();
            for (frame, errors) in &known.answered {
                match told.get(frame) {
                    Some(found) if *found == errors.map(|e| (e.l2, e.linf)) => {}
                    found => return Err(format!("frame {frame} was {errors:?} and is {found:?}")),
                }
            }
            self.frames_checked.fetch_add(known.answered.len(), Ordering::Relaxed);
            self.check_cages(client, id, known).await?;
        }
        Ok(session.state)
    }

    async fn check_cages(&self, client: &Client, id: &str, known: &Known) -> Result<(), String> {
        let frames: Vec<u32> = known.answered.keys().copied().collect();
        for run in frames.chunk_by(|a, b| a + 1 == *b) {
            let cages = client.cages(id, run[0], run.len() as u32).await.map_err(|e| e.to_string())?;
            for (frame, cage) in run.iter().zip(&cages) {
                let expected = &known.reference.cages[*frame as usize];
                let same = cage.values.iter().map(|x| x.to_bits()).eq(expected.iter().map(|x| x.to_bits()));
                if cage.frame != *frame || !same {
                    return Err(format!("the cage of frame {frame} is another"));
                }
            }
            if cages.len() != run.len() {
                return Err(format!("{} cages from {} on, and {} were answered", cages.len(), run[0], run.len()));
            }
            self.cages_checked.fetch_add(cages.len(), Ordering::Relaxed);
        }
        Ok(())
    }

    pub(crate) async fn check_container(&self, server: &Door, id: &str, known: &Known) -> Result<(), String> {
        let mut bytes = Vec::new();
        server.client().download(id, &mut bytes).await.map_err(|e| e.to_string())?;
        let reference = &known.reference;
        let expected = if known.only_handles { &reference.handles_container } else { &reference.container };
        if bytes != *expected {
            return Err(format!("its container of {} bytes is not the one of {}", bytes.len(), expected.len()));
        }
        self.containers.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}
