//! Clients of every kind, which go on through all restarts.

use super::ledger::{Ledger, Phase};
use super::posts::Poster;
use crate::capture::Reference;
use crate::process::Door;
use cager_client::{Client, ClientError, FnFrames, Rows, UploadOptions, messages::Session};
use fastrand::Rng;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How frames are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// By the client crate.
    Client,
    /// By the client crate, handle rows only.
    ClientHandles,
    /// Raw bodies on two connections at once.
    Raw,
    /// Frame records in any order, answered by records.
    Records,
    /// A few frames; then the session is deleted, at any moment.
    Churn,
}

pub(super) struct Worker {
    pub(super) style: Style,
    pub(super) door: Door,
    pub(super) reference: Arc<Reference>,
    pub(super) ledger: Arc<Ledger>,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) rng: Rng,
}

impl Worker {
    /// Session after session, the last one to its end.
    pub(super) async fn run(mut self) {
        let client = self.door.client();
        // A client that was never answered takes a refused connection for a wrong address.
        while client.sessions().await.is_err() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        for number in 0.. {
            let name = format!("{:?}-{number}", self.style);
            if let Err(what) = self.session(&client, &name).await {
                self.ledger.violation(format!("{name}: {what}"));
                return;
            }
            if self.stop.load(Ordering::SeqCst) {
                return;
            }
        }
    }

    async fn session(&mut self, client: &Client, name: &str) -> Result<(), String> {
        let text = |error: ClientError| error.to_string();
        // Every other one finds its solver; the rest prepare anew.
        let mark = self.rng.bool().then_some(name);
        self.ledger.asked_for(name);
        let session = {
            let _phase = self.ledger.enter(Phase::Create);
            client.create(&self.reference.session(name, mark)).await.map_err(text)?
        };
        self.ledger.created(&session.id, &self.reference, self.style == Style::ClientHandles);
        if self.style == Style::Churn {
            return self.churn(client, session).await;
        }
        let session = {
            let _phase = self.ledger.enter(Phase::Prepare);
            client.wait_ready(&session.id, Duration::from_secs(60)).await.map_err(text)?
        };
        {
            let ledger = Arc::clone(&self.ledger);
            let _phase = ledger.enter(Phase::Upload);
            match self.style {
                Style::Client | Style::ClientHandles => self.by_client(client, &session).await.map_err(text)?,
                _ => self.by_posts(client, &session).await?,
            }
        }
        let count = self.reference.count();
        {
            let _phase = self.ledger.enter(Phase::Complete);
            client.complete(&session.id, count).await.map_err(text)?;
        }
        self.ledger.completed(&session.id);
        // The last one of a worker stays to the end.
        if !self.stop.load(Ordering::SeqCst) && self.rng.u8(..4) > 0 {
            self.delete(client, &session.id).await?;
        }
        Ok(())
    }

    async fn delete(&self, client: &Client, id: &str) -> Result<(), String> {
        let _phase = self.ledger.enter(Phase::Delete);
        self.ledger.deleting(id);
        client.delete(id).await.map_err(|e| e.to_string())?;
        self.ledger.deleted(id);
        Ok(())
    }

    async fn churn(&mut self, client: &Client, session: Session) -> Result<(), String> {
        {
            let _phase = self.ledger.enter(Phase::Prepare);
            tokio::time::sleep(Duration::from_millis(self.rng.u64(..60))).await;
        }
        if self.rng.bool() {
            let ready = client.wait_ready(&session.id, Duration::from_secs(60)).await.map_err(|e| e.to_string())?;
            let _phase = self.ledger.enter(Phase::Upload);
            let mut poster = Poster::new(&self.door, &self.ledger, &self.reference, &ready.id, self.rng.fork());
            let some = self.rng.u32(1..self.reference.count());
            // Deleted in the middle, where time is over.
            let _ = tokio::time::timeout(Duration::from_millis(self.rng.u64(1..150)), poster.raw(0..some)).await;
        }
        self.delete(client, &session.id).await
    }

    async fn by_client(&mut self, client: &Client, session: &Session) -> Result<(), ClientError> {
        let (reference, mut rng) = (Arc::clone(&self.reference), self.rng.fork());
        let source = FnFrames::new(self.reference.points, Some(self.reference.count()), move |frame, out| {
            if rng.u8(..4) == 0 {
                std::thread::sleep(Duration::from_micros(rng.u64(..8000)));
            }
            out.extend_from_slice(&reference.frames[frame as usize]);
            Ok(true)
        });
        let rows = if self.style == Style::ClientHandles { Rows::Handles } else { Rows::All };
        let mut on_frame = |result: cager_client::messages::FrameResult| {
            self.ledger.answered(&session.id, result.frame, super::posts::errors(&result));
        };
        let options = UploadOptions { rows, on_frame: Some(&mut on_frame), ..UploadOptions::default() };
        client.upload(session, source, options).await.map(drop)
    }

    /// Goes on from what the service says is missing, until nothing is.
    async fn by_posts(&mut self, client: &Client, session: &Session) -> Result<(), String> {
        let count = self.reference.count();
        let new_poster = |rng: Rng| Poster::new(&self.door, &self.ledger, &self.reference, &session.id, rng);
        loop {
            let now = client.session(&session.id).await.map_err(|e| e.to_string())?;
            let there = now.frames.solved + now.frames.missing.iter().map(|[a, b]| u64::from(b - a)).sum::<u64>();
            let mut missing: Vec<[u32; 2]> = now.frames.missing.clone();
            if there < u64::from(count) {
                missing.push([there as u32, count]);
            }
            let Some(&[first, end]) = missing.get(self.rng.usize(..missing.len().max(1))) else { return Ok(()) };
            if self.style == Style::Records {
                let mut frames: Vec<u32> = missing.iter().flat_map(|[a, b]| *a..*b).collect();
                self.rng.shuffle(&mut frames);
                new_poster(self.rng.fork()).records(&frames).await?;
                continue;
            }
            // Two connections meet in the middle, and both send what lies there.
            let middle = first + (end - first) / 2;
            let (mut one, mut two) = (new_poster(self.rng.fork()), new_poster(self.rng.fork()));
            let (one, two) = tokio::join!(one.raw(first..(middle + 3).min(end)), two.raw(middle..end));
            one?;
            two?;
        }
    }
}
