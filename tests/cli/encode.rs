//! `cager encode`.

use crate::support::{
    Dir, ENCODE, as_model, close, largest, mean, measure, npy_f64, polygons, quad_box, read_cages, read_frames,
};
use cager_geometry::mesh::{Model, winding_number};
use serde_json::Value;
use std::collections::BTreeMap;

fn encode(dir: &Dir, options: &str) -> Value {
    dir.cager(&format!("{ENCODE} --report report.json {options}")).succeeds();
    dir.json("report.json")
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} is no number"))
}

#[test]
fn every_source_of_the_same_frames_gives_the_same_file() {
    let (dir, small) = Dir::with_capture();
    for frame in 0..small.frames.len() {
        dir.model(&format!("poses/{frame}.obj"), &small.posed(frame));
        dir.model(&format!("mixed/pose{frame}.ply"), &small.posed(frame));
    }
    dir.write("mixed/notes.txt", "not a frame");
    dir.model("mixed/other1.obj", &small.rest);
    dir.write("wide.npy", npy_f64(&small.frames));
    dir.frames("frames.pc2", &small.frames);
    dir.frames("frames.mdd", &small.frames);
    let mut files = Vec::new();
    for source in ["frames.npy", "wide.npy", "frames.pc2", "poses", "poses/*.obj", "mixed/pose*.ply"] {
        dir.cager("encode --rest rest.obj --cage cage.obj -o out.cager --overwrite --frames").arg(source).succeeds();
        assert_eq!(read_cages(&dir.path("out.cager")).len(), 20, "{source}");
        files.push((source, dir.read("out.cager")));
    }
    for (source, file) in &files {
        assert!(*file == files[0].1, "{source} and {} give different files", files[0].0);
    }
    // This one knows its frame rate too.
    let cages = read_cages(&dir.path("out.cager"));
    dir.cager("encode --rest rest.obj --cage cage.obj -o out.cager --overwrite --frames frames.mdd").succeeds();
    assert_eq!(read_cages(&dir.path("out.cager")), cages);
}

#[test]
fn doubles_are_not_narrowed_before_the_inversion() {
    let (dir, small) = Dir::with_capture();
    // Far from the origin a single keeps only some digits of the motion.
    let far = |x: &f64| x + 1000.0;
    let moved = |points: &[[f64; 3]]| points.iter().map(|p| p.map(|x| far(&x))).collect::<Vec<_>>();
    let frames: Vec<Vec<f64>> = small.frames.iter().map(|f| f.iter().map(far).collect()).collect();
    dir.model("rest.obj", &Model { points: moved(&small.rest.points), ..Model::default() });
    let mut cage = small.cage;
    cage.vertices = moved(&cage.vertices);
    dir.model("cage.obj", &as_model(&cage));
    dir.write("frames.npy", npy_f64(&frames));
    let wide = encode(&dir, "--handles all");
    assert!(number(&wide, "/affine_reproduction_error") < 1e-10);
    let near = { encode(&Dir::with_capture().0, "--handles all") };
    close("l2_mean far away", number(&wide, "/error/l2_mean"), number(&near, "/error/l2_mean"), 0.01);
}

#[test]
fn report_has_exactly_the_keys_and_types_of_the_contract() {
    let (dir, _) = Dir::with_encoded();
    let mut found = BTreeMap::new();
    shape("", &dir.json("report.json"), &mut found);
    let integers = ["points", "triangles", "frames", "unknowns", "cage_vertices", "cage_faces", "spectrum", "rank"];
    let texts = ["generator", "coordinates", "handles", "regularizer"];
    let numbers = [
        "diagonal",
        "lambda",
        "affine_reproduction_error",
        "condition_number.full",
        "condition_number.handles",
        "singular_values[]",
        "maxvol.log_volume",
        "maxvol.max_entry",
        "error.l2_mean",
        "error.l2_max",
        "error.linf_mean",
        "error.linf_max",
        "error.kg_percent",
        "error.worst.distance",
        "error.per_frame[].l2",
        "error.per_frame[].linf",
        "bytes.ratio",
        "bytes.bits_per_vertex_per_frame",
        "seconds.read",
        "seconds.coordinates",
        "seconds.maxvol",
        "seconds.svd",
        "seconds.invert",
        "seconds.measure",
        "seconds.write",
        "seconds.total",
    ];
    let mut expected = BTreeMap::new();
    expected.extend(integers.map(|key| (key.to_owned(), "integer")));
    expected.extend(texts.map(|key| (key.to_owned(), "text")));
    expected.extend(numbers.map(|key| (key.to_owned(), "number")));
    expected.extend(
        ["maxvol.swaps", "handle_indices[]", "error.worst.frame", "error.worst.point", "bytes.capture", "bytes.output"]
            .map(|key| (key.to_owned(), "integer")),
    );
    expected.insert("warnings[]".to_owned(), "empty");
    assert_eq!(found, expected);
}

/// The type at every path of a document; the items of a list are one path.
fn shape(path: &str, value: &Value, out: &mut BTreeMap<String, &'static str>) {
    let leaf = match value {
        Value::Object(map) => {
            let dot = if path.is_empty() { "" } else { "." };
            map.iter().for_each(|(key, value)| shape(&format!("{path}{dot}{key}"), value, out));
            return;
        }
        Value::Array(items) if !items.is_empty() => {
            items.iter().for_each(|item| shape(&format!("{path}[]"), item, out));
            return;
        }
        Value::Array(_) => {
            out.insert(format!("{path}[]"), "empty");
            return;
        }
        Value::Number(n) if n.is_u64() => "integer",
        Value::Number(_) => "number",
        Value::String(_) => "text",
        Value::Null => "null",
        Value::Bool(_) => "boolean",
    };
    let before = out.insert(path.to_owned(), leaf);
    assert!(before.is_none_or(|before| before == leaf), "{path} is {before:?} and {leaf}");
}

#[test]
fn report_counts_what_was_given_and_written() {
    let (dir, small) = Dir::with_encoded();
    let report = dir.json("report.json");
    let count = |key: &str| report[key].as_u64().expect(key) as usize;
    assert_eq!(count("points"), small.rest.points.len());
    assert_eq!(count("triangles"), small.rest.faces.triangulated().len());
    assert_eq!(count("frames"), 20);
    assert_eq!(count("unknowns"), small.cage.vertices.len());
    assert_eq!(count("cage_vertices"), small.cage.vertices.len());
    assert_eq!(count("cage_faces"), small.cage.triangles.len());
    assert_eq!(count("rank"), small.cage.vertices.len());
    assert_eq!(count("spectrum"), small.cage.vertices.len() / 16);
    for (key, value) in [("coordinates", "mvc"), ("handles", "spread"), ("regularizer", "differential")] {
        assert_eq!(report[key], value);
    }
    assert_eq!(report["lambda"], 1.0);
    let written = dir.read("out.cager").len();
    let capture = 12 * small.rest.points.len() * 20 + 4 * small.rest.faces.indices().len();
    assert_eq!(report["bytes"]["output"], written);
    assert_eq!(report["bytes"]["capture"], capture);
    close("ratio", number(&report, "/bytes/ratio"), capture as f64 / written as f64, 1e-12);
    let bits = 8.0 * written as f64 / (20 * small.rest.points.len()) as f64;
    close("bits", number(&report, "/bytes/bits_per_vertex_per_frame"), bits, 1e-12);
    let mut handles: Vec<u64> =
        report["handle_indices"].as_array().expect("handles").iter().filter_map(Value::as_u64).collect();
    handles.sort_unstable();
    handles.dedup();
    assert_eq!(handles.len(), 2 * small.cage.vertices.len());
    assert!(handles.iter().all(|&h| (h as usize) < small.rest.points.len()));
    assert!(number(&report, "/affine_reproduction_error") <= 1e-10);
    assert!(number(&report, "/maxvol/max_entry") <= 1.1);
    let sigma: Vec<f64> =
        report["singular_values"].as_array().expect("sigma").iter().filter_map(Value::as_f64).collect();
    assert!(sigma.len() == small.cage.vertices.len() && sigma.is_sorted_by(|a, b| a >= b));
    close("condition", number(&report, "/condition_number/full"), sigma[0] / sigma[sigma.len() - 1], 1e-9);
}

#[test]
fn report_errors_are_those_of_the_decoded_output() {
    for options in [
        "",
        "--handles all --spectrum 0",
        "--regularizer global --lambda 0.01",
        "--handles spread --regularizer differential",
        "--regularizer temporal",
    ] {
        let (dir, small) = Dir::with_capture();
        let report = encode(&dir, options);
        dir.cager("decode out.cager -o decoded.npy --overwrite").succeeds();
        let decoded = read_frames(&dir.path("decoded.npy"), small.rest.points.len());
        let found = measure(&small.rest.points, &small.frames, &decoded);
        for (t, (l2, linf)) in found.l2.iter().zip(&found.linf).enumerate() {
            close("l2", number(&report, &format!("/error/per_frame/{t}/l2")), *l2, 1e-6);
            close("linf", number(&report, &format!("/error/per_frame/{t}/linf")), *linf, 1e-6);
        }
        close("l2_mean", number(&report, "/error/l2_mean"), mean(&found.l2), 1e-6);
        close("l2_max", number(&report, "/error/l2_max"), largest(&found.l2), 1e-6);
        close("linf_mean", number(&report, "/error/linf_mean"), mean(&found.linf), 1e-6);
        close("linf_max", number(&report, "/error/linf_max"), largest(&found.linf), 1e-6);
        close("kg_percent", number(&report, "/error/kg_percent"), found.kg_percent, 1e-6);
    }
}

#[test]
fn output_is_identical_each_time_and_for_any_number_of_threads() {
    let (dir, _) = Dir::with_capture();
    for options in
        ["", "--handles all", "--handles spread", "--handles rectangular", "--regularizer temporal", "--spectrum auto"]
    {
        dir.cager(&format!("{ENCODE} {options}")).succeeds();
        let first = dir.read("out.cager");
        dir.cager(&format!("{ENCODE} {options}")).succeeds();
        assert!(dir.read("out.cager") == first, "a second run gives another file");
        for threads in ["1", "2", "5"] {
            dir.cager(&format!("{ENCODE} {options}")).env("RAYON_NUM_THREADS", threads).succeeds();
            assert!(dir.read("out.cager") == first, "{threads} threads give another file");
        }
    }
}

#[test]
fn no_progress_bar_appears_in_a_pipe() {
    let (dir, _) = Dir::with_capture();
    for line in [ENCODE, "decode out.cager -o back.npy", "demo --points 300 --frames 3 --cage-vertices 40"] {
        let done = dir.cager(line).succeeds();
        assert_eq!(done.stderr, "", "{line}");
        assert!(!done.stdout.contains(['\r', '\x1b']), "{line}: {:?}", done.stdout);
    }
}

#[test]
fn a_stray_point_is_named_where_the_error_cannot_be_held() {
    let (dir, small) = Dir::with_capture();
    let mut frames = small.frames.clone();
    frames[3][3 * 7 + 1] = -1e7;
    dir.frames("frames.npy", &frames);
    let said = dir.cager(&format!("{ENCODE} --max-error 1e-3 --force")).run().stderr;
    let words = "as point 7 of frame 3 is ";
    assert!(said.contains(words) && said.contains("diagonals of the rest pose away from the origin"), "{said}");
}

#[test]
fn no_more_vertices_are_designed_than_the_points_determine() {
    let (dir, small) = Dir::with_capture();
    let more = small.rest.points.len() + 1;
    let line = "encode --rest rest.obj --frames frames.npy -o out.cager --time-limit 0.2 --report report.json";
    dir.cager(&format!("{line} --cage-vertices {more}")).succeeds();
    let vertices = dir.json("report.json")["cage_vertices"].as_u64().expect("a number");
    assert!(vertices as usize <= small.rest.points.len(), "{vertices}");
    assert!(dir.cager(&line.replace("0.2", "0")).run().stderr.contains("give seconds above 0, such as 30"));
}

#[test]
fn only_the_outputs_are_left_in_the_folder() {
    let (dir, _) = Dir::with_encoded();
    assert_eq!(dir.names(""), ["cage.obj", "frames.npy", "out.cager", "report.json", "rest.obj"]);
}

#[test]
fn points_outside_the_cage_are_counted_in_a_warning_on_stderr() {
    let (dir, small) = Dir::with_capture();
    let cage = small.shrunk_cage();
    dir.model("cage.obj", &as_model(&cage));
    let outside =
        small.rest.points.iter().filter(|&&p| winding_number(&cage.vertices, &cage.triangles, p) < 0.5).count();
    assert!(outside > 10);
    let done = dir.cager(&format!("{ENCODE} --report report.json")).succeeds();
    let said = format!("{outside} of {} points lie outside the cage", small.rest.points.len());
    assert!(done.stderr.starts_with(&format!("warning: {said}")), "{}", done.stderr);
    assert_eq!(done.stderr.lines().count(), 1);
    assert!(!done.stdout.contains("outside"), "{}", done.stdout);
    let warnings = dir.json("report.json")["warnings"].clone();
    assert!(warnings[0].as_str().is_some_and(|w| w.starts_with(&said)), "{warnings}");
}

#[test]
fn unknowns_that_the_points_leave_open_are_a_warning() {
    let (dir, small) = Dir::with_capture();
    // Only 40 places: the other points stand on top of these.
    let n = small.rest.points.len();
    let points: Vec<_> = (0..n).map(|i| small.rest.points[i % 40 * (n / 40)]).collect();
    dir.model("rest.obj", &Model { points: points.clone(), ..Model::default() });
    dir.write("frames.npy", npy_f64(&[points.as_flattened().to_vec()]));
    for handles in ["maxvol", "rectangular", "spread", "all"] {
        let done = dir.cager(&format!("{ENCODE} --report report.json --spectrum 0 --handles {handles}")).succeeds();
        let report = dir.json("report.json");
        assert_eq!(report["rank"], 40);
        let said =
            format!("warning: the points determine only 40 of the cage's {} unknowns", small.cage.vertices.len());
        assert!(done.stderr.starts_with(&said) && done.stderr.lines().count() == 1, "{}", done.stderr);
        assert!(number(&report, "/error/linf_max") < 1e-5, "{handles}: {}", report["error"]);
    }
}

#[test]
fn point_cloud_is_a_rest_pose() {
    let (dir, small) = Dir::with_capture();
    let cloud = Model { points: small.rest.points.clone(), ..Model::default() };
    dir.model("cloud.ply", &cloud);
    let line = "encode --rest cloud.ply --cage cage.obj --frames frames.npy -o cloud.cager --report report.json";
    dir.cager(line).succeeds();
    assert_eq!(dir.json("report.json")["triangles"], 0);
    dir.cager(ENCODE).succeeds();
    assert_eq!(read_cages(&dir.path("cloud.cager")), read_cages(&dir.path("out.cager")));
    dir.cager("decode cloud.cager -o poses").succeeds();
    let first = cager_formats::read_model(&dir.path("poses/frame_0000.obj")).expect("a pose");
    assert!(first.faces.is_empty() && first.points.len() == small.rest.points.len());
}

#[test]
fn every_mesh_format_serves_as_rest_pose_and_cage() {
    let (dir, small) = Dir::with_capture();
    dir.cager(ENCODE).succeeds();
    for format in ["ply", "off"] {
        dir.model(&format!("rest.{format}"), &small.rest);
        dir.model(&format!("cage.{format}"), &as_model(&small.cage));
        let line = format!("encode --rest rest.{format} --cage cage.{format} --frames frames.npy -o {format}.cager");
        dir.cager(&line).succeeds();
        assert!(dir.read(&format!("{format}.cager")) == dir.read("out.cager"), "{format}");
    }
}

#[test]
fn quads_of_the_cage_become_triangles_and_a_cage_too_small_to_regularise_will_do() {
    let (dir, small) = Dir::with_capture();
    dir.model("cage.obj", &quad_box(&small.rest.points));
    let report = encode(&dir, "");
    assert_eq!(report["cage_vertices"], 8);
    assert_eq!(report["cage_faces"], 12);
    assert_eq!(report["spectrum"], 0);
    assert!(number(&report, "/affine_reproduction_error") <= 1e-10);
    assert_eq!(read_cages(&dir.path("out.cager"))[0].len(), 24);
}

#[test]
fn reading_all_points_is_never_worse_than_reading_the_handles() {
    let (dir, _) = Dir::with_capture();
    for options in ["--spectrum 0", "--regularizer none"] {
        let few = encode(&dir, options);
        let all = encode(&dir, &format!("{options} --handles all"));
        assert_eq!(all["handles"], "all");
        for (t, (a, b)) in (0..).zip(frame_errors(&all).into_iter().zip(frame_errors(&few))) {
            assert!(a <= b * (1.0 + 1e-9), "frame {t}: {a} with all points, {b} with handles");
        }
        assert!(number(&all, "/error/l2_mean") < number(&few, "/error/l2_mean"));
    }
}

fn frame_errors(report: &Value) -> Vec<f64> {
    let frames = report["error"]["per_frame"].as_array().expect("frames");
    frames.iter().filter_map(|f| f["l2"].as_f64()).collect()
}

#[test]
fn every_regularizer_runs_and_is_named_in_the_report() {
    let (dir, _) = Dir::with_capture();
    let plain = encode(&dir, "--regularizer none --handles all");
    for name in ["laplacian", "differential", "temporal", "none", "truncated-svd", "tikhonov", "global"] {
        for handles in ["maxvol", "rectangular", "spread", "all"] {
            let report = encode(&dir, &format!("--regularizer {name} --handles {handles} --spectrum 5 --lambda 0.01"));
            assert_eq!(report["regularizer"], name);
            assert_eq!(report["lambda"], 0.01);
            assert_eq!(report["spectrum"], 5);
            let (l2, best) = (number(&report, "/error/l2_mean"), number(&plain, "/error/l2_mean"));
            assert!(l2 >= best * (1.0 - 1e-6) && l2 < 0.05, "{name}, {handles}: {l2} where least squares has {best}");
        }
    }
}

#[test]
fn handles_are_counted_as_asked_and_begin_with_those_of_maximum_volume() {
    let (dir, small) = Dir::with_capture();
    let m = small.cage.vertices.len();
    let core = encode(&dir, "--handles maxvol")["handle_indices"].clone();
    let core = core.as_array().expect("handles");
    for (options, count) in [
        ("--handles spread", 2 * m),
        ("--handles rectangular", 2 * m),
        (&format!("--handles spread --handle-count {m}"), m),
        (&format!("--handles spread --handle-count {}", m + 7), m + 7),
        (&format!("--handles rectangular --handle-count {}", small.rest.points.len()), small.rest.points.len()),
    ] {
        let report = encode(&dir, options);
        let handles = report["handle_indices"].as_array().expect("handles");
        assert_eq!(handles.len(), count, "{options}");
        assert_eq!(&handles[..m], core, "{options}");
        assert_eq!(report["handles"], options.split(' ').nth(1).expect("a name"));
        let inspected = dir.cager("inspect out.cager").succeeds().stdout;
        assert!(inspected.contains(&format!("({count})")), "{inspected}");
    }
}

/// The Laplacian of a cage as a file.
fn laplacian_file(cage: &cager_geometry::mesh::TriMesh) -> String {
    use cager_core::regularize::Regularizer;
    let cage = cager_core::cage::Cage::new(cage.clone()).expect("a cage");
    let m = cage.vertices().len();
    let delta = Regularizer::Laplacian.delta(None, &cage, m).expect("a term");
    let mut lines = Vec::new();
    for (i, j) in (0..m).flat_map(|i| (0..m).map(move |j| (i, j))).filter(|&(i, j)| delta[(i, j)] != 0.0) {
        lines.push(format!("{} {} {:?}", i + 1, j + 1, delta[(i, j)]));
    }
    let head = format!("%%MatrixMarket matrix coordinate real general\n{m} {m} {}\n", lines.len());
    head + &lines.join("\n") + "\n"
}

#[test]
fn the_laplacian_in_a_file_does_what_the_laplacian_does() {
    let (dir, small) = Dir::with_capture();
    let wanted = encode(&dir, "--regularizer laplacian");
    dir.write("delta.mtx", laplacian_file(&small.cage));
    let report = encode(&dir, "--regularizer matrix --regularizer-matrix delta.mtx");
    assert_eq!(report["regularizer"], "matrix");
    close("l2", number(&report, "/error/l2_mean"), number(&wanted, "/error/l2_mean"), 1e-6);
    dir.cager("decode out.cager -o back.npy").succeeds();
}

#[test]
fn a_threshold_is_chosen_by_the_error_it_costs() {
    let (dir, small) = Dir::with_capture();
    let m = small.cage.vertices.len();
    let l2 = |spectrum: u64| number(&encode(&dir, &format!("--spectrum {spectrum} --lambda 0.001")), "/error/l2_mean");
    let zero = l2(0);
    for bound in [0.01, 0.05] {
        let line = format!("{ENCODE} --report report.json --spectrum auto --lambda 0.001 --spectrum-bound {bound}");
        let said = dir.cager(&line).succeeds().stdout;
        let report = dir.json("report.json");
        let spectrum = report["spectrum"].as_u64().expect("a threshold");
        let choice = &report["spectrum_choice"];
        assert!(number(choice, "/extra") <= bound, "{choice}");
        assert_eq!(number(choice, "/bound"), bound);
        // All 20 frames are measured, so that what was promised is what comes out.
        assert_eq!(choice["frames"], 20);
        close("extra", l2(spectrum) / zero - 1.0 + 1.0, 1.0 + number(choice, "/extra"), 1e-4);
        assert!(spectrum == m as u64 || l2(spectrum + 1) > zero * (1.0 + bound), "{choice}");
        assert!(said.contains(&format!("spectrum {spectrum}: L2 ")), "{said}");
    }
    let report = encode(&dir, "--spectrum all --regularizer laplacian");
    assert_eq!(report["spectrum"], m);
    assert!(report.get("spectrum_choice").is_none());
    close(
        "global",
        number(&report, "/error/l2_mean"),
        number(&encode(&dir, "--regularizer global"), "/error/l2_mean"),
        1e-9,
    );
    // Folders of meshes are read again as well, and frames that follow each other in pairs.
    for frame in 0..20 {
        dir.model(&format!("poses/{frame}.obj"), &small.posed(frame));
    }
    let line = "encode --rest rest.obj --cage cage.obj --frames poses -o out.cager --overwrite --spectrum auto --report report.json";
    dir.cager(&format!("{line} --regularizer temporal")).succeeds();
    assert_eq!(dir.json("report.json")["spectrum_choice"]["frames"], 20);
}

#[test]
fn one_mesh_file_is_a_capture_of_one_frame() {
    let (dir, _) = Dir::with_capture();
    let line = "encode --rest rest.obj --cage cage.obj --frames rest.obj --spectrum 0 -o out.cager --overwrite --report report.json";
    dir.cager(line).succeeds();
    let report = dir.json("report.json");
    assert_eq!(report["frames"], 1);
    assert!(number(&report, "/error/linf_max") < 1e-6);
}

#[test]
fn an_old_output_is_replaced_by_success_and_kept_byte_for_byte_by_failure() {
    let (dir, mut small) = Dir::with_capture();
    dir.write("out.cager", "the old capture");
    dir.write("report.json", "the old report");
    dir.write("good.npy", dir.read("frames.npy"));
    small.frames[17][100] = f64::NAN;
    dir.write("frames.npy", npy_f64(&small.frames));
    let before = dir.contents();
    let failed = dir.cager(&format!("{ENCODE} --report report.json")).run();
    assert_eq!(failed.status, Some(1), "{}", failed.stderr);
    assert!(dir.contents() == before, "a failed encoding changed {:?}", dir.names(""));
    let line = "encode --rest rest.obj --cage cage.obj --frames good.npy -o out.cager --overwrite --report report.json";
    dir.cager(line).succeeds();
    assert_ne!(dir.read("out.cager"), b"the old capture");
    assert_eq!(dir.json("report.json")["frames"], 20);
}

#[test]
fn names_with_spaces_and_accents_work() {
    let (dir, small) = Dir::with_capture();
    dir.model("Élan vital/rest pose.obj", &small.rest);
    dir.cager("encode --cage cage.obj --frames frames.npy")
        .arg("--rest")
        .arg("Élan vital/rest pose.obj")
        .arg("-o")
        .arg("Élan vital/été 1.cager")
        .succeeds();
    assert_eq!(dir.names("Élan vital"), ["rest pose.obj", "été 1.cager"]);
}

#[test]
fn half_a_model_in_the_cage_of_the_whole_is_encoded_well_with_the_default_options() {
    let (dir, small) = Dir::with_capture();
    let (low, high) = cager_geometry::mesh::bounds(&small.rest.points);
    let upper: Vec<usize> =
        (0..small.rest.points.len()).filter(|&i| small.rest.points[i][2] > 0.5 * (low[2] + high[2])).collect();
    let rest = Model {
        points: upper.iter().map(|&i| small.rest.points[i]).collect(),
        faces: polygons([]),
        ..Model::default()
    };
    let frames: Vec<Vec<f64>> =
        small.frames.iter().map(|f| upper.iter().flat_map(|&i| f[3 * i..3 * i + 3].to_vec()).collect()).collect();
    dir.model("rest.ply", &rest);
    dir.frames("frames.npy", &frames);
    let line =
        "encode --rest rest.ply --cage cage.obj --frames frames.npy -o out.cager --overwrite --report report.json";
    for options in ["", " --handles all", " --spectrum 0"] {
        dir.cager(&format!("{line}{options}")).succeeds();
        let report = dir.json("report.json");
        let error = number(&report, "/error/l2_mean");
        assert!(error < 0.05, "{options}: {error}");
    }
}

#[test]
fn a_capture_far_from_the_origin_is_encoded_with_a_warning_that_names_a_frame() {
    let (dir, small) = Dir::with_capture();
    let far: Vec<Vec<f64>> = small.frames.iter().map(|f| f.iter().map(|x| x + 1e5).collect()).collect();
    dir.write("frames.npy", npy_f64(&far));
    let done = dir.cager(ENCODE).run();
    assert_eq!(done.status, Some(0), "{}", done.stderr);
    assert!(
        done.stderr.contains("the cage of frame ") && done.stderr.contains("closer to the origin"),
        "{}",
        done.stderr
    );
}
