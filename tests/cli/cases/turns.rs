//! Cases 28 and 29: bodies that are the same either way round.

use crate::refused::refused;
use crate::support::{Dir, read_frames};

#[test]
fn an_ambiguous_alignment_is_refused_in_words_that_know_what_was_given() {
    let dir = Dir::with_case("28-transfer-told-to-give-up-that-was-given");
    let transfer = "transfer --source-rest source.obj --source-frames frames.npy --target target.obj -o a.cager";
    refused(&dir, transfer, &["target.obj", "fit equally well; say which axis is up", "--up, --align none"]);
    let line = format!("{transfer} --up z");
    let ways = ["target.obj", "two headings about the axis up", "--align none, --align MATRIX"];
    refused(&dir, &line, &ways);
    let said = dir.cager(&line).run().stderr;
    assert!(!said.contains("which axis is up") && !said.contains("--up"), "{said}");
    dir.cager(&format!("{transfer} --up z --align none")).succeeds();
}

#[test]
fn a_scan_in_another_unit_is_not_turned_where_turns_fit_alike() {
    let dir = Dir::with_case("29-scale-auto-turns-by-180");
    let text = String::from_utf8(dir.read("scan_000.obj")).expect("UTF-8");
    let scanned: Vec<[f64; 3]> = text
        .lines()
        .filter_map(|line| line.strip_prefix("v "))
        .map(|line| {
            let at: Vec<f64> = line.split_whitespace().map(|x| x.parse().expect("a number")).collect();
            [at[0], at[1], at[2]]
        })
        .collect();
    for (options, unit) in [("--scale auto", 1.0), ("--scale auto --align auto", 1.0), ("--align auto", 1e-3)] {
        // As it came, and with other samples in other places of the file.
        for skipped in 0..4 {
            let some = scanned.iter().enumerate().filter(|(k, _)| skipped == 0 || k % 5 != skipped);
            let lines = some.map(|(_, p)| {
                let [x, y, z] = p.map(|x| unit * x);
                format!("v {x} {y} {z}\n")
            });
            dir.write("scan_000.obj", lines.collect::<String>());
            let recover =
                format!("recover --template template.obj --frames scan_000.obj {options} -o a.cager --overwrite");
            let said = dir.cager(&recover).succeeds().stdout;
            let turned =
                said.split_once("turned by ").and_then(|(_, rest)| rest.split_once(" degrees")).expect(&said).0;
            assert!(turned.parse::<f64>().expect("an angle") < 10.0, "{options}: {said}");
        }
    }
    dir.cager("decode a.cager -o a.npy").succeeds();
    let points = String::from_utf8(dir.read("template.obj")).expect("UTF-8");
    let count = points.lines().filter(|line| line.starts_with("v ")).count();
    let (frame, top) = (&read_frames(&dir.path("a.npy"), count)[0], 3 * (count - 1));
    assert!(frame[2] < -0.8 && frame[top + 2] > 0.8, "{} {}", frame[2], frame[top + 2]);
}
