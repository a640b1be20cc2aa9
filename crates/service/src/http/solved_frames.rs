//! Solved frames as lines of JSON and as records.

use crate::session::Session;
use crate::store::FrameEntry;
use bytes::Bytes;
use cager_proto::messages::FrameResult;
use cager_proto::record::{self, FrameHeader, Kind};
use std::io;
use std::sync::Arc;

pub(crate) fn result_of(entry: &FrameEntry) -> FrameResult {
    let measured = |x: f32| Some(x).filter(|x| !x.is_nan());
    FrameResult { frame: entry.frame, l2: measured(entry.l2), linf: measured(entry.linf) }
}

pub(super) fn as_lines(entries: &[FrameEntry]) -> Bytes {
    let mut lines = Vec::with_capacity(64 * entries.len());
    for entry in entries {
        if serde_json::to_writer(&mut lines, &result_of(entry)).is_ok() {
            lines.push(b'\n');
        }
    }
    lines.into()
}

/// Frame records of solved cages.
pub(crate) async fn as_records(session: Arc<Session>, entries: Vec<FrameEntry>) -> io::Result<Bytes> {
    tokio::task::spawn_blocking(move || records_of(&session, &entries)).await.map_err(io::Error::other)?
}

/// As [`as_records`], blocking.
pub(crate) fn records_of(session: &Session, entries: &[FrameEntry]) -> io::Result<Bytes> {
    let rows = session.facts().map_or(0, |facts| facts.unknowns);
    let mut cages = Vec::with_capacity(entries.len() * 12 * rows as usize);
    session.read_cages(entries, &mut cages)?;
    let mut out = Vec::with_capacity(cages.len() + entries.len() * record::HEADER_BYTES);
    for (entry, cage) in entries.iter().zip(cages.chunks_exact(12 * rows as usize)) {
        let crc = crc32c::crc32c(cage);
        let header = FrameHeader { kind: Kind::Cage, frame: entry.frame, rows, l2: entry.l2, linf: entry.linf, crc };
        out.extend_from_slice(&header.to_bytes());
        out.extend_from_slice(cage);
    }
    Ok(out.into())
}
