//! What calls cost, beside SQLite: `cargo test --release -p cager-store --test postgres -- --ignored --nocapture figures`.

use crate::conformance::{append, cage, open, session};
use crate::support::Server;
use cager_store::{Catalog, Key, NewRecord, Phase, SqliteCatalog};
use std::time::Instant;

#[test]
#[ignore = "it measures"]
fn figures() {
    let folder = tempfile::tempdir().expect("a folder");
    let sqlite = SqliteCatalog::open(&folder.path().join("catalogue")).expect("a catalogue");
    let server = Server::start();
    let postgres = server.as_ref().map(Server::open);
    for _ in 0..2 {
        measure("SQLite", &sqlite);
        if let Some(postgres) = &postgres {
            measure("PostgreSQL", postgres);
        }
    }
}

fn measure(name: &str, catalog: &dyn Catalog) {
    let id = format!("a{}", catalog.records().expect("records").len());
    open(catalog, &id);
    let mut times: Vec<f64> = (0..500)
        .map(|frame| {
            let one = [(frame, cage(frame, 350))];
            let began = Instant::now();
            append(catalog, &id, &one);
            1e3 * began.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let began = Instant::now();
    std::thread::scope(|scope| {
        for thread in 0..4u32 {
            let id = &id;
            scope.spawn(move || {
                for round in 0..25 {
                    let first = 10_000 * (thread + 1) + 64 * round;
                    let new: Vec<_> = (first..first + 64).map(|frame| (frame, cage(frame, 350))).collect();
                    append(catalog, id, &new);
                }
            });
        }
    });
    let rate = f64::from(4 * 25 * 64 * 4200) / 1e6 / began.elapsed().as_secs_f64();
    assert!(catalog.record(session(&id)).expect("read").is_some());
    let there = catalog.records().expect("records").len();
    for number in there..10_000 {
        let id = format!("r{number}");
        let key = Key { kind: cager_store::Kind::CageJob, id: &id };
        catalog.create(NewRecord { key, created_ms: 1, phase: Phase::Open, meta: &[b'x'; 300] }).expect("created");
    }
    let began = Instant::now();
    let records = catalog.records().expect("records").len();
    let read = 1e3 * began.elapsed().as_secs_f64();
    eprintln!(
        "{name}: one cage {:.2} ms, p99 {:.2} ms; 64 at a time from 4 threads {rate:.1} MB/s; {records} records in {read:.0} ms",
        times[250], times[495]
    );
}
