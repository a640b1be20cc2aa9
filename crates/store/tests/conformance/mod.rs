//! What every catalogue does, as small stories. An engine runs them all by `conformance!(with)`, where `with` gives a story an empty catalogue.

pub(crate) mod frames;
pub(crate) mod records;

use cager_store::{CagePlace, Catalog, FrameEntry, Key, Kind, NewFrame, NewRecord, Phase};

/// A test of each story.
macro_rules! conformance {
    ($with:path) => {
        conformance! { $with;
            records:
                a_record_is_read_back_as_it_was_created,
                an_id_is_taken_once_in_its_kind,
                records_come_oldest_first,
                changes_are_made_together,
                a_missing_record_is_not_changed,
                every_phase_is_kept,
                removing_is_repeatable_and_frees_the_id,
                it_can_be_written_to;
            frames:
                frames_are_read_back_as_they_were_stored,
                unusual_numbers_are_kept,
                frames_come_ascending,
                a_frame_stored_again_replaces_the_first,
                cages_come_in_the_order_asked_for,
                many_frames_in_one_call,
                one_huge_cage_among_small_ones,
                nothing_to_store_and_nothing_to_read,
                nothing_is_appended_to_a_session_that_is_not_there,
                sessions_do_not_see_each_other,
                a_record_goes_with_thousands_of_frames,
                bytes_of_frames_are_counted;
        }
    };
    ($with:path; $($module:ident: $($story:ident),*;)*) => {
        $(mod $module {
            $(#[test]
            fn $story() {
                $with(crate::conformance::$module::$story);
            })*
        })*
    };
}

pub(crate) fn session(id: &str) -> Key<'_> {
    Key { kind: Kind::Session, id }
}

pub(crate) fn open(catalog: &dyn Catalog, id: &str) {
    let record = NewRecord { key: session(id), created_ms: 1, phase: Phase::Open, meta: b"{}" };
    catalog.create(record).expect("a session");
}

/// A frame with numbers of its own.
pub(crate) fn entry(frame: u32) -> FrameEntry {
    let of = f64::from(frame) + 0.1;
    FrameEntry {
        frame,
        place: CagePlace::default(),
        l2: of as f32,
        linf: 2.0 * of as f32,
        squared: 3.0 * of,
        spread: 4.0 * of,
        handle_digest: [frame as u8; 16],
        full_digest: Some([!frame as u8; 16]),
    }
}

/// A cage of so many vertices, of its own for every seed.
pub(crate) fn cage(seed: u32, vertices: usize) -> Vec<f32> {
    (0..3 * vertices).map(|i| seed as f32 + i as f32 / 1024.0).collect()
}

pub(crate) fn append(catalog: &dyn Catalog, id: &str, frames: &[(u32, Vec<f32>)]) -> Vec<FrameEntry> {
    let new: Vec<_> = frames.iter().map(|(frame, cage)| NewFrame { entry: entry(*frame), cage }).collect();
    catalog.append(id, &new).expect("appended")
}

pub(crate) fn cages(catalog: &dyn Catalog, id: &str, frames: &[FrameEntry]) -> Vec<u8> {
    let mut out = Vec::new();
    catalog.cages(id, frames, &mut out).expect("cages");
    out
}

pub(crate) fn bytes(cage: &[f32]) -> Vec<u8> {
    cage.iter().flat_map(|x| x.to_le_bytes()).collect()
}
