//! What happens to the file while nobody asks for anything.

use crate::conformance::{append, cage, open, session};
use crate::support::Dir;
use cager_store::{Catalog, Change, Phase};
use std::time::{Duration, Instant};

fn within_rounds(what: &str, is_so: impl Fn() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < Duration::from_secs(20), "{what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn the_log_is_written_back_and_used_again_and_room_is_given_back() {
    let dir = Dir::new();
    let catalog = dir.open();
    open(&catalog, "a");
    let length = || std::fs::metadata(dir.file()).expect("the file").len();
    let frames: Vec<_> = (0..64).map(|frame| (frame, cage(frame, 350))).collect();
    let mut log = 0;
    let mut written = 0;
    for round in 0..4 {
        (0..3).for_each(|_| drop(append(&catalog, "a", &frames)));
        written += 3 * 64 * 4200;
        within_rounds("the log is not written back", || length() > written);
        std::thread::sleep(Duration::from_millis(300));
        match round {
            0 => log = dir.log().len(),
            // Where a round began between two appends, the next ones may follow in the log once.
            _ => assert!(dir.log().len() < 3 * log, "the log grows: {} bytes, then {}", log, dir.log().len()),
        }
    }
    assert_eq!(catalog.change(session("a"), &[Change::Phase(Phase::Deleted)]), Ok(true));
    assert_eq!(catalog.remove(session("a")), Ok(()));
    within_rounds("room is not given back", || length() < 256 << 10);
}
