//! Numbers and columns by which both engines store kinds, phases and changes.

use crate::{Change, Kind, Phase};

pub(crate) fn kind_number(kind: Kind) -> u8 {
    match kind {
        Kind::Session => 0,
        Kind::CageJob => 1,
        Kind::Recovery => 2,
        Kind::Transfer => 3,
    }
}

pub(crate) fn kind(number: u8) -> Option<Kind> {
    Kind::ALL.into_iter().find(|kind| kind_number(*kind) == number)
}

/// Several bits apart: rows have no checksum, and what is deleted is removed by the next start.
pub(crate) fn phase_number(phase: Phase) -> u8 {
    match phase {
        Phase::Creating => 0x11,
        Phase::Open => 0x44,
        Phase::Deleted => 0x78,
    }
}

pub(crate) fn phase(number: u8) -> Option<Phase> {
    let phases = [Phase::Creating, Phase::Open, Phase::Deleted];
    phases.into_iter().find(|phase| phase_number(*phase) == number)
}

/// The column of a record that a change sets.
pub(crate) fn column(change: &Change) -> &'static str {
    match change {
        Change::Phase(_) => "phase",
        Change::Meta(_) => "meta",
        Change::Outcome(_) => "outcome",
        Change::Completion(_) => "completion",
        Change::Announcement(_) => "announcement",
        Change::Damage(_) => "damage",
        Change::Attempts(_) => "attempts",
        Change::Declared(_) => "declared",
        Change::Reached(_) => "reached",
    }
}
