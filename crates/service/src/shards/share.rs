//! How shards are shared out: what one process takes and gives up, from what all of them see. Nothing is moved that need not be.

use cager_store::Membership;
use std::collections::BTreeMap;

/// The shards of `open` that process `me`, which has `own` of `shards`, takes now. Until each process has as many as all can have, no other one is taken; what
/// is left then goes to whoever is faster. Each begins elsewhere, so that they do not want the same.
pub(super) fn wanted(seen: &Membership, me: i32, own: usize, shards: u32, open: &[u32]) -> Vec<u32> {
    let (shards, processes) = (shards as usize, seen.staying().count().max(1));
    let (least, most) = (shards / processes, shards.div_ceil(processes));
    let counts = counts(seen);
    let missing: usize =
        counts.iter().filter(|(number, _)| **number != me).map(|(_, n)| least.saturating_sub(*n)).sum();
    let first = least.saturating_sub(own).min(open.len());
    let is_one_left = own + first < most && open.len() > first + missing;
    let rank = seen.staying().position(|number| number == me).unwrap_or_default();
    let mut open: Vec<(usize, u32)> = open.iter().copied().enumerate().collect();
    open.sort_by_key(|(at, _)| (at + processes - rank) % processes);
    open.into_iter().map(|(_, shard)| shard).take(first + usize::from(is_one_left)).collect()
}

/// Whether process `me` gives a shard up: the last of those that have most, where another one has two fewer.
pub(super) fn gives_up(seen: &Membership, me: i32) -> bool {
    let counts = counts(seen);
    let most = counts.iter().max_by_key(|(number, count)| (**count, **number));
    let least = counts.values().min();
    most.zip(least).is_some_and(|((number, most), least)| *number == me && *most > least + 1)
}

/// How many shards each process serves that goes on.
fn counts(seen: &Membership) -> BTreeMap<i32, usize> {
    let mut counts: BTreeMap<i32, usize> = seen.staying().map(|number| (number, 0)).collect();
    for holder in seen.holders.values() {
        counts.entry(*holder).and_modify(|count| *count += 1);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Lets the processes see and act in turns until nothing changes; gives how many shards were given up.
    fn settle(seen: &mut Membership, shards: u32) -> usize {
        let mut moves = 0;
        for _ in 0..200 {
            let before = (seen.holders.clone(), seen.free.clone());
            for me in seen.staying().collect::<Vec<_>>() {
                let own = seen.holders.values().filter(|holder| **holder == me).count();
                let open: Vec<u32> = seen.free.iter().copied().collect();
                if open.is_empty() && gives_up(seen, me) {
                    let shard = *seen.holders.iter().rfind(|(_, holder)| **holder == me).expect("one of its own").0;
                    seen.holders.remove(&shard);
                    seen.free.insert(shard);
                    moves += 1;
                    // It is the first to see that.
                    let again = wanted(seen, me, own - 1, shards, &[shard]);
                    assert_eq!(again, [0u32; 0], "it takes back what it gave up");
                    continue;
                }
                for shard in wanted(seen, me, own, shards, &open) {
                    seen.free.remove(&shard);
                    seen.holders.insert(shard, me);
                }
            }
            if before == (seen.holders.clone(), seen.free.clone()) {
                break;
            }
        }
        assert!(seen.free.is_empty(), "{seen:?}");
        let counts = counts(seen);
        assert!(counts.values().max() <= counts.values().min().map(|n| n + 1).as_ref(), "{counts:?}");
        moves
    }

    #[test]
    fn processes_that_join_and_end_move_as_few_shards_as_can_be() {
        for (shards, processes) in [(4, 3), (8, 3), (12, 5), (6, 3), (1, 2), (5, 5), (3, 7)] {
            let free: BTreeSet<u32> = (0..shards).collect();
            let mut seen = Membership { free, ..Membership::default() };
            for number in 0..processes {
                seen.processes.insert(number, String::new());
                let moves = settle(&mut seen, shards);
                let least = if number == 0 { 0 } else { shards as usize / (number as usize + 1) };
                assert_eq!(moves, least, "{shards} shards, process {number} joins");
            }
            let gone = processes / 2;
            seen.processes.remove(&gone);
            let lost: Vec<u32> = seen.holders.iter().filter(|(_, holder)| **holder == gone).map(|(s, _)| *s).collect();
            for shard in lost {
                seen.holders.remove(&shard);
                seen.free.insert(shard);
            }
            assert!(settle(&mut seen, shards) <= 1, "{shards} shards, one of {processes} processes ends");
        }
    }
}
