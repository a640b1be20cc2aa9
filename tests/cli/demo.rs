//! `cager demo`.

use crate::support::{Dir, has_report_page};
use cager_formats::read_model;

#[test]
fn demo_in_an_empty_folder_writes_what_it_says() {
    let dir = Dir::new();
    let done = dir.cager("demo --points 600 --frames 20 --cage-vertices 60").succeeds();
    assert_eq!(dir.names(""), ["cager-demo"]);
    let mut files = vec!["cage.obj", "capture.cager", "decoded.npy", "report.html", "report.json", "rest.obj"];
    let help = dir.cager("demo --help").succeeds().stdout;
    for file in &files {
        assert!(help.contains(file), "{file} is not announced in {help}");
    }
    files.retain(|file| *file != "report.html" || has_report_page());
    assert_eq!(dir.names("cager-demo"), files);
    let report = dir.json("cager-demo/report.json");
    if has_report_page() {
        let page = dir.report_page("cager-demo/report.html");
        assert_eq!((page["kind"].as_str(), page["figures"]["l2"].as_array().map(Vec::len)), (Some("demo"), Some(20)));
        assert_eq!(page["geometry"]["frames"].as_array().map(Vec::len), Some(20));
        for row in page["figures"]["rows"].as_array().expect("rows") {
            assert!(done.stdout.contains(row["value"].as_str().expect("a value")), "{row}");
        }
    }
    for word in ["L2", "L∞", "ratio", "20", "report.html", "real service", "prepare", "upload", "complete", "download"]
    {
        assert!(done.stdout.contains(word), "{word} is missing in {}", done.stdout);
    }
    assert_eq!(report["frames"], 20);
    assert_eq!(report["points"], read_model(&dir.path("cager-demo/rest.obj")).expect("a model").points.len());
    dir.cager("inspect cager-demo/capture.cager").succeeds();
}

#[test]
fn demo_without_options_has_the_advertised_size() {
    let dir = Dir::new();
    dir.cager("demo").succeeds();
    let report = dir.json("cager-demo/report.json");
    let near = |key: &str, wanted: u64, percent: u64| {
        let found = report[key].as_u64().expect(key);
        assert!(found.abs_diff(wanted) * 100 <= percent * wanted, "{key} is {found}");
    };
    near("points", 20_000, 3);
    near("frames", 120, 0);
    near("cage_vertices", 330, 10);
    assert!(report["affine_reproduction_error"].as_f64().is_some_and(|e| e <= 1e-10));
    assert_eq!(report["warnings"].as_array().map(Vec::len), Some(0));
}

#[test]
fn demo_goes_where_it_is_told_and_can_run_there_again() {
    let dir = Dir::new();
    let line = "demo --points 300 --frames 3 --cage-vertices 40 -o some/where";
    dir.cager(line).succeeds();
    let first = dir.read("some/where/capture.cager");
    dir.cager(line).succeeds();
    assert!(dir.read("some/where/capture.cager") == first);
    assert_eq!(dir.names(""), ["some"]);
}

#[test]
fn demo_needs_neither_a_proxy_nor_the_usual_port() {
    let dir = Dir::new();
    // Holds the port where `cager serve` listens, unless somebody else does.
    let _taken = std::net::TcpListener::bind("127.0.0.1:8080");
    let mut demo = dir.cager("demo --points 300 --frames 3 --cage-vertices 40");
    for name in ["http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"] {
        demo = demo.env(name, "http://127.0.0.1:1");
    }
    // Settings of a service that is meant to run here are not the demo's.
    demo.env("CAGER_LISTEN", "127.0.0.1:8080").env("CAGER_DATA", "/nowhere").succeeds();
    assert_eq!(dir.names(""), ["cager-demo"]);
}

#[test]
fn demo_runs_at_the_smallest_sizes_it_accepts() {
    Dir::new().cager("demo --points 100 --frames 1 --cage-vertices 26").succeeds();
}

#[test]
fn demo_that_cannot_make_its_folder_says_so() {
    let dir = Dir::new();
    dir.write("taken", "a file");
    let before = dir.contents();
    let done = dir.cager("demo -o taken").run();
    assert_eq!(done.status, Some(1));
    assert!(done.stderr.starts_with("cager: taken: ") && done.stderr.lines().count() == 1, "{}", done.stderr);
    assert!(dir.contents() == before);
}
