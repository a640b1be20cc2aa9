//! Stories of records.

use super::{append, cage, open, session};
use cager_store::{Catalog, CatalogError, Change, Key, Kind, NewRecord, Phase, Record};

pub(crate) fn a_record_is_read_back_as_it_was_created(catalog: &dyn Catalog) {
    let meta: Vec<u8> = (0..=255).collect();
    for (number, kind) in Kind::ALL.into_iter().enumerate() {
        let key = Key { kind, id: "it's \"é\" % _" };
        assert_eq!(catalog.record(key), Ok(None));
        let phase = [Phase::Creating, Phase::Open][number % 2];
        let created_ms = 1_700_000_000_000 + number as u64;
        catalog.create(NewRecord { key, created_ms, phase, meta: &meta[number..] }).expect("created");
        let expected = Record {
            kind,
            id: key.id.to_owned(),
            created_ms,
            phase,
            meta: meta[number..].to_vec(),
            outcome: None,
            completion: None,
            announcement: None,
            damage: None,
            attempts: 0,
            declared: None,
            reached: 0,
            frame_bytes: 0,
        };
        assert_eq!(catalog.record(key), Ok(Some(expected)));
    }
    assert_eq!(catalog.records().expect("records").len(), 4, "ids that differ only in kind are different");
}

pub(crate) fn an_id_is_taken_once_in_its_kind(catalog: &dyn Catalog) {
    open(catalog, "a");
    let again = NewRecord { key: session("a"), created_ms: 9, phase: Phase::Creating, meta: b"other" };
    assert_eq!(catalog.create(again), Err(CatalogError::Taken));
    let kept = catalog.record(session("a")).expect("read").expect("there");
    assert_eq!((kept.created_ms, kept.phase, &kept.meta[..]), (1, Phase::Open, &b"{}"[..]));
    // Also of one that is being deleted.
    assert_eq!(catalog.change(session("a"), &[Change::Phase(Phase::Deleted)]), Ok(true));
    assert_eq!(catalog.create(again), Err(CatalogError::Taken));
    let other = NewRecord { key: Key { kind: Kind::Transfer, id: "a" }, ..again };
    assert_eq!(catalog.create(other), Ok(()));
    assert_eq!(catalog.create(NewRecord { key: session("A"), ..again }), Ok(()), "ids differ in case");
}

pub(crate) fn records_come_oldest_first(catalog: &dyn Catalog) {
    assert_eq!(catalog.records(), Ok(Vec::new()));
    let kinds = Kind::ALL.into_iter().cycle();
    for (created_ms, kind) in [50, 10, 40, 20, 30].into_iter().zip(kinds) {
        let id = format!("{}", 100 - created_ms);
        let record = NewRecord { key: Key { kind, id: &id }, created_ms, phase: Phase::Open, meta: b"" };
        catalog.create(record).expect("created");
    }
    let times: Vec<u64> = catalog.records().expect("records").iter().map(|record| record.created_ms).collect();
    assert_eq!(times, [10, 20, 30, 40, 50]);
}

pub(crate) fn changes_are_made_together(catalog: &dyn Catalog) {
    open(catalog, "a");
    open(catalog, "b");
    let job = Key { kind: Kind::CageJob, id: "a" };
    catalog.create(NewRecord { key: job, created_ms: 1, phase: Phase::Open, meta: b"job" }).expect("created");
    let untouched = [catalog.record(session("b")), catalog.record(job)];
    let changes = [
        Change::Phase(Phase::Creating),
        Change::Outcome(b"outcome".to_vec()),
        Change::Completion(vec![0, 255]),
        Change::Announcement(Vec::new()),
        Change::Damage("frame 3 ‐ é".to_owned()),
        Change::Attempts(3),
        Change::Declared(u32::MAX),
        Change::Reached(u32::MAX),
    ];
    assert_eq!(catalog.change(session("a"), &changes), Ok(true));
    let expected = Record {
        kind: Kind::Session,
        id: "a".to_owned(),
        created_ms: 1,
        phase: Phase::Creating,
        meta: b"{}".to_vec(),
        outcome: Some(b"outcome".to_vec()),
        completion: Some(vec![0, 255]),
        announcement: Some(Vec::new()),
        damage: Some("frame 3 ‐ é".to_owned()),
        attempts: 3,
        declared: Some(u32::MAX),
        reached: u32::MAX,
        frame_bytes: 0,
    };
    assert_eq!(catalog.record(session("a")), Ok(Some(expected.clone())));
    assert_eq!([catalog.record(session("b")), catalog.record(job)], untouched);
    // The last one of a kind counts; the others stay.
    assert_eq!(catalog.change(session("a"), &[Change::Attempts(7), Change::Attempts(0)]), Ok(true));
    assert_eq!(catalog.change(session("a"), &[]), Ok(true));
    assert_eq!(catalog.record(session("a")), Ok(Some(Record { attempts: 0, ..expected })));
}

pub(crate) fn a_missing_record_is_not_changed(catalog: &dyn Catalog) {
    open(catalog, "a");
    let before = catalog.records();
    for key in [session("b"), Key { kind: Kind::Recovery, id: "a" }] {
        assert_eq!(catalog.change(key, &[Change::Attempts(1), Change::Phase(Phase::Deleted)]), Ok(false));
        assert_eq!(catalog.change(key, &[]), Ok(false));
    }
    assert_eq!(catalog.records(), before);
}

pub(crate) fn every_phase_is_kept(catalog: &dyn Catalog) {
    open(catalog, "a");
    for phase in [Phase::Creating, Phase::Open, Phase::Deleted] {
        assert_eq!(catalog.change(session("a"), &[Change::Phase(phase)]), Ok(true));
        assert_eq!(catalog.record(session("a")).expect("read").map(|record| record.phase), Some(phase));
    }
}

pub(crate) fn removing_is_repeatable_and_frees_the_id(catalog: &dyn Catalog) {
    let job = Key { kind: Kind::CageJob, id: "a" };
    catalog.create(NewRecord { key: job, created_ms: 2, phase: Phase::Open, meta: b"" }).expect("created");
    for _ in 0..2 {
        open(catalog, "a");
        assert_eq!(catalog.frames("a"), Ok(Vec::new()), "it begins without frames");
        append(catalog, "a", &[(0, cage(0, 4))]);
        assert_eq!(catalog.change(session("a"), &[Change::Phase(Phase::Deleted)]), Ok(true));
        assert_eq!(catalog.remove(session("a")), Ok(()));
        assert_eq!(catalog.remove(session("a")), Ok(()), "what is not there is removed");
        assert_eq!(catalog.record(session("a")), Ok(None));
    }
    assert_eq!(catalog.records().expect("records").len(), 1, "a job of the same id is none of its business");
}

pub(crate) fn it_can_be_written_to(catalog: &dyn Catalog) {
    assert_eq!(catalog.probe(), Ok(()));
    assert_eq!(catalog.records(), Ok(Vec::new()));
}
