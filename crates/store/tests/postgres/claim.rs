//! One process at a time has the database for itself.

use crate::conformance::{entry, open};
use crate::support::Server;
use cager_store::{Catalog, CatalogError, NewFrame, PostgresCatalog};
use std::time::{Duration, Instant};

/// Ends the connections of whoever has the database, as where its machine is cut off.
fn cut_off(server: &Server) {
    server.sql(
        "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name ~ '^cager [0-9]+ on '",
    );
}

#[test]
fn who_has_it_is_named_to_others_and_followed_by_one_of_them() {
    let Some(server) = Server::start() else { return };
    let first = server.open();
    first.claim().expect("it is free");
    let other = server.open();
    let Err(CatalogError::InUse(said)) = other.claim() else { panic!("it was given twice") };
    assert!(said.contains(&format!("is used by `cager {} on ", std::process::id())), "{said}");
    // Of another schema it is not.
    let url = format!("{}?options=-csearch_path%3Danother", server.url());
    PostgresCatalog::open(&url).expect("a catalogue").claim().expect("it is free");
    drop(first);
    // The server needs a moment to see that a connection has ended.
    let clock = Instant::now();
    while let Err(error) = other.claim() {
        assert!(clock.elapsed() < Duration::from_secs(10), "it is not free again: {error}");
        std::thread::sleep(Duration::from_millis(20));
    }
    open(&other, "a");
}

#[test]
fn what_was_taken_over_changes_nothing_and_knows_of_it() {
    let Some(server) = Server::start() else { return };
    let first = server.open();
    first.claim().expect("it is free");
    open(&first, "a");
    cut_off(&server);
    let second = server.open();
    second.claim().expect("it is free");
    let frame = NewFrame { entry: entry(0), cage: &[0.5; 6] };
    assert_eq!(first.append("a", &[frame]), Err(CatalogError::TakenOver));
    assert_eq!(first.probe(), Err(CatalogError::TakenOver));
    assert!(second.frames("a").expect("frames").is_empty());
    second.append("a", &[frame]).expect("appended");
    // Reading is as before.
    assert_eq!(first.frames("a").expect("frames").len(), 1);
    let clock = Instant::now();
    while !first.is_taken_over() {
        assert!(clock.elapsed() < Duration::from_secs(10), "it does not notice");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(!second.is_taken_over());
}

#[test]
fn a_lock_that_was_lost_is_taken_again_where_nobody_was_faster() {
    let Some(server) = Server::start() else { return };
    let first = server.open();
    first.claim().expect("it is free");
    cut_off(&server);
    let other = server.open();
    let locked = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory'";
    let clock = Instant::now();
    while server.sql(locked) != "1" {
        assert!(clock.elapsed() < Duration::from_secs(10), "the lock is not taken again");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(matches!(other.claim(), Err(CatalogError::InUse(_))));
    open(&first, "a");
    assert!(!first.is_taken_over());
}

#[test]
fn a_change_that_is_under_way_is_waited_for() {
    let Some(server) = Server::start() else { return };
    let first = server.open();
    first.claim().expect("it is free");
    open(&first, "a");
    // A change that holds what changes hold.
    let held = server.sql("SELECT objid::bigint FROM pg_locks WHERE locktype = 'advisory'");
    let object = held.parse::<i64>().expect("a number") as u32 as i32;
    let sql = format!("BEGIN; SELECT pg_advisory_xact_lock_shared({}, {object}); SELECT pg_sleep(3)", 0x6361_6767);
    std::thread::scope(|scope| {
        scope.spawn(|| server.sql(&sql));
        let waits = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND mode = 'ShareLock' AND granted";
        while server.sql(waits).trim() == "0" {
            std::thread::sleep(Duration::from_millis(20));
        }
        cut_off(&server);
        let clock = Instant::now();
        server.open().claim().expect("it is free");
        assert!(clock.elapsed() > Duration::from_millis(150), "{:?}", clock.elapsed());
    });
}
