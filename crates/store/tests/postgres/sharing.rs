//! Several processes on one database.

use crate::conformance::{append, bytes, cage, cages, open, session};
use crate::support::Server;
use cager_store::{Catalog, CatalogError, Change, Phase, PostgresCatalog};

#[test]
fn two_catalogues_append_to_one_session_at_once() {
    let Some(server) = Server::start() else { return };
    let both = [server.open(), server.open()];
    open(&both[0], "a");
    std::thread::scope(|scope| {
        for worker in 0..8 {
            let catalog = &both[worker as usize % 2];
            // Each frame is stored by two of them, in opposite orders.
            scope.spawn(move || {
                for round in 0..20 {
                    let mut new: Vec<_> =
                        (0..8).map(|at| 100 * (worker / 2) + 4 * round + at).map(|f| (f, cage(f, 40))).collect();
                    if worker % 2 == 0 {
                        new.reverse();
                    }
                    append(catalog, "a", &new);
                }
            });
        }
    });
    let frames = both[0].frames("a").expect("frames");
    assert_eq!(frames.len(), 4 * 84);
    assert_eq!(both[1].frames("a"), Ok(frames.clone()));
    let expected: Vec<u8> = frames.iter().flat_map(|entry| bytes(&cage(entry.frame, 40))).collect();
    assert!(cages(&both[1], "a", &frames) == expected);
}

#[test]
fn nothing_is_appended_after_a_deletion_was_answered() {
    let Some(server) = Server::start() else { return };
    let both = [server.open(), server.open()];
    open(&both[0], "a");
    std::thread::scope(|scope| {
        let appending = scope.spawn(|| {
            let cage = cage(0, 4);
            for frame in 0.. {
                let new = cager_store::NewFrame { entry: crate::conformance::entry(frame), cage: &cage };
                match both[0].append("a", &[new]) {
                    Ok(_) => {}
                    Err(error) => return (frame as usize, error),
                }
            }
            unreachable!()
        });
        std::thread::sleep(std::time::Duration::from_millis(200));
        assert_eq!(both[1].change(session("a"), &[Change::Phase(Phase::Deleted)]), Ok(true));
        let there = both[1].frames("a").expect("frames").len();
        assert_eq!(appending.join().expect("ended"), (there, CatalogError::Gone));
    });
    assert_eq!(both[1].remove(session("a")), Ok(()));
    assert_eq!(server.sql("SELECT (SELECT count(*) FROM frames), (SELECT count(*) FROM chunks)"), "0|0");
}

#[test]
fn calls_wait_for_each_other_where_the_user_gets_few_connections() {
    let Some(server) = Server::start() else { return };
    server.sql("CREATE ROLE few LOGIN CONNECTION LIMIT 3");
    server.sql("GRANT CREATE ON DATABASE postgres TO few");
    let catalog = PostgresCatalog::open(&server.url_of("few")).expect("a catalogue");
    catalog.claim().expect("it is its own");
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| (0..20).for_each(|_| assert_eq!(catalog.probe(), Ok(()))));
        }
    });
}
