//! Every target for a moment, always with the same bytes. `make fuzz` goes on from here, led by coverage.

use cager_fuzz::{TARGETS, Target, mutate};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Long for a reader of 64 KiB, even on a busy machine.
const SLOW: Duration = Duration::from_secs(5);

/// Runs one input; whatever goes wrong, the bytes are told.
fn check(target: &Target, bytes: &[u8], what: &str) {
    let clock = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| target.check(bytes)));
    let shown = &bytes[..bytes.len().min(2048)];
    assert!(outcome.is_ok(), "{}, {what}: \"{}\"", target.name, shown.escape_ascii());
    assert!(
        clock.elapsed() < SLOW,
        "{}, {what}: took {:?}: \"{}\"",
        target.name,
        clock.elapsed(),
        shown.escape_ascii()
    );
}

/// One target at a time: the memory of all threads is counted together.
static ALONE: Mutex<()> = Mutex::new(());

fn short(name: &str, rounds: u64) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let target = Target::find(name).expect("a target of this name");
    let seeds = (target.seeds)();
    for (k, seed) in seeds.iter().enumerate() {
        check(target, seed, &format!("seed {k}"));
        for length in 0..seed.len().min(300) {
            check(target, &seed[..length], &format!("seed {k} cut to {length}"));
        }
    }
    for round in 0..rounds {
        let mut rng = fastrand::Rng::with_seed(round);
        check(target, &mutate::mutated(&mut rng, &seeds, target.words), &format!("round {round}"));
    }
}

macro_rules! short {
    ($($test:ident $name:literal $rounds:literal;)*) => {
        $(#[test]
        fn $test() {
            short($name, $rounds);
        })*

        #[test]
        fn every_target_is_run() {
            let run = [$($name),*];
            assert_eq!(run.to_vec(), TARGETS.iter().map(|target| target.name).collect::<Vec<_>>());
        }
    };
}

// About a second each.
short! {
    obj "obj" 120_000;
    ply "ply" 120_000;
    off "off" 120_000;
    stl "stl" 120_000;
    glb "glb" 30_000;
    mtx "mtx" 120_000;
    bvh "bvh" 120_000;
    npy "npy" 240_000;
    pc2 "pc2" 240_000;
    mdd "mdd" 240_000;
    mcx "mcx" 120_000;
    abc "abc" 60_000;
    usdc "usdc" 60_000;
    usdz "usdz" 30_000;
    usda "usda" 20_000;
    glb_frames "glb-frames" 20_000;
    fbx "fbx" 5_000;
    npz "npz" 3_000;
    container "container" 30_000;
    record "record" 360_000;
    frames "frames" 240_000;
    new_session "new-session" 12_000;
    new_cage "new-cage" 6_000;
    range "range" 60_000;
    tokens "tokens" 30_000;
    config "config" 30_000;
    solver "solver" 15_000;
    small_files "small-files" 6_000;
}
