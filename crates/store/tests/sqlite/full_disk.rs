//! Disks that fill, as small ones of memory do. Where the system does not let a user have one, nothing is tested.

use crate::conformance::{append, bytes, cage, cages, entry, open, session};
use crate::support::{file, folder_of_child, with_small_disk};
use cager_store::{Catalog, CatalogError, Change, FrameEntry, NewFrame, Phase, SqliteCatalog};
use std::path::Path;
use std::time::{Duration, Instant};

/// More than the catalogue's reserve and its log need.
const DISK: u32 = 48;
/// Bytes of a whole reserve, of the least, and of the steps between.
const WHOLE: u64 = 8 << 20;
const LEAST: u64 = 512 << 10;
const STEP: u64 = 32 << 10;

/// Fills the disk with frames of sessions in turn, as fast as it can or with pauses. Gives what was acknowledged.
fn fill(catalog: &SqliteCatalog, ids: &[&str], pause: Duration) -> Vec<(usize, FrameEntry)> {
    let mut acknowledged = Vec::new();
    for first in (0..).step_by(64) {
        std::thread::sleep(pause);
        let of = first as usize / 64 % ids.len();
        let cages: Vec<_> = (first..first + 64).map(|frame| cage(frame, 350)).collect();
        let new = cages.iter().zip(first..).map(|(cage, frame)| NewFrame { entry: entry(frame), cage });
        match catalog.append(ids[of], &new.collect::<Vec<_>>()) {
            Ok(stored) => acknowledged.extend(stored.into_iter().map(|entry| (of, entry))),
            Err(error) => {
                assert_eq!(error, CatalogError::Full);
                break;
            }
        }
    }
    assert!(acknowledged.len() > 1000, "only {} frames", acknowledged.len());
    // Until nothing more fits.
    while let Ok(()) = catalog.probe() {}
    assert_eq!(catalog.probe(), Err(CatalogError::Full));
    acknowledged
}

fn assert_there(catalog: &SqliteCatalog, id: &str, of: usize, acknowledged: &[(usize, FrameEntry)]) {
    let entries: Vec<_> = acknowledged.iter().filter(|(by, _)| *by == of).map(|(_, entry)| *entry).collect();
    assert_eq!(catalog.frames(id), Ok(entries.clone()));
    let expected: Vec<u8> = entries.iter().flat_map(|entry| bytes(&cage(entry.frame, 350))).collect();
    assert!(cages(catalog, id, &entries) == expected);
}

fn delete(catalog: &SqliteCatalog, id: &str) {
    assert_eq!(catalog.change(session(id), &[Change::Phase(Phase::Deleted)]), Ok(true));
    assert_eq!(catalog.remove(session(id)), Ok(()));
    assert_eq!(catalog.record(session(id)), Ok(None));
}

/// The session has its last frame again within some rounds of upkeep.
fn is_written_again(catalog: &SqliteCatalog, id: &str) {
    let began = Instant::now();
    let new: Vec<_> = (0..64).map(|frame| cage(frame, 350)).collect();
    let new: Vec<_> = new.iter().zip(1 << 20..).map(|(cage, frame)| NewFrame { entry: entry(frame), cage }).collect();
    while let Err(error) = catalog.append(id, &new) {
        assert_eq!(error, CatalogError::Full);
        assert!(began.elapsed() < Duration::from_secs(15), "there is room, and nothing can be written");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// It is whole; on a disk where that is too much, at least as large as what is left beside it.
fn reserve_is_back(folder: &Path) {
    let began = Instant::now();
    loop {
        let bytes = std::fs::metadata(folder.join("catalogue.reserve")).map_or(0, |reserve| reserve.len());
        let system = rustix::fs::statvfs(folder).expect("the disk");
        let room = system.f_bavail * system.f_frsize;
        if bytes == WHOLE || bytes >= LEAST.max(room / 2 / STEP * STEP) {
            return;
        }
        assert!(began.elapsed() < Duration::from_secs(20), "{bytes} bytes are kept free, and {room} are left");
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn deletes_and_goes_on(folder: &Path, pause: Duration) {
    let catalog = SqliteCatalog::open(&file(folder)).expect("a catalogue");
    ["a", "b"].into_iter().for_each(|id| open(&catalog, id));
    let acknowledged = fill(&catalog, &["a", "b"], pause);
    [("a", 0), ("b", 1)].into_iter().for_each(|(id, of)| assert_there(&catalog, id, of, &acknowledged));
    delete(&catalog, "b");
    assert_there(&catalog, "a", 0, &acknowledged);
    is_written_again(&catalog, "a");
    delete(&catalog, "a");
    reserve_is_back(folder);
    // With all of the room that it gives back, which takes some rounds.
    let began = Instant::now();
    while std::fs::metadata(folder.join("catalogue.reserve")).map_or(0, |reserve| reserve.len()) != WHOLE {
        assert!(began.elapsed() < Duration::from_secs(20), "the reserve is not whole again");
        std::thread::sleep(Duration::from_millis(100));
    }
    drop(catalog);
    assert_eq!(SqliteCatalog::open(&file(folder)).expect("a catalogue").records(), Ok(Vec::new()));
}

#[test]
fn a_disk_that_fills_slowly_loses_nothing_and_deletions_make_room() {
    with_small_disk("full_disk::child_that_fills_slowly", DISK);
}

#[test]
#[ignore = "another test starts it"]
fn child_that_fills_slowly() {
    folder_of_child().iter().for_each(|folder| deletes_and_goes_on(folder, Duration::from_millis(60)));
}

#[test]
fn a_disk_that_fills_at_once_loses_nothing_and_deletions_make_room() {
    with_small_disk("full_disk::child_that_fills_at_once", DISK);
}

#[test]
#[ignore = "another test starts it"]
fn child_that_fills_at_once() {
    folder_of_child().iter().for_each(|folder| deletes_and_goes_on(folder, Duration::ZERO));
}

#[test]
fn several_deletions_share_the_reserve() {
    with_small_disk("full_disk::child_with_several_deletions", DISK);
}

#[test]
#[ignore = "another test starts it"]
fn child_with_several_deletions() {
    let Some(folder) = folder_of_child() else { return };
    let catalog = SqliteCatalog::open(&file(&folder)).expect("a catalogue");
    let ids = ["a", "b", "c", "d"];
    ids.into_iter().for_each(|id| open(&catalog, id));
    fill(&catalog, &ids, Duration::ZERO);
    std::thread::scope(|scope| {
        ids.map(|id| scope.spawn(|| delete(&catalog, id))).map(|done| done.join().expect("deleted"))
    });
}

#[test]
fn a_disk_that_is_filled_after_each_deletion_takes_the_next_one() {
    with_small_disk("full_disk::child_that_is_filled_again", DISK);
}

#[test]
#[ignore = "another test starts it"]
fn child_that_is_filled_again() {
    let Some(folder) = folder_of_child() else { return };
    let catalog = SqliteCatalog::open(&file(&folder)).expect("a catalogue");
    let ids = ["a", "b", "c", "d"];
    for id in ids {
        open(&catalog, id);
        // Less than a whole reserve.
        append(&catalog, id, &(0..640).map(|frame| (frame, cage(frame, 350))).collect::<Vec<_>>());
    }
    for id in ids {
        for other in 0.. {
            if std::fs::write(folder.join(format!("{id}{other}")), vec![1; 64 << 10]).is_err() {
                break;
            }
        }
        delete(&catalog, id);
        reserve_is_back(&folder);
    }
}

#[test]
fn room_made_by_others_is_used_without_opening_anew() {
    with_small_disk("full_disk::child_with_a_disk_that_others_fill", DISK);
}

#[test]
#[ignore = "another test starts it"]
fn child_with_a_disk_that_others_fill() {
    let Some(folder) = folder_of_child() else { return };
    let catalog = SqliteCatalog::open(&file(&folder)).expect("a catalogue");
    open(&catalog, "a");
    let stored = append(&catalog, "a", &[(0, cage(0, 350))]);
    let other = folder.join("other");
    let fill = || std::fs::write(&other, vec![1; (DISK as usize) << 20]).expect_err("it did not fill the disk");
    fill();
    while let Ok(()) = catalog.probe() {}
    let cage = cage(1, 350);
    let new = NewFrame { entry: entry(1), cage: &cage };
    assert_eq!(catalog.append("a", &[new; 64]), Err(CatalogError::Full));
    assert_eq!(catalog.frames("a"), Ok(stored.clone()));
    std::fs::remove_file(&other).expect("removed");
    let more = catalog.append("a", &[new]).expect("appended");
    assert_eq!(catalog.frames("a"), Ok([stored, more].concat()));
    // Opened on a full disk, it can at least be read and deleted from.
    fill();
    drop(catalog);
    fill();
    let catalog = SqliteCatalog::open(&file(&folder)).expect("a catalogue on a full disk");
    assert_eq!(catalog.frames("a").expect("frames").len(), 2);
    delete(&catalog, "a");
}
