//! Many callers at once.

use crate::conformance::{append, bytes, cage, cages, entry, open, session};
use crate::support::Dir;
use cager_store::{Catalog, CatalogError, Change, FrameEntry, NewFrame, NewRecord, Phase, SqliteCatalog};
use std::time::Duration;

type Call<'a, T> = Box<dyn FnOnce() -> T + Send + 'a>;

/// Has `calls` wait together, the first of them alone, until their changes can be made. Gives their answers.
fn together<T: Send>(dir: &Dir, calls: Vec<Call<'_, T>>) -> Vec<T> {
    let mut lock = dir.beside();
    lock.run("BEGIN IMMEDIATE");
    std::thread::scope(|scope| {
        let calls = calls.into_iter().map(|call| {
            let called = scope.spawn(call);
            std::thread::sleep(Duration::from_millis(10));
            called
        });
        let calls: Vec<_> = calls.collect();
        // Until the last of them waits too.
        std::thread::sleep(Duration::from_millis(300));
        lock.run("COMMIT");
        calls.into_iter().map(|call| call.join().expect("an answer")).collect()
    })
}

/// Transactions in a log: their last page says how large the file is then.
fn transactions(log: &[u8]) -> usize {
    let page = u32::from_be_bytes(log[8..12].try_into().expect("four bytes")) as usize;
    log[32..].chunks_exact(24 + page).filter(|frame| frame[4..8] != [0; 4]).count()
}

#[test]
fn callers_at_once_share_a_transaction_and_get_their_own_answers() {
    let dir = Dir::new();
    let catalog = dir.open();
    ["a", "b"].into_iter().for_each(|id| open(&catalog, id));
    let before = transactions(&dir.log());
    let calls = (0..30).map(|number| {
        let catalog = &catalog;
        let id = ["a", "b"][number as usize % 2];
        Box::new(move || append(catalog, id, &[(number, cage(number, 30))])) as Call<'_, Vec<FrameEntry>>
    });
    let answers = together(&dir, calls.collect());
    let made = transactions(&dir.log()) - before;
    assert!((1..=3).contains(&made), "{made} transactions for 30 calls");
    for (number, stored) in (0..).zip(&answers) {
        assert_eq!(stored.iter().map(|entry| entry.frame).collect::<Vec<_>>(), [number]);
        assert_eq!(cages(&catalog, ["a", "b"][number as usize % 2], stored), bytes(&cage(number, 30)));
    }
    for (start, id) in [(0, "a"), (1, "b")] {
        let expected: Vec<_> = answers.iter().skip(start).step_by(2).map(|stored| stored[0]).collect();
        assert_eq!(catalog.frames(id), Ok(expected));
    }
}

#[test]
fn a_failing_call_does_not_undo_its_neighbours() {
    let dir = Dir::new();
    let catalog = dir.open();
    open(&catalog, "a");
    let before = transactions(&dir.log());
    let cage = cage(1, 400);
    let put = |id: &'static str, frame: u32| {
        let (catalog, cage) = (&catalog, &cage);
        Box::new(move || catalog.append(id, &[NewFrame { entry: entry(frame), cage }]).map(|stored| stored.len()))
            as Call<'_, Result<usize, CatalogError>>
    };
    let taken = Box::new(|| {
        let record = NewRecord { key: session("a"), created_ms: 5, phase: Phase::Open, meta: b"other" };
        catalog.create(record).map(|()| 0)
    });
    let answers = together(&dir, vec![put("a", 0), put("a", 1), put("missing", 2), put("a", 3), taken, put("a", 4)]);
    let (gone, taken) = (Err(CatalogError::Gone), Err(CatalogError::Taken));
    assert_eq!(answers, [Ok(1), Ok(1), gone, Ok(1), taken, Ok(1)]);
    let made = transactions(&dir.log()) - before;
    assert!(made <= 3, "{made} transactions, so that this tests nothing");
    let frames = catalog.frames("a").expect("frames");
    assert_eq!(frames.iter().map(|entry| entry.frame).collect::<Vec<_>>(), [0, 1, 3, 4]);
    assert_eq!(cages(&catalog, "a", &frames), bytes(&cage).repeat(4));
    assert_eq!(catalog.record(session("a")).expect("read").map(|record| record.meta), Some(b"{}".to_vec()));
    assert_eq!(dir.beside().number("SELECT count(*) FROM chunks"), 4, "nothing of what failed is left");
}

#[test]
fn threads_write_and_read_at_once() {
    let dir = Dir::new();
    let catalog = dir.open();
    let work = |id: &str, catalog: &SqliteCatalog| {
        open(catalog, id);
        for round in 0..20 {
            let stored = append(catalog, id, &[(2 * round, cage(round, 50)), (2 * round + 1, cage(round, 50))]);
            assert_eq!(catalog.change(session(id), &[Change::Reached(2 * round + 2)]), Ok(true));
            assert_eq!(cages(catalog, id, &stored), bytes(&cage(round, 50)).repeat(2));
            assert_eq!(catalog.frames(id).expect("frames").len(), 2 * round as usize + 2);
            assert!(catalog.records().expect("records").iter().any(|record| record.id == id));
        }
    };
    std::thread::scope(|scope| {
        for id in ["a", "b", "c", "d", "e", "f", "g", "h"] {
            let (work, catalog) = (&work, &catalog);
            scope.spawn(move || work(id, catalog));
        }
    });
    let records = catalog.records().expect("records");
    assert!(records.iter().all(|record| record.reached == 40 && record.frame_bytes == 40 * (600 + 96)), "{records:?}");
}
