//! Processes that share a database by shards.

use crate::conformance::open;
use crate::support::Server;
use cager_store::{Catalog, Members, PostgresCatalog};
use std::time::{Duration, Instant};

fn join(server: &Server, shards: u32, address: &str) -> Members {
    Members::join(&server.url(), shards, address).expect("a member")
}

/// Waits until `what` is so.
fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let clock = Instant::now();
    while !is_so() {
        assert!(clock.elapsed() < Duration::from_secs(10), "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn processes_see_each_other_and_who_serves_what() {
    let Some(server) = Server::start() else { return };
    let (a, b) = (join(&server, 4, "http://a"), join(&server, 2, "http://b"));
    assert_eq!((a.shards(), b.shards()), (4, 4), "as many as there were");
    assert_ne!(a.number(), b.number());
    let seen = b.look().expect("how things are");
    assert_eq!(seen.processes.values().map(String::as_str).collect::<Vec<_>>().len(), 2);
    assert_eq!(seen.free.len(), 4);
    let shard = PostgresCatalog::open_shard(&server.url(), 3, 4).expect("a shard");
    shard.claim().expect("it is free");
    a.serves(3, &[]).expect("said");
    let seen = b.look().expect("how things are");
    assert_eq!((seen.holders.get(&3), seen.free.contains(&3)), (Some(&a.number()), false));
    // What is given up is free, though its catalogue is still there.
    a.leaves(&[3, 2]).expect("said");
    shard.release();
    until("it is not free", || b.look().expect("how things are").free.contains(&3));
    assert_eq!(b.look().expect("how things are").holders.get(&3), None);
    a.ends().expect("said");
    let seen = b.look().expect("how things are");
    assert_eq!((seen.processes.len(), seen.staying().collect::<Vec<_>>()), (2, vec![b.number()]));
    // Who is gone serves nothing.
    a.serves(1, &[]).expect("said");
    drop(a);
    until("it still lives", || b.look().expect("how things are").processes.len() == 1);
    assert_eq!(b.look().expect("how things are").holders.len(), 0);
}

#[test]
fn tenants_are_spread_and_stay_where_they_are() {
    let Some(server) = Server::start() else { return };
    let first = server.open();
    first.claim().expect("it is free");
    open(&first, "a");
    let a = join(&server, 3, "http://a");
    assert_eq!(a.shard_of("new").expect("asked"), None, "nobody knows yet whose sessions are there already");
    a.serves(0, &["old".to_owned(), "older".to_owned()]).expect("said");
    assert_eq!(a.shard_of("old").expect("asked"), Some(0));
    let of = |tenant: &str| a.shard_of(tenant).expect("asked").expect("known");
    assert_eq!(of("o"), 0, "the others were never served");
    for shard in 1..3 {
        a.serves(shard, &[]).expect("said");
    }
    let spread: Vec<u32> = ["p", "q", "r", "s", "t"].map(of).to_vec();
    assert_eq!(spread, [1, 2, 1, 2, 1]);
    let b = join(&server, 6, "http://b");
    assert_eq!(b.shard_of("q").expect("asked"), Some(2), "more shards move nobody");
    assert_eq!(a.look().expect("how things are").free.len(), 5, "those of the first process are seen by the other one");
    assert_eq!(a.shards(), 6);
    b.serves(3, &[]).expect("said");
    assert_eq!(b.shard_of("u").expect("asked"), Some(3));
    let more = PostgresCatalog::open_shard(&server.url(), 6, 8);
    assert!(more.is_err_and(|error| error.to_string().contains("is divided into 6 shards")));
}

#[test]
fn shards_have_schemas_of_their_own() {
    let Some(server) = Server::start() else { return };
    join(&server, 2, "http://a");
    let catalogs = [0, 1].map(|shard| PostgresCatalog::open_shard(&server.url(), shard, 2).expect("a shard"));
    for catalog in &catalogs {
        catalog.claim().expect("it is free");
    }
    open(&catalogs[0], "a");
    open(&catalogs[1], "b");
    let ids = |of: &PostgresCatalog| of.records().expect("records").into_iter().map(|r| r.id).collect::<Vec<_>>();
    assert_eq!([ids(&catalogs[0]), ids(&catalogs[1])], [["a"], ["b"]]);
    assert_eq!(server.sql("SELECT count(*) FROM cager_1.records"), "1");
}

#[test]
fn a_member_that_was_cut_off_comes_back() {
    let Some(server) = Server::start() else { return };
    let (a, b) = (join(&server, 2, "http://a"), join(&server, 2, "http://b"));
    a.serves(1, &[]).expect("said");
    server.sql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE pid <> pg_backend_pid() AND application_name = 'cager'");
    until("a is lost", || a.look().is_ok());
    until("b is lost", || b.look().is_ok_and(|seen| seen.processes.len() == 2 && seen.holders.len() == 1));
}
