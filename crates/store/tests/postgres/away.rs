//! A server that crashes, hangs or takes no writes for a while.

use crate::conformance::{append, bytes, cage, cages, entry, open};
use crate::support::Server;
use cager_store::{Catalog, NewFrame, PostgresCatalog};
use rustix::process::Signal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};

#[test]
fn a_killed_server_loses_nothing_acknowledged_and_is_used_again() {
    let Some(mut server) = Server::start() else { return };
    let catalog = server.open();
    open(&catalog, "a");
    let (next, ends, acknowledged) = (AtomicU32::new(0), AtomicBool::new(false), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while !ends.load(Relaxed) {
                    let frame = next.fetch_add(1, Relaxed);
                    let cage = cage(frame, 350);
                    match catalog.append("a", &[NewFrame { entry: entry(frame), cage: &cage }]) {
                        Ok(_) => acknowledged.lock().expect("unpoisoned").push(frame),
                        Err(_) => std::thread::sleep(Duration::from_millis(5)),
                    }
                }
            });
        }
        for _ in 0..3 {
            let before = acknowledged.lock().expect("unpoisoned").len();
            let began = Instant::now();
            while acknowledged.lock().expect("unpoisoned").len() < before + 50
                && began.elapsed() < Duration::from_secs(20)
            {
                std::thread::sleep(Duration::from_millis(5));
            }
            server.kill();
            server.run();
        }
        ends.store(true, Relaxed);
    });
    append(&catalog, "a", &[(u32::MAX, cage(u32::MAX, 350))]);
    let frames = catalog.frames("a").expect("frames");
    let acknowledged = acknowledged.into_inner().expect("unpoisoned");
    assert!(acknowledged.len() >= 150, "{} frames, so that this tests nothing", acknowledged.len());
    for frame in acknowledged {
        assert!(frames.iter().any(|entry| entry.frame == frame), "frame {frame} was acknowledged");
    }
    let expected: Vec<u8> = frames.iter().flat_map(|entry| bytes(&cage(entry.frame, 350))).collect();
    assert!(cages(&catalog, "a", &frames) == expected);
}

#[test]
fn a_restart_between_two_calls_is_not_noticed() {
    let Some(mut server) = Server::start() else { return };
    let catalog = server.open();
    open(&catalog, "a");
    append(&catalog, "a", &[(0, cage(0, 4))]);
    server.kill();
    // What serves the connection may outlive the server for a moment.
    let began = Instant::now();
    let error = loop {
        match catalog.probe() {
            Ok(()) => assert!(began.elapsed() < Duration::from_secs(20), "it is not away"),
            Err(error) => break error.to_string(),
        }
    };
    assert!(error.contains("cannot be reached") && error.contains("database postgres"), "{error}");
    server.run();
    append(&catalog, "a", &[(1, cage(1, 4))]);
    server.sql("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'cager'");
    append(&catalog, "a", &[(2, cage(2, 4))]);
    assert_eq!(catalog.frames("a").expect("frames").len(), 3);
}

#[test]
fn a_database_that_takes_no_writes_is_told_and_used_again() {
    let Some(server) = Server::start() else { return };
    let catalog = server.open();
    open(&catalog, "a");
    server.sql("ALTER DATABASE postgres SET default_transaction_read_only = on");
    server.sql("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'cager'");
    let cage = cage(0, 4);
    let new = [NewFrame { entry: entry(0), cage: &cage }];
    for error in [catalog.append("a", &new).map(drop), catalog.probe()] {
        let error = error.expect_err("it was written").to_string();
        assert!(error.contains("takes no writes") && error.contains("database postgres"), "{error}");
    }
    assert_eq!(catalog.frames("a"), Ok(Vec::new()), "it is read meanwhile");
    server.sql("ALTER DATABASE postgres RESET default_transaction_read_only");
    assert_eq!(catalog.append("a", &new).expect("appended").len(), 1);
}

#[test]
fn a_server_that_hangs_is_not_waited_for() {
    let Some(server) = Server::start() else { return };
    let url = format!("{}?connect_timeout=2&options=-cstatement_timeout%3D1000", server.url());
    let catalog = PostgresCatalog::open(&url).expect("a catalogue");
    open(&catalog, "a");
    server.signal(Signal::STOP);
    let began = Instant::now();
    let error = catalog.probe().expect_err("it hangs").to_string();
    let again = catalog.records().expect_err("it hangs").to_string();
    let waited = began.elapsed();
    server.signal(Signal::CONT);
    assert!(error.contains("does not answer") && again.contains("does not answer"), "{error}; {again}");
    assert!(waited < Duration::from_secs(8), "{waited:?}");
    assert_eq!(catalog.probe(), Ok(()));
}
