//! Makes cages around every model of the data and prints what an independent check finds: `enclose_all [PART OF A NAME] [VERTICES…]`.
//! `CAGES_OUT` names a folder to write them to.
#![allow(clippy::print_stdout)]

#[path = "../tests/common/mod.rs"]
mod common;

use cager_cages::{EncloseOptions, enclose};
use std::fmt::Write;
use std::time::Instant;

fn main() {
    let data = common::data();
    let mut arguments = std::env::args().skip(1);
    let name_part = arguments.next().unwrap_or_default();
    let mut counts: Vec<usize> = arguments.filter_map(|a| a.parse().ok()).collect();
    if counts.is_empty() {
        counts = vec![50, 150, 350, 1000];
    }
    println!(
        "{:<38} {:>6} {:>8} {:>8} {:>7} {:>9}  valid",
        "model", "points", "asked", "vertices", "seconds", "clearance"
    );
    for (name, model) in common::models(&data) {
        if !name.contains(&name_part) {
            continue;
        }
        for &vertices in &counts {
            let start = Instant::now();
            let cage = enclose(&model, &EncloseOptions { vertices, ..EncloseOptions::default() });
            let seconds = start.elapsed().as_secs_f64();
            print!("{name:<38} {:>6} {vertices:>8} ", model.points.len());
            match cage {
                Ok(cage) => {
                    let verdict = common::verdict(&cage, &model);
                    let valid = if verdict.is_valid(1) { "yes".to_owned() } else { format!("NO {verdict:?}") };
                    println!("{:>8} {seconds:>7.2} {:>9.5}  {valid}", cage.vertices.len(), verdict.clearance);
                    if let Some(folder) = std::env::var_os("CAGES_OUT") {
                        let mut text = String::new();
                        cage.vertices.iter().for_each(|v| writeln!(text, "v {} {} {}", v[0], v[1], v[2]).unwrap());
                        cage.triangles
                            .iter()
                            .for_each(|t| writeln!(text, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1).unwrap());
                        let file = format!("{}-{vertices}.obj", name.replace('/', "-").trim_end_matches(".obj"));
                        std::fs::write(std::path::Path::new(&folder).join(file), text).unwrap();
                    }
                }
                Err(error) => println!("{:>8} {seconds:>7.2} {:>9}  {error}", "-", "-"),
            }
        }
    }
}
