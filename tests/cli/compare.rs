//! `cager compare`.

use crate::refused::assert_sentence;
use crate::support::{Dir, Small, close, npy_f64};
use cager_core::mesh::{Model, Polygons};
use serde_json::Value;
use std::collections::BTreeSet;

const COMPARE: &str =
    "compare --rest rest.obj --cage cage.obj --frames frames.npy -o report.html --json figures.json --overwrite";

fn compared() -> (Dir, String, Value) {
    let (dir, _) = Dir::with_capture();
    dir.cager(COMPARE).succeeds();
    let html = String::from_utf8(dir.read("report.html")).expect("UTF-8");
    let figures = dir.json("figures.json");
    (dir, html, figures)
}

/// Figures of a method of the first system.
fn method<'a>(figures: &'a Value, handles: &str, regularizer: &str, spectrum: u64) -> &'a Value {
    let methods = figures["systems"][0]["figures"]["methods"].as_array().expect("methods");
    let found = methods
        .iter()
        .find(|m| m["handles"] == handles && m["regularizer"] == regularizer && m["spectrum"] == spectrum);
    found.unwrap_or_else(|| panic!("no {handles}, {regularizer}, {spectrum}"))
}

/// Panics where tags are not closed in order, attributes not quoted, or characters not escaped. Returns the names of the elements.
fn well_formed(html: &str) -> BTreeSet<String> {
    let mut open: Vec<&str> = Vec::new();
    let mut names = BTreeSet::new();
    let mut rest = html.strip_prefix("<!DOCTYPE html>\n").expect("a document type");
    while let Some(start) = rest.find('<') {
        let text = &rest[..start];
        let style = open.last() == Some(&"style");
        assert!(style || !text.contains('>'), "unescaped > in {text:.80}");
        for entity in text.split('&').skip(1) {
            let name = entity.split(';').next().unwrap_or("");
            assert!(["amp", "lt", "gt", "quot", "#39"].contains(&name), "&{name}");
        }
        let end = start + rest[start..].find('>').expect("the end of a tag");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "</{name}>");
            continue;
        }
        let (tag, closed) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
        let (name, attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        assert_eq!(attributes.matches('"').count() % 2, 0, "{tag:.80}");
        for outside in attributes.split('"').step_by(2) {
            let words = outside.trim_start();
            assert!(words.is_empty() || words.ends_with('='), "{outside:?} in {tag:.80}");
        }
        names.insert(name.to_owned());
        if !closed {
            open.push(name);
        }
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "left open: {open:?}");
    names
}

/// Whether no NaN and no infinity was written, but for the letters of pictures.
fn numbers_are_finite(html: &str) -> bool {
    html.split("src=\"").all(|part| {
        let text = part.strip_prefix("data:").and_then(|data| data.split_once('"')).map_or(part, |(_, text)| text);
        let words = text.split(|c: char| !c.is_alphanumeric());
        words.map(|word| word.trim_start_matches(['M', 'L', 'H', 'V'])).all(|word| word != "NaN" && word != "inf")
    })
}

/// One comparison for all that is asked of it: it takes many seconds.
#[test]
fn a_comparison_is_complete_and_agrees_with_itself_and_with_encodings() {
    let (dir, html, figures) = compared();
    the_report_is_one_well_formed_file_that_refers_to_no_other(&dir, &html);
    every_comparison_of_the_paper_has_its_section(&html);
    figures_are_those_of_encodings_with_the_same_options(&dir, &figures);
    figures_fit_each_other(&figures);
}

fn the_report_is_one_well_formed_file_that_refers_to_no_other(dir: &Dir, html: &str) {
    assert_eq!(dir.names(""), ["cage.obj", "figures.json", "frames.npy", "report.html", "rest.obj"]);
    let names = well_formed(html);
    for forbidden in ["script", "link", "iframe", "object", "base", "form"] {
        assert!(!names.contains(forbidden), "{forbidden}");
    }
    for address in ["src=\"", "href=\""].iter().flat_map(|attribute| html.split(attribute).skip(1)) {
        assert!(address.starts_with("data:image/png;base64,") || address.starts_with('#'), "{address:.60}");
    }
    for reference in ["http:", "https:", "url(", "@import", "file:", "javascript:"] {
        assert!(!html.contains(reference), "{reference}");
    }
    assert!(numbers_are_finite(html), "NaN or infinity in the page");
    // Links within the page lead somewhere.
    for link in html.split("href=\"#").skip(1).filter_map(|rest| rest.split('"').next()) {
        assert!(html.contains(&format!("id=\"{link}\"")), "{link}");
    }
}

fn every_comparison_of_the_paper_has_its_section(html: &str) {
    for id in ["claims", "errors", "cages", "spectra", "swaps", "random", "noise", "vectors", "times"] {
        let section = html.split(&format!("<h2 id=\"{id}\">")).nth(1).unwrap_or_else(|| panic!("no section {id}"));
        let section = section.split("<h2 ").next().unwrap_or("");
        assert!(section.contains("<table>") && section.contains("aper"), "{id}");
        if id != "claims" && id != "times" {
            assert!(section.contains("<svg") && section.contains("<figcaption>"), "{id}");
        }
    }
    for figure in
        ["Fig. 3.", "Fig. 4.", "Figs. 6 and 9.", "Figs. 11 and 15.", "Figs. 14 and 18.", "Fig. 16.", "Table 1"]
    {
        assert!(html.contains(figure), "{figure}");
    }
    assert!(html.matches("<img ").count() >= 20, "{} pictures", html.matches("<img ").count());
    assert!(html.contains("cager encode --rest rest.obj"));
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
        assert_eq!(spectra["condition_handles"], condition["handles"]);
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
fn the_same_inputs_give_the_same_figures_and_pictures_with_any_number_of_threads() {
    let (dir, _) = Dir::with_capture();
    let run = |threads: &str| {
        dir.cager(COMPARE).env("RAYON_NUM_THREADS", threads).succeeds();
        let html = String::from_utf8(dir.read("report.html")).expect("UTF-8");
        let pictures: Vec<String> =
            html.split("src=\"").skip(1).filter_map(|rest| rest.split('"').next()).map(str::to_owned).collect();
        (without_times(dir.json("figures.json")), pictures)
    };
    let (one, three) = (run("1"), run("3"));
    assert!(one.0 == three.0, "figures differ");
    assert!(!one.1.is_empty() && one.1 == three.1, "pictures differ");
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
    dir.model("rest.obj", &Model { points: small.rest.points.clone(), faces: Polygons::new() });
    dir.frames("frames.npy", &small.frames[3..4]);
    dir.cager(COMPARE).succeeds();
    let html = String::from_utf8(dir.read("report.html")).expect("UTF-8");
    well_formed(&html);
    assert!(numbers_are_finite(&html));
    let figures = dir.json("figures.json");
    assert!(method(&figures, "maxvol", "none", 0)["totals"]["spike_mean"].is_null());
    assert!(figures["capture"]["motion_mean"].is_null() && figures["capture"]["triangles"] == 0);
    // Without time there is another measure, and it is called by its name.
    assert_eq!(figures["recommendation"]["editing"]["smoothness_of"], "edges");
    assert!(html.contains("edge's length changes by") || html.contains("edge&#39;s length changes by"), "the measure");
    assert!(!html.contains("second difference in time is"));
}

#[test]
fn the_advised_command_turns_the_cage_as_the_comparison_did() {
    let (dir, small) = Dir::with_capture();
    dir.frames("frames.npy", &small.frames[..4]);
    dir.cager(&format!("{COMPARE} --coordinates mvc")).succeeds();
    assert!(!String::from_utf8(dir.read("report.html")).expect("UTF-8").contains("--flip-cage"));
    dir.model("cage.obj", &crate::support::as_model(&small.cage.clone().flipped()));
    dir.cager(&format!("{COMPARE} --coordinates mvc --flip-cage")).succeeds();
    let html = String::from_utf8(dir.read("report.html")).expect("UTF-8");
    assert_eq!(html.matches("--cage cage.obj --flip-cage").count(), 2);
    assert_eq!(dir.json("figures.json")["recommendation"]["editing"]["smoothness_of"], "second-difference");
}

#[test]
fn names_of_files_cannot_break_the_page() {
    let (dir, small) = Dir::with_capture();
    dir.frames("a<b>&\"c\".npy", &small.frames[..3]);
    dir.cager("compare --rest rest.obj --cage cage.obj -o report.html --frames").arg("a<b>&\"c\".npy").succeeds();
    let html = String::from_utf8(dir.read("report.html")).expect("UTF-8");
    well_formed(&html);
    assert!(html.contains("a&lt;b&gt;&amp;&quot;c&quot;.npy"));
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
