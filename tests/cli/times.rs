//! The times in the report are those of what they are called, and account for the whole.

use crate::support::{Dir, ENCODE};
use serde_json::Value;

fn seconds(report: &Value, key: &str) -> f64 {
    report["seconds"][key].as_f64().unwrap_or(0.0)
}

/// The parts account for most of the whole, and those that do not overlap for no more than it.
#[track_caller]
fn adds_up(report: &Value) {
    let sum = |keys: &[&str]| keys.iter().map(|key| seconds(report, key)).sum::<f64>();
    let before = sum(&["design", "coordinates", "maxvol", "svd"]);
    let all = before + sum(&["read", "invert", "measure", "code", "write"]);
    let total = seconds(report, "total");
    // Besides what a busy machine takes between the parts.
    assert!(before <= total && total - all < f64::max(0.2 * total, 0.3), "{}", report["seconds"]);
    assert!(before + seconds(report, "read") < 1.2 * total, "{}", report["seconds"]);
}

#[test]
fn the_design_of_a_cage_is_not_reading() {
    let (dir, _) = Dir::with_capture();
    let line = "encode --rest rest.obj --frames frames.npy -o out.cager --cage-vertices 40 --report report.json";
    let said = dir.cager(line).succeeds();
    let report = dir.json("report.json");
    let [read, design, total] = ["read", "design", "total"].map(|key| seconds(&report, key));
    assert!(design > 0.5 * total && read < 0.5 * design, "{}", report["seconds"]);
    let stages = report["design"]["stages"].as_array().expect("stages");
    let designed = stages.last().expect("a stage")["seconds"].as_f64().expect("seconds");
    assert!(design >= designed, "{design} of {designed}");
    assert!(said.stdout.contains(" s of it for the cage"), "{}", said.stdout);
    adds_up(&report);
}

#[test]
fn the_times_of_plain_and_coded_files_add_up() {
    let (dir, _) = Dir::with_capture();
    for (options, is_coded) in [("", false), ("--max-error 1e-3", true), ("--spectrum auto", false)] {
        let said = dir.cager(&format!("{ENCODE} --report report.json --handles all {options}")).succeeds();
        let report = dir.json("report.json");
        adds_up(&report);
        assert!(report["seconds"].get("design").is_none() && !said.stdout.contains("for the cage"), "{options}");
        assert_eq!(report["seconds"].get("code").is_some(), is_coded, "{options}: {}", report["seconds"]);
        // What is coded is measured as it is coded.
        assert_eq!(seconds(&report, "measure") > 0.0, !is_coded, "{options}: {}", report["seconds"]);
    }
}
