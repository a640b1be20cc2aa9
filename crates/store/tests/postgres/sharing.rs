//! Several processes on one database.

use crate::conformance::{append, bytes, cage, cages, open, session};
use crate::support::Server;
use cager_store::{Catalog, CatalogError, Change, Phase, PostgresCatalog};
use std::time::{Duration, Instant};

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
        std::thread::sleep(Duration::from_millis(200));
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

#[test]
fn calls_are_told_at_once_that_others_have_all_connections_and_go_on_when_one_is_given_back() {
    let Some(server) = Server::start() else { return };
    server.sql("CREATE ROLE few LOGIN CONNECTION LIMIT 3");
    server.sql("GRANT CREATE ON DATABASE postgres TO few");
    let open = || PostgresCatalog::open(&server.url_of("few")).expect("a catalogue");
    let until = |sql: &str, wanted: &str| {
        let began = Instant::now();
        while server.sql(sql) != wanted {
            assert!(began.elapsed() < Duration::from_secs(5), "{sql}: {}", server.sql(sql));
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let is_count = |wanted: &str| until("SELECT count(*) FROM pg_stat_activity WHERE usename = 'few'", wanted);
    let catalog = open();
    let own = server.sql("SELECT pid FROM pg_stat_activity WHERE usename = 'few'");
    let mut others = vec![open(), open()];
    is_count("3");
    // This process loses its only one, and another one takes the place.
    server.sql(&format!("SELECT pg_terminate_backend({own})"));
    is_count("2");
    others.push(open());
    is_count("3");
    std::thread::scope(|scope| {
        let calls = [(); 6].map(|()| scope.spawn(|| (Instant::now(), catalog.probe(), Instant::now())));
        for (began, outcome, ended) in calls.map(|call| call.join().expect("answered")) {
            let said = outcome.expect_err("no connection").to_string();
            assert!(said.contains("has no connection left"), "{said}");
            assert!(ended - began < Duration::from_secs(5), "after {:?}", ended - began);
        }
    });
    others.pop();
    is_count("2");
    assert_eq!(catalog.probe(), Ok(()));
    // Its only one is at work for long: who waits gets what others give back meanwhile.
    std::thread::scope(|scope| {
        let mut others = others;
        scope.spawn(|| server.sql("BEGIN; LOCK TABLE records; SELECT pg_sleep(6); COMMIT"));
        until("SELECT count(*) FROM pg_locks WHERE relation = 'records'::regclass AND granted", "1");
        let slow = scope.spawn(|| catalog.records());
        until("SELECT count(*) FROM pg_locks WHERE relation = 'records'::regclass AND NOT granted", "1");
        let waits = scope.spawn(|| catalog.probe());
        std::thread::sleep(Duration::from_millis(500));
        assert!(!waits.is_finished(), "there was a connection");
        others.pop();
        assert_eq!(waits.join().expect("answered"), Ok(()));
        assert!(!slow.is_finished(), "it waited for the other call");
        assert_eq!(slow.join().expect("answered"), Ok(Vec::new()));
    });
}
