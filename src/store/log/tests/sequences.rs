//! Appends, ends, power cuts and faults in any order.

use super::{append, frames};
use crate::store::faults::{Fault, Loss, Op};
use crate::store::log::FrameLog;
use crate::store::tests::{EIO, ENOSPC, Given, ROWS, meta};
use crate::store::{Store, StoreError};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Clone, Debug)]
enum Step {
    Append(u32),
    Reopen,
    Kill,
    Cut(Loss),
    Arm(Op, u64, Fault),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let op = prop::sample::select(vec![Op::Write, Op::Sync, Op::Truncate, Op::Read, Op::Rename, Op::SyncDir]);
    let fault = prop::sample::select(vec![Fault::Error(EIO), Fault::Error(ENOSPC), Fault::Short, Fault::Stop]);
    let loss = prop_oneof![Just(Loss::Everything), any::<u64>().prop_map(Loss::Torn)];
    let step = prop_oneof![
        6 => (1u32..5).prop_map(Step::Append),
        1 => Just(Step::Reopen),
        1 => Just(Step::Kill),
        2 => loss.prop_map(Step::Cut),
        4 => (op, 1u64..4, fault).prop_map(|(op, nth, fault)| Step::Arm(op, nth, fault)),
    ];
    prop::collection::vec(step, 1..40)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn whatever_happens_acknowledged_frames_stay(steps in steps()) {
        let given = Given::new();
        let disk = &given.disk;
        let mut store = given.open().store;
        store.create_session(&meta("a")).unwrap();
        let mut log: Option<FrameLog> = None;
        let mut acknowledged = BTreeMap::new();
        let mut next = 0;
        for step in steps.into_iter().chain([Step::Cut(Loss::Everything), Step::Reopen]) {
            let restart = match step {
                Step::Append(count) => {
                    let new: Vec<u32> = (next..next + count).collect();
                    next += count;
                    if let Some(Ok(entries)) = log.as_mut().map(|log| append(log, &new)) {
                        acknowledged.extend(entries.into_iter().map(|entry| (entry.frame, entry.offset)));
                    }
                    None
                }
                Step::Arm(op, nth, fault) => {
                    disk.fail(Some(op), nth, fault);
                    None
                }
                Step::Reopen => {
                    log = None;
                    match store.open_log("a", ROWS) {
                        Ok((opened, entries)) => {
                            // Reading them to compare may meet an armed fault.
                            disk.disarm();
                            let found: BTreeMap<u32, u64> = entries.iter().map(|e| (e.frame, e.offset)).collect();
                            for (frame, offset) in &acknowledged {
                                prop_assert_eq!(found.get(frame), Some(offset), "frame {} is lost", frame);
                            }
                            if !disk.is_stopped() {
                                frames(&opened, &entries);
                            }
                            // What is shown counts.
                            acknowledged = found;
                            log = Some(opened);
                        }
                        Err(error) => prop_assert!(!matches!(error, StoreError::Damaged { .. }), "{}", error),
                    }
                    None
                }
                Step::Kill => Some(Loss::Nothing),
                Step::Cut(loss) => Some(loss),
            };
            if let Some(loss) = restart {
                log = None;
                drop(store);
                disk.restart(loss).unwrap();
                let opened = Store::open(given.root(), Arc::new(disk.clone())).unwrap();
                prop_assert_eq!(opened.sessions.len(), 1);
                prop_assert!(opened.quarantined.is_empty());
                store = opened.store;
            }
        }
    }
}
