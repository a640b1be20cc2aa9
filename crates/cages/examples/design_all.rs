//! Designs a cage of every capture of the data and prints what it took: `design_all [PART OF A NAME] [VERTICES] [SEEDS]`. Processor time is that of the whole
//! process, which other work on the machine does not change.
#![allow(clippy::print_stdout)]

#[path = "../tests/common/mod.rs"]
mod common;

use cager_cages::{DesignOptions, Goal, Style, design};
use std::ops::ControlFlow;
use std::time::Instant;

const CAPTURES: [&str; 5] = ["horse-gallop", "samba", "makehuman-cmu-walk", "anny-man-02_02", "supercages-arm"];

fn main() {
    let mut arguments = std::env::args().skip(1);
    let name_part = arguments.next().unwrap_or_default();
    let mut number = |usual| arguments.next().and_then(|a| a.parse().ok()).unwrap_or(usual);
    let (vertices, seeds) = (number(350), number(1));
    let style = if std::env::var_os("EDITABLE").is_some() { Style::Editable } else { Style::Free };
    println!(
        "{:<22} {:>4} {:>9} {:>9} {:>9} {:>9}   enclosed, first better, end: s CPU (s wall)",
        "capture", "seed", "vertices", "start %", "seen %", "held %"
    );
    for capture in CAPTURES.into_iter().filter(|capture| capture.contains(&name_part)) {
        let folder = common::data().join(capture);
        let rest = common::read_obj(&folder.join("rest.obj"));
        let frames = common::read_npy(&folder.join("frames.npy"), rest.points.len());
        for seed in 0..seeds as u64 {
            let options = DesignOptions { goal: Goal::Vertices(vertices), style, seed, ..DesignOptions::default() };
            let (cpu, clock) = (processor_seconds(), Instant::now());
            let taken = || format!("{:.1} ({:.1})", processor_seconds() - cpu, clock.elapsed().as_secs_f64());
            let (mut enclosed, mut first) = (None, None);
            let found = design(&rest, &frames, None, &options, &mut |told| {
                if told.error.is_some() && enclosed.is_none() {
                    enclosed = Some(taken());
                } else if told.better.is_some() && first.is_none() {
                    first = Some(taken());
                }
                ControlFlow::Continue(())
            });
            let end = taken();
            let found = found.unwrap();
            let (start, last) = (&found.stages[0], found.stages.last().unwrap());
            println!(
                "{capture:<22} {seed:>4} {:>9} {:>9.4} {:>9.4} {:>9.4}   {}, {}, {end}",
                found.cage.vertices.len(),
                100.0 * start.validation_error,
                100.0 * last.training_error,
                100.0 * last.validation_error,
                enclosed.unwrap_or_default(),
                first.unwrap_or_default(),
            );
        }
    }
}

/// User and system time of the process so far, in ticks of 10 ms.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|f| f.parse().ok())
        .collect();
    fields.iter().sum::<f64>() / 100.0
}
