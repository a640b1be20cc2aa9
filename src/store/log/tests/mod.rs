//! Logs that are cut, changed, torn and misused.

use super::format::DATA_START;
use super::{FrameLog, LogEntry, LogRecord};
use crate::store::faults::{Fault, Loss, Op};
use crate::store::tests::{EIO, ENOSPC, Given, ROWS, meta};
use crate::store::{Store, StoreError};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;

mod sequences;

const STRIDE: u64 = 72 + 12 * ROWS as u64 + 4;

pub(crate) fn cage(frame: u32) -> Vec<f32> {
    (0..3 * ROWS).map(|i| frame as f32 * 100.0 + i as f32 + 0.25).collect()
}

fn record(frame: u32, cage: &[f32]) -> LogRecord<'_> {
    let f = f64::from(frame);
    let measured = frame.is_multiple_of(2);
    let entry = LogEntry {
        frame,
        offset: 0,
        l2: if measured { frame as f32 + 0.5 } else { f32::NAN },
        linf: if measured { frame as f32 + 0.75 } else { f32::NAN },
        squared: f * 3.0,
        spread: f * 7.0,
        handle_digest: [frame as u8; 16],
        full_digest: measured.then_some([!(frame as u8); 16]),
    };
    LogRecord { entry, cage }
}

pub(crate) fn append(log: &mut FrameLog, frames: &[u32]) -> Result<Vec<LogEntry>, StoreError> {
    let cages: Vec<Vec<f32>> = frames.iter().map(|&frame| cage(frame)).collect();
    let records: Vec<LogRecord<'_>> = frames.iter().zip(&cages).map(|(&frame, cage)| record(frame, cage)).collect();
    log.append(&records)
}

/// The entries' frames, each of which has to be what was appended to the bit.
pub(crate) fn frames(log: &FrameLog, entries: &[LogEntry]) -> Vec<u32> {
    let mut bytes = Vec::new();
    log.reader().read_cages(entries, &mut bytes).expect("entries of an opened log are readable");
    let one = 12 * ROWS as usize;
    assert_eq!(bytes.len(), entries.len() * one);
    for (entry, bytes) in entries.iter().zip(bytes.chunks_exact(one)) {
        let cage = cage(entry.frame);
        let raw: Vec<u8> = cage.iter().flat_map(|x| x.to_le_bytes()).collect();
        assert_eq!(bytes, raw, "cage of frame {}", entry.frame);
        let right = record(entry.frame, &cage).entry;
        assert_eq!(entry.l2.to_bits(), right.l2.to_bits());
        assert_eq!(entry.linf.to_bits(), right.linf.to_bits());
        assert_eq!((entry.squared, entry.spread), (right.squared, right.spread));
        assert_eq!((entry.handle_digest, entry.full_digest), (right.handle_digest, right.full_digest));
    }
    entries.iter().map(|entry| entry.frame).collect()
}

struct Fixture {
    given: Given,
    store: Store,
    path: PathBuf,
    /// The file after three groups, of 2, 1 and 3 frames.
    file: Vec<u8>,
}

const ALL: [u32; 6] = [4, 5, 0, 1, 2, 9];
const LAST_GROUP: u64 = DATA_START + 3 * STRIDE;

fn fixture() -> Fixture {
    let given = Given::new();
    let store = given.open().store;
    store.create_session(&meta("a")).unwrap();
    let (mut log, entries) = store.open_log("a", ROWS).unwrap();
    assert!(entries.is_empty());
    for group in [&ALL[..2], &ALL[2..3], &ALL[3..]] {
        append(&mut log, group).unwrap();
    }
    let path = given.root().join("sessions/a/frames.log");
    let file = std::fs::read(&path).unwrap();
    assert_eq!(file.len() as u64, DATA_START + 6 * STRIDE);
    Fixture { given, store, path, file }
}

impl Fixture {
    /// What opening gives for these bytes.
    fn open(&self, bytes: &[u8]) -> Result<Vec<u32>, StoreError> {
        // Emptying the file first would make the system write it out each time.
        let mut file = OpenOptions::new().write(true).open(&self.path).unwrap();
        file.write_all(bytes).and_then(|()| file.set_len(bytes.len() as u64)).unwrap();
        let opened = self.store.open_log("a", ROWS);
        if matches!(opened, Err(StoreError::Damaged { .. })) {
            assert_eq!(std::fs::read(&self.path).unwrap(), bytes, "damage is left as it is");
        }
        let (log, entries) = opened?;
        Ok(frames(&log, &entries))
    }

    fn damaged(&self, bytes: &[u8]) -> bool {
        matches!(self.open(bytes), Err(StoreError::Damaged { .. }))
    }

    /// As after a power cut that took all marks.
    fn unmarked(&self) -> Vec<u8> {
        let mut file = self.file.clone();
        file[512..DATA_START as usize].fill(0);
        file
    }
}

#[test]
fn a_cut_anywhere_is_damage_where_the_marks_say_so() {
    let fixture = fixture();
    for length in 0..fixture.file.len() {
        assert!(fixture.damaged(&fixture.file[..length]), "cut to {length} bytes");
    }
    assert_eq!(fixture.open(&fixture.file).unwrap(), ALL);
}

#[test]
fn a_changed_bit_anywhere_is_damage_or_does_not_matter() {
    let fixture = fixture();
    for at in 0..fixture.file.len() {
        let padding = (84..512).contains(&at) || (524..1024).contains(&at) || (1036..4096).contains(&at);
        let mark = (512..1036).contains(&at);
        for bit in if padding { at % 8..at % 8 + 1 } else { 0..8 } {
            let mut file = fixture.file.clone();
            file[at] ^= 1 << bit;
            if padding || mark {
                assert_eq!(fixture.open(&file).unwrap(), ALL, "bit {bit} of byte {at}");
            } else {
                assert!(fixture.damaged(&file), "bit {bit} of byte {at}");
            }
        }
    }
}

#[test]
fn without_marks_a_torn_last_group_is_cut_and_an_earlier_one_is_damage() {
    let fixture = fixture();
    let unmarked = fixture.unmarked();
    for length in DATA_START as usize..unmarked.len() {
        let whole = (length as u64 - DATA_START) / STRIDE;
        assert_eq!(fixture.open(&unmarked[..length]).unwrap(), ALL[..whole as usize], "cut to {length} bytes");
        let after = std::fs::metadata(&fixture.path).unwrap().len();
        assert_eq!(after, DATA_START + whole * STRIDE, "the torn end is cut off");
    }
    for at in DATA_START as usize..unmarked.len() {
        let mut file = unmarked.clone();
        file[at] ^= 1 << (at % 8);
        let record = (at as u64 - DATA_START) / STRIDE;
        if (at as u64) < LAST_GROUP {
            assert!(fixture.damaged(&file), "byte {at}: the last group says that this was durable");
        } else {
            assert_eq!(fixture.open(&file).unwrap(), ALL[..record as usize], "byte {at}");
        }
    }
}

#[test]
fn opening_marks_what_it_found() {
    let fixture = fixture();
    assert_eq!(fixture.open(&fixture.unmarked()).unwrap(), ALL);
    let marked = std::fs::read(&fixture.path).unwrap();
    assert!(fixture.damaged(&marked[..marked.len() - 1]), "what was shown once is never cut");
}

#[test]
fn a_new_mark_goes_over_the_older_one() {
    let fixture = fixture();
    for frame in 20..24 {
        let (mut log, _) = fixture.store.open_log("a", ROWS).unwrap();
        append(&mut log, &[frame]).unwrap();
        let file = std::fs::read(&fixture.path).unwrap();
        let mut marks = [512, 1024].map(|at| u64::from_le_bytes(std::array::from_fn(|i| file[at + i])));
        marks.sort_unstable();
        let length = file.len() as u64;
        assert_eq!(marks, [length - STRIDE, length]);
    }
}

#[test]
fn a_log_made_by_a_process_that_ended_keeps_what_the_next_one_appends() {
    for nth in 1.. {
        let given = Given::new();
        let store = given.open().store;
        store.create_session(&meta("a")).unwrap();
        given.disk.fail(None, nth, Fault::Stop);
        let done = store.open_log("a", ROWS).is_ok();
        drop(store);
        given.disk.restart(Loss::Nothing).unwrap();
        let store = given.open().store;
        append(&mut store.open_log("a", ROWS).unwrap().0, &[7]).unwrap();
        drop(store);
        given.disk.restart(Loss::Everything).unwrap();
        let (log, entries) = given.open().store.open_log("a", ROWS).unwrap();
        assert_eq!(frames(&log, &entries), [7], "ended at operation {nth}");
        if done {
            assert!(nth > 5, "there were operations to end at");
            break;
        }
    }
}

#[test]
fn a_log_of_other_cages_or_of_another_session_is_refused() {
    let fixture = fixture();
    assert!(matches!(fixture.store.open_log("a", ROWS + 1), Err(StoreError::Damaged { .. })));
    fixture.store.create_session(&meta("b")).unwrap();
    std::fs::copy(&fixture.path, fixture.given.root().join("sessions/b/frames.log")).unwrap();
    assert!(matches!(fixture.store.open_log("b", ROWS), Err(StoreError::Damaged { .. })));
}

#[test]
fn a_record_moved_elsewhere_is_none() {
    let fixture = fixture();
    let mut file = fixture.file.clone();
    let (first, second) = (DATA_START as usize, (DATA_START + STRIDE) as usize);
    file.copy_within(first..second, second);
    assert!(fixture.damaged(&file));
}

#[test]
fn the_first_of_two_records_of_a_frame_counts() {
    let given = Given::new();
    let store = given.open().store;
    store.create_session(&meta("a")).unwrap();
    let (mut log, _) = store.open_log("a", ROWS).unwrap();
    let first = append(&mut log, &[3, 1]).unwrap();
    append(&mut log, &[1, 2]).unwrap();
    drop(log);
    let (log, entries) = store.open_log("a", ROWS).unwrap();
    assert_eq!(frames(&log, &entries), [3, 1, 2]);
    assert_eq!(entries[1].offset, first[1].offset);
}

#[test]
fn only_one_writer_at_a_time() {
    let fixture = fixture();
    let log = fixture.store.open_log("a", ROWS).unwrap();
    assert!(matches!(fixture.store.open_log("a", ROWS), Err(StoreError::Io { .. })));
    drop(log);
    fixture.store.open_log("a", ROWS).unwrap();
}

#[test]
fn cages_are_read_in_any_order_and_checked_again() {
    let fixture = fixture();
    let (mut log, mut entries) = fixture.store.open_log("a", ROWS).unwrap();
    entries.sort_by_key(|entry| entry.frame);
    assert_eq!(frames(&log, &entries), [0, 1, 2, 4, 5, 9]);
    assert!(frames(&log, &[]).is_empty());
    let reader = log.reader();
    let many = append(&mut log, &Vec::from_iter(100..20_000)).unwrap();
    let (some, more) = (&many[..7000], &many[8000..]);
    frames(&log, &[some, more].concat());

    let refused = |entry: LogEntry| {
        let mut out = vec![7];
        let result = reader.read_cages(&[entries[0], entry], &mut out);
        assert!(matches!(result, Err(StoreError::Damaged { .. })), "{result:?}");
        assert_eq!(out, [7], "nothing of a failed read is given");
    };
    refused(LogEntry { frame: 77, ..entries[1] });
    refused(LogEntry { offset: entries[1].offset + 1, ..entries[1] });
    refused(LogEntry { offset: 0, ..entries[1] });
    refused(LogEntry { offset: u64::MAX / 4, ..entries[1] });
    let mut file = std::fs::read(&fixture.path).unwrap();
    file[entries[1].offset as usize + 90] ^= 1;
    std::fs::write(&fixture.path, file).unwrap();
    refused(entries[1]);
}

#[test]
fn a_cage_of_other_rows_is_refused_and_changes_nothing() {
    let fixture = fixture();
    let (mut log, _) = fixture.store.open_log("a", ROWS).unwrap();
    let (good, bad) = (cage(20), vec![0.0; 3]);
    assert!(log.append(&[record(20, &good), record(21, &bad)]).is_err());
    assert_eq!(log.append(&[]).unwrap(), []);
    assert_eq!(std::fs::read(&fixture.path).unwrap(), fixture.file);
}

#[test]
fn a_full_disk_refuses_frames_until_there_is_space() {
    let fixture = fixture();
    let disk = &fixture.given.disk;
    let (mut log, _) = fixture.store.open_log("a", ROWS).unwrap();
    disk.fail(Some(Op::Write), 1, Fault::Short);
    disk.fail_from(Some(Op::Write), 2, Fault::Error(ENOSPC));
    for _ in 0..3 {
        assert!(matches!(append(&mut log, &[20, 21]), Err(StoreError::Full { .. })));
    }
    disk.disarm();
    append(&mut log, &[21, 22]).unwrap();
    drop(log);
    let (log, entries) = fixture.store.open_log("a", ROWS).unwrap();
    assert_eq!(frames(&log, &entries), [4, 5, 0, 1, 2, 9, 21, 22]);
}

#[test]
fn a_log_that_cannot_be_cut_back_refuses_until_it_is_opened_anew() {
    let fixture = fixture();
    let disk = &fixture.given.disk;
    let (mut log, _) = fixture.store.open_log("a", ROWS).unwrap();
    disk.fail(Some(Op::Sync), 1, Fault::Error(EIO));
    disk.fail(Some(Op::Truncate), 1, Fault::Error(EIO));
    assert!(append(&mut log, &[20]).is_err());
    assert!(append(&mut log, &[20]).is_err(), "refused though the disk works again");
    drop(log);
    let (mut log, entries) = fixture.store.open_log("a", ROWS).unwrap();
    // Nobody was told of frame 20, but the file shows it, so from here on it counts.
    assert_eq!(frames(&log, &entries), [4, 5, 0, 1, 2, 9, 20]);
    append(&mut log, &[21]).unwrap();
    drop((log, fixture.store));
    disk.restart(Loss::Everything).unwrap();
    let (log, entries) = fixture.given.open().store.open_log("a", ROWS).unwrap();
    assert_eq!(frames(&log, &entries), [4, 5, 0, 1, 2, 9, 20, 21]);
}

#[test]
fn what_shares_a_block_with_a_failed_sync_survives_it() {
    let fixture = fixture();
    let disk = &fixture.given.disk;
    let (mut log, _) = fixture.store.open_log("a", ROWS).unwrap();
    append(&mut log, &[20]).unwrap();
    disk.fail(Some(Op::Sync), 1, Fault::Ruin(EIO));
    assert!(append(&mut log, &[21]).is_err());
    drop((log, fixture.store));
    disk.restart(Loss::Everything).unwrap();
    let (log, entries) = fixture.given.open().store.open_log("a", ROWS).unwrap();
    assert_eq!(frames(&log, &entries), [4, 5, 0, 1, 2, 9, 20]);
}

#[test]
fn what_a_sync_ruined_while_the_disk_refused_is_written_again_when_it_takes_it() {
    let fixture = fixture();
    let disk = &fixture.given.disk;
    let (mut log, _) = fixture.store.open_log("a", ROWS).unwrap();
    append(&mut log, &[20]).unwrap();
    disk.fail_from(Some(Op::Sync), 1, Fault::Ruin(EIO));
    assert!(append(&mut log, &[21]).is_err());
    drop(log);
    assert!(fixture.store.log_needs_rewrite("a"));
    assert!(fixture.store.open_log("a", ROWS).is_err(), "what is given would not be durable");
    assert!(fixture.store.log_needs_rewrite("a"));
    disk.disarm();
    drop(fixture.store.open_log("a", ROWS).unwrap());
    assert!(!fixture.store.log_needs_rewrite("a"));
    drop(fixture.store);
    disk.restart(Loss::Everything).unwrap();
    let (log, entries) = fixture.given.open().store.open_log("a", ROWS).unwrap();
    assert_eq!(frames(&log, &entries), [4, 5, 0, 1, 2, 9, 20]);
}
