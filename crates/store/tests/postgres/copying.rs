//! From one catalogue to another.

use crate::conformance::{append, cage, cages, open, session};
use crate::support::Server;
use cager_store::{Catalog, Change, Key, Kind, NewRecord, Phase, SqliteCatalog, copy};

#[test]
fn a_copy_has_everything_and_goes_on_where_it_was_stopped() {
    let Some(server) = Server::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let from = SqliteCatalog::open(&folder.path().join("catalogue")).expect("a catalogue");
    for id in ["a", "b"] {
        open(&from, id);
        let new: Vec<_> = (0..150).map(|frame| (3 * frame, cage(frame, 40))).collect();
        append(&from, id, &new);
    }
    let job = Key { kind: Kind::Transfer, id: "a" };
    from.create(NewRecord { key: job, created_ms: 7, phase: Phase::Open, meta: b"meta" }).expect("created");
    let said = [
        Change::Outcome(b"outcome".to_vec()),
        Change::Completion(b"completion".to_vec()),
        Change::Announcement(b"announcement".to_vec()),
        Change::Damage("damage".to_owned()),
        Change::Attempts(3),
        Change::Declared(4),
        Change::Reached(5),
        Change::Phase(Phase::Deleted),
    ];
    from.change(job, &said).expect("changed");
    let to = server.open();
    // Stopped in the middle of one.
    to.create(NewRecord { key: session("a"), created_ms: 1, phase: Phase::Creating, meta: b"half" }).expect("created");
    append(&to, "a", &[(1, cage(9, 40))]);
    assert_eq!(copy(&from, &to), Ok(3));
    assert_eq!(to.records(), from.records());
    for id in ["a", "b"] {
        let (theirs, ours) = (from.frames(id).expect("frames"), to.frames(id).expect("frames"));
        let entries =
            theirs.iter().zip(&ours).all(|(a, b)| (a.frame, a.l2, a.full_digest) == (b.frame, b.l2, b.full_digest));
        assert!(entries && theirs.len() == ours.len());
        assert!(cages(&from, id, &theirs) == cages(&to, id, &ours));
    }
    // What is there stays as it is.
    to.change(session("b"), &[Change::Attempts(9)]).expect("changed");
    assert_eq!(copy(&from, &to), Ok(0));
    assert_eq!(to.record(session("b")).expect("a record").expect("there").attempts, 9);
}
