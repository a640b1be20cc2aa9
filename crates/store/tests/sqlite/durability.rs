//! What was acknowledged is there afterwards, however the process ended.

use crate::conformance::{append, bytes, cage, cages, open, session};
use crate::support::{Dir, child, file, folder_of_child};
use cager_store::{Catalog, Change, Phase, SqliteCatalog};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::Stdio;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

const VERTICES: usize = 350;

#[test]
fn everything_is_there_after_closing_and_opening() {
    let dir = Dir::new();
    let catalog = dir.open();
    open(&catalog, "a");
    let stored = append(&catalog, "a", &[(0, cage(0, 9)), (1, cage(1, 9))]);
    assert_eq!(catalog.change(session("a"), &[Change::Damage("it".to_owned())]), Ok(true));
    let records = catalog.records();
    drop(catalog);
    assert!(dir.log().is_empty(), "the log is written back");
    let catalog = dir.open();
    assert_eq!(catalog.records(), records);
    assert_eq!(catalog.frames("a"), Ok(stored.clone()));
    assert_eq!(cages(&catalog, "a", &stored), [bytes(&cage(0, 9)), bytes(&cage(1, 9))].concat());
    append(&catalog, "a", &[(2, cage(2, 9))]);
}

/// As the power may fail: file and log as they are on the disk.
#[test]
fn copies_of_the_open_files_have_what_was_acknowledged() {
    let (dir, copy) = (Dir::new(), Dir::new());
    let catalog = dir.open();
    open(&catalog, "a");
    let stored = append(&catalog, "a", &[(0, cage(0, 9)), (1, cage(1, 9))]);
    for name in ["catalogue", "catalogue-wal"] {
        std::fs::copy(dir.path().join(name), copy.path().join(name)).expect("copied");
    }
    assert!(!copy.log().is_empty(), "nothing is in the log, so that this tests nothing");
    let copied = copy.open();
    assert_eq!(copied.records(), catalog.records());
    assert_eq!(copied.frames("a"), Ok(stored.clone()));
    assert_eq!(cages(&copied, "a", &stored), cages(&catalog, "a", &stored));
    // A log that ends within a frame, as a torn write leaves it, gives what is before it.
    let torn = Dir::new();
    std::fs::copy(copy.file(), torn.file()).expect("copied");
    let log = dir.log();
    std::fs::write(torn.path().join("catalogue-wal"), &log[..log.len() - 100]).expect("written");
    let torn = torn.open();
    assert_eq!(torn.record(session("a")).expect("read").map(|record| record.frame_bytes), Some(0));
    assert_eq!(torn.frames("a"), Ok(Vec::new()));
}

#[test]
fn a_killed_process_loses_nothing_acknowledged() {
    let dir = Dir::new();
    open(&dir.open(), "a");
    let mut acknowledged = Vec::new();
    for lines in 0..20 {
        let mut child = child("durability::child_that_appends", dir.path());
        let mut child = child.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("a child");
        let mut said = BufReader::new(child.stdout.take().expect("its output")).lines();
        let before = acknowledged.len();
        let mut read = |line: String| acknowledged.extend(line.strip_prefix("acknowledged ").map(str::to_owned));
        said.by_ref().map_while(Result::ok).take(5 + 3 * lines).for_each(&mut read);
        child.kill().expect("killed");
        said.map_while(Result::ok).for_each(&mut read);
        child.wait().expect("ended");
        assert!(acknowledged.len() > before, "the child said nothing");
        check(dir.path(), &acknowledged);
    }
    let mut file = dir.beside();
    assert_eq!(file.text("PRAGMA integrity_check"), "ok");
    for table in ["chunks", "frames"] {
        let sql = format!("SELECT count(*) FROM {table} WHERE record NOT IN (SELECT number FROM records)");
        assert_eq!(file.number(&sql), 0, "{table} of records that are not there");
    }
}

fn check(folder: &Path, acknowledged: &[String]) {
    let catalog = SqliteCatalog::open(&file(folder)).expect("a catalogue");
    let frames = catalog.frames("a").expect("frames");
    let read = cages(&catalog, "a", &frames);
    for (entry, read) in frames.iter().zip(read.chunks(12 * VERTICES)) {
        assert!(read == bytes(&cage(entry.frame, VERTICES)), "the cage of frame {}", entry.frame);
    }
    let there: Vec<_> = frames.iter().map(|entry| entry.frame).collect();
    let number = |said: &str| said.parse::<u32>().ok();
    for frame in acknowledged.iter().filter_map(|said| number(said)) {
        assert!(there.binary_search(&frame).is_ok(), "frame {frame} was acknowledged");
    }
    for removed in acknowledged.iter().filter(|said| number(said).is_none()) {
        assert_eq!(catalog.record(session(removed)), Ok(None), "it was acknowledged that {removed} is removed");
    }
    // As at a start of the service: what was begun is finished.
    for record in catalog.records().expect("records").iter().filter(|record| record.id != "a") {
        catalog.change(session(&record.id), &[Change::Phase(Phase::Deleted)]).expect("changed");
        catalog.remove(session(&record.id)).expect("removed");
    }
}

/// Says what it has done until it is killed.
#[test]
#[ignore = "other tests start it"]
fn child_that_appends() {
    let Some(folder) = folder_of_child() else { return };
    let catalog = SqliteCatalog::open(&file(&folder)).expect("a catalogue");
    let first = catalog.frames("a").expect("frames").last().map_or(0, |entry| entry.frame + 1);
    let next = AtomicU32::new(first);
    let say = |what: &str| {
        let mut out = std::io::stdout().lock();
        writeln!(out, "\nacknowledged {what}").and_then(|()| out.flush()).expect("somebody listens");
    };
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                loop {
                    let frame = next.fetch_add(1, Relaxed);
                    append(&catalog, "a", &[(frame, cage(frame, VERTICES))]);
                    say(&frame.to_string());
                }
            });
        }
        for id in (0..).map(|number| format!("removed-{first}-{number}")) {
            open(&catalog, &id);
            let new: Vec<_> = (0..200).map(|frame| (frame, cage(frame, 100))).collect();
            append(&catalog, &id, &new);
            catalog.change(session(&id), &[Change::Phase(Phase::Deleted)]).expect("changed");
            catalog.remove(session(&id)).expect("removed");
            say(&id);
        }
    });
}
