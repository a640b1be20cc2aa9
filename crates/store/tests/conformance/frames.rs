//! Stories of frames and their cages.

use super::{append, bytes, cage, cages, entry, open, session};
use cager_store::{Catalog, CatalogError, Change, FrameEntry, NewFrame, Phase};

/// What a frame is counted with beside its cage.
const BESIDE: u64 = 96;

pub(crate) fn frames_are_read_back_as_they_were_stored(catalog: &dyn Catalog) {
    open(catalog, "a");
    let new = [(0, cage(0, 8)), (1, cage(1, 8)), (u32::MAX, cage(2, 8))];
    let stored = append(catalog, "a", &new);
    let unplaced = |of: &FrameEntry| FrameEntry { place: entry(0).place, ..*of };
    assert_eq!(stored.iter().map(unplaced).collect::<Vec<_>>(), [entry(0), entry(1), entry(u32::MAX)]);
    assert_eq!(catalog.frames("a"), Ok(stored.clone()));
    assert_eq!(cages(catalog, "a", &stored), new.iter().flat_map(|(_, cage)| bytes(cage)).collect::<Vec<_>>());
}

pub(crate) fn unusual_numbers_are_kept(catalog: &dyn Catalog) {
    open(catalog, "a");
    let (small, big) = (f64::from_bits(1), f64::MAX);
    let of = [
        (f32::NAN, f32::NAN, f64::NAN, f64::NAN),
        (f32::INFINITY, f32::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY),
        (0.0, -0.0, 0.0, -0.0),
        (f32::from_bits(1), f32::MAX, small, big),
        (1.0, -3e9, 9_007_199_254_740_993.0, 1e18),
        (0.1, f32::EPSILON, 0.1, 1.0 / 3.0),
    ];
    let cage = [f32::NAN, f32::from_bits(0x7fa0_0001), f32::INFINITY, -0.0, f32::from_bits(1), f32::MIN];
    let new = of.iter().zip(0..).map(|((l2, linf, squared, spread), frame)| {
        let full_digest = [None, Some([0; 16]), Some([255; 16])][frame as usize % 3];
        let (l2, linf, squared, spread) = (*l2, *linf, *squared, *spread);
        NewFrame { entry: FrameEntry { l2, linf, squared, spread, full_digest, ..entry(frame) }, cage: &cage }
    });
    let new: Vec<_> = new.collect();
    let stored = catalog.append("a", &new).expect("appended");
    let found = catalog.frames("a").expect("frames");
    let seen = |of: &FrameEntry| {
        // NaN is NaN, whatever its bits, and zero is zero.
        let bits = |x: f64| if x.is_nan() { u64::MAX } else { (x + 0.0).to_bits() };
        let numbers = [f64::from(of.l2), f64::from(of.linf), of.squared, of.spread].map(bits);
        (of.frame, numbers, of.handle_digest, of.full_digest)
    };
    let all = |entries: &[FrameEntry]| entries.iter().map(seen).collect::<Vec<_>>();
    let expected: Vec<_> = new.iter().map(|frame| seen(&frame.entry)).collect();
    assert_eq!(all(&stored), expected);
    assert_eq!(all(&found), expected);
    assert_eq!(cages(catalog, "a", &found), bytes(&cage).repeat(of.len()), "cages are kept bit for bit");
}

pub(crate) fn frames_come_ascending(catalog: &dyn Catalog) {
    open(catalog, "a");
    append(catalog, "a", &[7, u32::MAX, 3].map(|frame| (frame, cage(frame, 2))));
    append(catalog, "a", &[1 << 31, 0, 5].map(|frame| (frame, cage(frame, 2))));
    let frames = catalog.frames("a").expect("frames");
    assert_eq!(frames.iter().map(|entry| entry.frame).collect::<Vec<_>>(), [0, 3, 5, 7, 1 << 31, u32::MAX]);
    let expected: Vec<u8> = frames.iter().flat_map(|entry| bytes(&cage(entry.frame, 2))).collect();
    assert_eq!(cages(catalog, "a", &frames), expected);
}

pub(crate) fn a_frame_stored_again_replaces_the_first(catalog: &dyn Catalog) {
    open(catalog, "a");
    let first = append(catalog, "a", &[1, 2, 3].map(|frame| (frame, cage(frame, 4))));
    let new = NewFrame { entry: FrameEntry { l2: 9.0, full_digest: None, ..entry(2) }, cage: &cage(20, 6) };
    let second = catalog.append("a", &[new]).expect("appended");
    assert_eq!(catalog.frames("a"), Ok(vec![first[0], second[0], first[2]]));
    assert_eq!(cages(catalog, "a", &second), bytes(&cage(20, 6)));
    // Twice in one call: the last one counts.
    let third = append(catalog, "a", &[(3, cage(30, 4)), (3, cage(31, 4))]);
    assert_eq!(catalog.frames("a").expect("frames")[2], third[1]);
    assert_eq!(cages(catalog, "a", &third[1..]), bytes(&cage(31, 4)));
}

pub(crate) fn cages_come_in_the_order_asked_for(catalog: &dyn Catalog) {
    open(catalog, "a");
    let mut stored = append(catalog, "a", &[0, 1, 2].map(|frame| (frame, cage(frame, 3))));
    stored.extend(append(catalog, "a", &[3, 4].map(|frame| (frame, cage(frame, 5)))));
    let order = [4, 0, 0, 3, 1, 4, 2, 0];
    let size = |frame| if frame < 3 { 3 } else { 5 };
    let mut out = b"before".to_vec();
    let asked: Vec<_> = order.map(|frame| stored[frame]).to_vec();
    catalog.cages("a", &asked, &mut out).expect("cages");
    let expected = order.iter().flat_map(|frame| bytes(&cage(*frame as u32, size(*frame))));
    assert_eq!(out, b"before".iter().copied().chain(expected).collect::<Vec<_>>());
}

pub(crate) fn many_frames_in_one_call(catalog: &dyn Catalog) {
    open(catalog, "a");
    for (first, count, vertices) in [(0, 1000, 5), (1000, 300, 1500)] {
        let new: Vec<_> = (first..first + count).map(|frame| (frame, cage(frame, vertices))).collect();
        let stored = append(catalog, "a", &new);
        assert_eq!(stored.iter().map(|entry| entry.frame).collect::<Vec<_>>(), Vec::from_iter(first..first + count));
        let expected: Vec<u8> = new.iter().rev().flat_map(|(_, cage)| bytes(cage)).collect();
        assert!(cages(catalog, "a", &stored.into_iter().rev().collect::<Vec<_>>()) == expected);
    }
    assert_eq!(catalog.frames("a").expect("frames").len(), 1300);
}

pub(crate) fn one_huge_cage_among_small_ones(catalog: &dyn Catalog) {
    open(catalog, "a");
    let new = [(0, cage(0, 10)), (1, cage(1, 700_000)), (2, cage(2, 10))];
    let stored = append(catalog, "a", &new);
    assert!(cages(catalog, "a", &stored) == new.iter().flat_map(|(_, cage)| bytes(cage)).collect::<Vec<_>>());
}

pub(crate) fn nothing_to_store_and_nothing_to_read(catalog: &dyn Catalog) {
    open(catalog, "a");
    assert_eq!(catalog.frames("a"), Ok(Vec::new()));
    assert_eq!(catalog.append("a", &[]), Ok(Vec::new()));
    assert!(cages(catalog, "a", &[]).is_empty());
    let stored = append(catalog, "a", &[(0, Vec::new()), (1, cage(1, 1)), (2, Vec::new())]);
    assert_eq!(catalog.frames("a"), Ok(stored.clone()));
    assert_eq!(cages(catalog, "a", &stored), bytes(&cage(1, 1)));
}

pub(crate) fn nothing_is_appended_to_a_session_that_is_not_there(catalog: &dyn Catalog) {
    open(catalog, "a");
    let kept = append(catalog, "a", &[(0, cage(0, 4))]);
    assert_eq!(catalog.change(session("a"), &[Change::Phase(Phase::Deleted)]), Ok(true));
    let other = cage(1, 4);
    for id in ["missing", "a", ""] {
        let new = [0, 1].map(|frame| NewFrame { entry: entry(frame), cage: &other });
        assert_eq!(catalog.append(id, &new), Err(CatalogError::Gone));
        assert_eq!(catalog.append(id, &[]), Err(CatalogError::Gone));
    }
    assert_eq!(catalog.frames("a"), Ok(kept), "nothing of it was stored");
    let bytes = catalog.record(session("a")).expect("read").map(|record| record.frame_bytes);
    assert_eq!(bytes, Some(48 + BESIDE));
    // One whose creation is under way has frames.
    open(catalog, "b");
    assert_eq!(catalog.change(session("b"), &[Change::Phase(Phase::Creating)]), Ok(true));
    append(catalog, "b", &[(0, cage(0, 4))]);
}

pub(crate) fn sessions_do_not_see_each_other(catalog: &dyn Catalog) {
    ["a", "b", "empty"].into_iter().for_each(|id| open(catalog, id));
    let of_a = append(catalog, "a", &[(0, cage(1, 4)), (1, cage(2, 4))]);
    let of_b = append(catalog, "b", &[(0, cage(3, 4))]);
    assert_eq!(catalog.frames("a"), Ok(of_a.clone()));
    assert_eq!(catalog.frames("b"), Ok(of_b.clone()));
    assert_eq!(catalog.frames("empty"), Ok(Vec::new()));
    let mut out = b"kept".to_vec();
    for (id, asked) in [("b", vec![of_b[0], of_a[0]]), ("a", vec![of_b[0]]), ("empty", of_a.clone())] {
        let read = catalog.cages(id, &asked, &mut out);
        assert!(matches!(read, Err(CatalogError::Damaged(_))), "{id}: {read:?}");
        assert_eq!(out, b"kept");
    }
    // An entry whose frame was not stored there.
    let wrong = FrameEntry { frame: 7, ..of_a[0] };
    let read = catalog.cages("a", &[of_a[1], wrong], &mut out);
    assert!(matches!(read, Err(CatalogError::Damaged(_))), "{read:?}");
    assert_eq!(out, b"kept");
    for id in ["missing", ""] {
        assert!(catalog.cages(id, &of_a, &mut out).is_err() && catalog.frames(id).is_err());
        assert_eq!(out, b"kept");
    }
}

pub(crate) fn a_record_goes_with_thousands_of_frames(catalog: &dyn Catalog) {
    ["a", "b"].into_iter().for_each(|id| open(catalog, id));
    let kept = append(catalog, "b", &[(0, cage(7, 4))]);
    let mut stored = Vec::new();
    for first in (0..6000).step_by(1500) {
        let new: Vec<_> = (first..first + 1500).map(|frame| (frame, cage(frame, 60))).collect();
        stored = append(catalog, "a", &new);
    }
    assert_eq!(catalog.change(session("a"), &[Change::Phase(Phase::Deleted)]), Ok(true));
    assert_eq!(catalog.remove(session("a")), Ok(()));
    assert_eq!(catalog.record(session("a")), Ok(None));
    open(catalog, "a");
    assert_eq!(catalog.frames("a"), Ok(Vec::new()), "no frame comes back with the id");
    let mut out = Vec::new();
    assert!(catalog.cages("a", &stored[..1], &mut out).is_err());
    assert_eq!(catalog.frames("b"), Ok(kept.clone()));
    assert_eq!(cages(catalog, "b", &kept), bytes(&cage(7, 4)));
}

pub(crate) fn bytes_of_frames_are_counted(catalog: &dyn Catalog) {
    ["a", "b"].into_iter().for_each(|id| open(catalog, id));
    append(catalog, "a", &[(0, cage(0, 10)), (1, cage(1, 20))]);
    append(catalog, "a", &[(2, cage(2, 5))]);
    append(catalog, "b", &[(0, cage(0, 1))]);
    let bytes = |id| catalog.record(session(id)).expect("read").map(|record| record.frame_bytes);
    // About a hundred bytes each beside its cage.
    assert_eq!((bytes("a"), bytes("b")), (Some(12 * 35 + 3 * BESIDE), Some(12 + BESIDE)));
    assert_eq!(
        catalog.records().expect("records").iter().map(|record| record.frame_bytes).sum::<u64>(),
        12 * 36 + 4 * BESIDE
    );
}
