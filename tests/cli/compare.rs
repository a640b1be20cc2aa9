//! `cager compare`.

use crate::refused::assert_sentence;
use crate::support::{Dir, Small, close, has_report_page, npy_f64};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use cager_geometry::mesh::Model;
use serde_json::Value;

const COMPARE: &str =
    "compare --rest rest.obj --cage cage.obj --frames frames.npy -o report.html --json figures.json --overwrite";

fn compared() -> (Dir, Value) {
    let (dir, _) = Dir::with_capture();
    dir.cager(COMPARE).succeeds();
    let figures = dir.json("figures.json");
    (dir, figures)
}

/// Figures of a method of the first system.
fn method<'a>(figures: &'a Value, handles: &str, regularizer: &str, spectrum: u64) -> &'a Value {
    let methods = figures["systems"][0]["figures"]["methods"].as_array().expect("methods");
    let found = methods
        .iter()
        .find(|m| m["handles"] == handles && m["regularizer"] == regularizer && m["spectrum"] == spectrum);
    found.unwrap_or_else(|| panic!("no {handles}, {regularizer}, {spectrum}"))
}

/// One comparison for all that is asked of it: it takes many seconds.
#[test]
fn a_comparison_is_complete_and_agrees_with_itself_and_with_encodings() {
    let (dir, figures) = compared();
    if has_report_page() {
        assert_eq!(dir.names(""), ["cage.obj", "figures.json", "frames.npy", "report.html", "rest.obj"]);
        let report = dir.report_page("report.html");
        assert_eq!(report["kind"], "comparison");
        same_to_single_precision("figures", &report["figures"], &figures);
        what_is_drawn_is_complete(&report);
    }
    figures_are_those_of_encodings_with_the_same_options(&dir, &figures);
    figures_fit_each_other(&figures);
}

fn same_to_single_precision(at: &str, found: &Value, expected: &Value) {
    match (found, expected) {
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(k, (a, b))| same_to_single_precision(&format!("{at}[{k}]"), a, b));
        }
        (Value::Object(a), Value::Object(b)) if a.len() == b.len() => {
            a.iter().for_each(|(key, value)| same_to_single_precision(&format!("{at}.{key}"), value, &b[key]));
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().expect("a number"), b.as_f64().expect("a number"));
            assert!((a - b).abs() <= 2e-7 * b.abs(), "{at}: {a:e} for {b:e}");
        }
        _ => assert_eq!(found, expected, "{at}"),
    }
}

fn what_is_drawn_is_complete(report: &Value) {
    let (geometry, figures) = (&report["geometry"], &report["figures"]["systems"][0]["figures"]);
    let bytes = |text: &Value| STANDARD.decode(text.as_str().expect("base64")).expect("base64").len();
    let list = |value: &Value| value.as_array().expect("a list").clone();
    let points = report["figures"]["capture"]["points"].as_u64().expect("points") as usize;
    let vertices = report["figures"]["capture"]["cage_vertices"].as_u64().expect("vertices") as usize;
    assert_eq!(bytes(&geometry["mesh"]["points"]["data"]), 6 * points);
    assert_eq!(bytes(&geometry["cage"]["vertices"]), 12 * vertices);
    let shown = &report["figures"]["capture"]["shown"];
    assert!(list(&geometry["frames"]).iter().any(|frame| frame["frame"] == *shown));
    let clip = list(&geometry["clip"]);
    assert!(clip.len() >= 3 && clip.contains(shown), "{clip:?}");
    let system = &geometry["systems"][0];
    assert_eq!(bytes(&system["handles"]), 12 * figures["unknowns"].as_u64().expect("unknowns") as usize);
    assert_eq!(list(&system["row"]).len(), 4);
    assert_eq!(list(&system["vectors"]).len(), list(&figures["vectors"]["painted"]).len());
    assert_eq!(bytes(&system["draw"]["offsets"]["data"]) % points, 0);
    let shown: Vec<Value> = list(&system["methods"]).iter().map(|of| of["method"].clone()).collect();
    for (place, method) in list(&figures["methods"]).iter().enumerate() {
        assert!(method["curve"] == false || shown.contains(&place.into()), "{method}");
    }
    for method in list(&system["methods"]) {
        assert_eq!(bytes(&method["cages"]["data"]), 6 * vertices * clip.len());
        assert_eq!(bytes(&method["offsets"]["data"]), 3 * points);
    }
}

fn figures_are_those_of_encodings_with_the_same_options(dir: &Dir, figures: &Value) {
    let usual = figures["systems"][0]["figures"]["unknowns"].as_u64().map_or(0, |m| 20.min(m / 16));
    for (handles, regularizer, spectrum) in [
        ("maxvol", "laplacian", usual),
        ("maxvol", "none", 0),
        ("all", "none", 0),
        ("all", "global", 0),
        ("maxvol", "truncated-svd", usual),
    ] {
        let options = format!("--handles {handles} --regularizer {regularizer} --spectrum {spectrum}");
        let line = format!(
            "encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite --report e.json {options}"
        );
        dir.cager(&line).succeeds();
        let report = dir.json("e.json");
        let found = method(figures, handles, regularizer, spectrum);
        for key in ["l2_mean", "l2_max", "linf_mean", "linf_max"] {
            let (ours, theirs) = (&found["totals"][key], &report["error"][key]);
            close(&format!("{options} {key}"), ours.as_f64().expect(key), theirs.as_f64().expect(key), 1e-6);
        }
        let frames = report["error"]["per_frame"].as_array().expect("frames");
        for (k, frame) in frames.iter().enumerate() {
            let (ours, theirs) = (found["per_frame"]["l2"][k].as_f64(), frame["l2"].as_f64());
            close(&format!("{options} frame {k}"), ours.expect("l2"), theirs.expect("l2"), 1e-6);
        }
        let spectra = &figures["systems"][0]["figures"]["spectra"];
        let condition = &report["condition_number"];
        let read = if handles == "all" { condition } else { spectra };
        let key = if handles == "all" { "full" } else { "condition_handles" };
        assert_eq!(read[key], condition["handles"]);
        close(
            "condition of Φ",
            spectra["condition_full"].as_f64().expect("full"),
            condition["full"].as_f64().expect("full"),
            1e-9,
        );
    }
}

fn figures_fit_each_other(figures: &Value) {
    let found = &figures["systems"][0]["figures"];
    let m = found["unknowns"].as_u64().expect("unknowns") as usize;
    assert_eq!(found["spectra"]["handles"].as_array().map(Vec::len), Some(m));
    assert_eq!(found["vectors"]["spread"].as_array().map(Vec::len), Some(m));
    assert_eq!(figures["capture"]["measured"].as_array().map(Vec::len), Some(20));
    let value = |path: &Value| path.as_f64().expect("a number");
    let least = value(&method(figures, "all", "none", 0)["totals"]["l2_mean"]);
    for other in found["methods"].as_array().expect("methods") {
        assert!(value(&other["totals"]["l2_mean"]) >= least * (1.0 - 1e-6), "{other}");
        // Second differences do not exist at the ends.
        let spikes = other["per_frame"]["spike_max"].as_array().expect("spikes");
        assert!(spikes[0].is_null() && spikes[19].is_null() && spikes[1..19].iter().all(Value::is_number));
    }
    for trace in [&found["swaps"]["from_lu"], &found["swaps"]["from_random"]] {
        let volume: Vec<f64> = trace["log_volume"].as_array().expect("volumes").iter().map(value).collect();
        assert!(volume.windows(2).all(|w| w[1] > w[0]), "{volume:?}");
        let last = trace["condition"].as_array().and_then(|c| c.last()).expect("conditions");
        assert!(value(last) >= 1.0);
    }
    assert_eq!(
        found["swaps"]["from_lu"]["condition"].as_array().and_then(|c| c.last()),
        Some(&found["spectra"]["condition_handles"])
    );
    assert_eq!(found["random"].as_array().map(Vec::len), Some(11));
    assert!(figures["claims"].as_array().is_some_and(|claims| claims.len() >= 7));
    let advice = &figures["recommendation"];
    assert!(value(&advice["accuracy"]["l2_mean"]) <= value(&advice["editing"]["l2_mean"]));
    assert!(value(&advice["editing"]["l2_mean"]) <= value(&advice["accurate"]) * least * (1.0 + 1e-9));
}

/// Without what differs from run to run.
fn without_times(mut value: Value) -> Value {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(map) => {
                map.retain(|key, _| !key.contains("seconds"));
                map.values_mut().for_each(strip);
            }
            Value::Array(list) => list.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut value);
    value
}

#[test]
fn the_same_inputs_give_the_same_figures_and_views_with_any_number_of_threads() {
    let (dir, _) = Dir::with_capture();
    let run = |threads: &str| {
        dir.cager(COMPARE).env("RAYON_NUM_THREADS", threads).succeeds();
        let geometry = has_report_page().then(|| dir.report_page("report.html")["geometry"].clone());
        (without_times(dir.json("figures.json")), geometry)
    };
    let (one, three) = (run("1"), run("3"));
    assert!(one.0 == three.0, "figures differ");
    assert!(one.1 == three.1, "what is drawn differs");
}

#[test]
fn long_captures_are_measured_at_even_distances() {
    let (dir, small) = Dir::with_capture();
    dir.cager(&format!("{COMPARE} --frames-at-most 4")).succeeds();
    let some = dir.json("figures.json");
    assert_eq!(some["capture"]["measured"], serde_json::json!([0, 6, 13, 19]));
    assert_eq!(some["capture"]["frames"], small.frames.len());
    dir.cager(COMPARE).succeeds();
    let all = dir.json("figures.json");
    let of = |figures: &Value, frame: usize| method(figures, "maxvol", "none", 0)["per_frame"]["l2"][frame].clone();
    assert_eq!((of(&some, 1), of(&some, 3)), (of(&all, 6), of(&all, 19)));
    let spike =
        |figures: &Value, frame: usize| method(figures, "maxvol", "none", 0)["per_frame"]["spike_max"][frame].clone();
    assert_eq!((spike(&some, 1), spike(&some, 2)), (spike(&all, 6), spike(&all, 13)));
}

#[test]
fn a_point_cloud_of_one_frame_is_compared_too() {
    let (dir, small) = Dir::with_capture();
    dir.model("rest.obj", &Model { points: small.rest.points.clone(), ..Model::default() });
    dir.frames("frames.npy", &small.frames[3..4]);
    dir.cager(COMPARE).succeeds();
    let figures = dir.json("figures.json");
    if has_report_page() {
        let geometry = &dir.report_page("report.html")["geometry"];
        assert_eq!((&geometry["mesh"]["triangles"], &geometry["clip"]), (&"".into(), &serde_json::json!([0])));
    }
    assert!(method(&figures, "maxvol", "none", 0)["totals"]["spike_mean"].is_null());
    assert!(figures["capture"]["motion_mean"].is_null() && figures["capture"]["triangles"] == 0);
    // Without time there is another measure, and it is called by its name.
    assert_eq!(figures["recommendation"]["editing"]["smoothness_of"], "edges");
}

#[test]
fn the_report_knows_whether_the_cage_was_turned() {
    let (dir, small) = Dir::with_capture();
    dir.frames("frames.npy", &small.frames[..4]);
    let flipped = |line: &str| {
        dir.cager(line).succeeds();
        dir.json("figures.json")["capture"]["flip_cage"].clone()
    };
    assert_eq!(flipped(&format!("{COMPARE} --coordinates mvc")), false);
    dir.model("cage.obj", &crate::support::as_model(&small.cage.clone().flipped()));
    assert_eq!(flipped(&format!("{COMPARE} --coordinates mvc --flip-cage")), true);
    assert_eq!(dir.json("figures.json")["recommendation"]["editing"]["smoothness_of"], "second-difference");
}

#[test]
fn names_of_files_cannot_break_the_page() {
    if !has_report_page() {
        return;
    }
    let (dir, small) = Dir::with_capture();
    // A folder, and a file in it.
    let name = "<!--<script></script><b>&\"c\".npy";
    std::fs::create_dir(dir.path("<!--<script><")).expect("a folder");
    dir.frames(name, &small.frames[..3]);
    dir.cager("compare --rest rest.obj --cage cage.obj -o report.html --frames").arg(name).succeeds();
    assert_eq!(dir.report_page("report.html")["figures"]["capture"]["source"], name);
}

#[test]
fn a_program_without_the_page_writes_the_figures_and_says_how_to_get_it() {
    if has_report_page() {
        return;
    }
    let (dir, small) = Dir::with_capture();
    dir.frames("frames.npy", &small.frames[..3]);
    let said = dir
        .cager("compare --rest rest.obj --cage cage.obj --frames frames.npy -o walk.html --coordinates mvc")
        .succeeds();
    assert!(said.stderr.contains("walk.json") && said.stderr.contains("make web"), "{}", said.stderr);
    assert_eq!(dir.names(""), ["cage.obj", "frames.npy", "rest.obj", "walk.json"]);
    assert_eq!(dir.json("walk.json")["capture"]["source"], "frames.npy");
}

#[test]
fn bad_inputs_are_refused_in_the_words_of_encode_and_leave_nothing() {
    let (dir, small) = Dir::with_capture();
    let mut open = small.cage.clone();
    open.triangles.pop();
    dir.model("open.obj", &crate::support::as_model(&open));
    let mut spoilt = small.frames.clone();
    spoilt[7][5] = f64::NAN;
    dir.write("spoilt.npy", npy_f64(&spoilt));
    let few = Small { frames: small.frames.iter().map(|f| f[..30].to_vec()).collect(), ..Small::new() };
    dir.frames("few.npy", &few.frames);
    let before = dir.contents();
    for (change, with) in
        [("cage.obj", "open.obj"), ("frames.npy", "spoilt.npy"), ("frames.npy", "few.npy"), ("rest.obj", "none.obj")]
    {
        let said = |command: &str| {
            let line = format!("{command} --rest rest.obj --cage cage.obj --frames frames.npy -o out")
                .replacen(change, with, 1);
            let done = dir.cager(&line).run();
            assert_eq!(done.status, Some(1), "{line}");
            assert_sentence(&line, &done.stderr, &[with]);
            done.stderr
        };
        assert_eq!(said("compare"), said("encode"));
    }
    for line in [
        COMPARE.replace("report.html", "rest.obj"),
        COMPARE.replace("figures.json", "report.html"),
        COMPARE.replace("report.html", "nowhere/report.html"),
    ] {
        let done = dir.cager(&line).run();
        assert_eq!(done.status, Some(1), "{line}");
        assert_sentence(&line, &done.stderr, &[]);
    }
    for wrong in ["--coordinates barycentric", "--coordinates mvc,", "--frames-at-most 0", "--up w"] {
        assert_eq!(dir.cager(&format!("{COMPARE} {wrong}")).run().status, Some(2), "{wrong}");
    }
    assert!(dir.contents() == before, "{:?}", dir.names(""));
}

#[test]
fn systems_are_compared_once_each_in_the_order_asked_for() {
    let (dir, _) = Dir::with_capture();
    dir.cager(&format!("{COMPARE} --coordinates mvc,mvc")).succeeds();
    let figures = dir.json("figures.json");
    let names: Vec<&str> =
        figures["systems"].as_array().expect("systems").iter().filter_map(|s| s["name"].as_str()).collect();
    assert_eq!(names, ["mvc"]);
}
