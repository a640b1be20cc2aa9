//! `cager cage`, and `cager encode` without a cage.

use crate::refused::assert_sentence;
use crate::support::{Dir, Small, as_model, has_report_page, mean, measure, quad_box, read_frames};
use cager_core::cage::Cage;
use cager_formats::read_model;
use cager_geometry::mesh::{Model, TriMesh};
use cager_geometry::spatial::{outside, self_intersections};
use cager_geometry::vector::{self, along, sub};

fn read_cage(dir: &Dir, name: &str) -> Model {
    read_model(&dir.path(name)).expect(name)
}

/// What is wrong with a cage that ought to be valid.
fn faults(cage: &Model, rest: &Model) -> Vec<String> {
    let mesh = TriMesh::from(cage);
    let mut found = Vec::new();
    found.extend(Cage::new(mesh.clone()).err().map(|error| error.to_string()));
    found.extend(outside(&mesh, &rest.points).iter().map(|(i, _)| format!("point {i} is outside")));
    found.extend(self_intersections(&mesh).iter().map(|pair| format!("faces {pair:?} cut")));
    found
}

#[test]
fn a_rest_pose_alone_gets_a_valid_cage_with_its_picture_and_report() {
    let (dir, small) = Dir::with_capture();
    let picture = if has_report_page() { "--picture made.html" } else { "" };
    let line = format!("cage --rest rest.obj --vertices 50 -o made.obj --report made.json {picture}");
    let said = dir.cager(line.trim()).succeeds().stdout;
    assert!(said.contains("made.obj: ") && said.contains("encloses every point and does not cut itself"), "{said}");
    let cage = read_cage(&dir, "made.obj");
    assert!((20..=50).contains(&cage.points.len()), "{}", cage.points.len());
    assert_eq!(faults(&cage, &small.rest), Vec::<String>::new());
    let report = dir.json("made.json");
    if has_report_page() {
        let page = dir.report_page("made.html");
        assert_eq!((&page["kind"], &page["figures"]["faces"]), (&"cage".into(), &report["faces"]));
        assert_eq!(page["geometry"]["name"], "made.obj");
    }
    assert_eq!(report["vertices"], cage.points.len());
    assert_eq!(report["points_outside"], 0);
    // The same again gives the same, and what exists stays.
    let again = dir.cager("cage --rest rest.obj --vertices 50 -o again.ply").succeeds();
    assert_eq!(read_cage(&dir, "again.ply"), cage, "{again:?}");
    let refused = dir.cager("cage --rest rest.obj -o made.obj").run();
    assert!(refused.status == Some(1) && refused.stderr.contains("--overwrite"), "{refused:?}");
    dir.cager("cage --rest rest.obj --vertices 30 -o made.obj --overwrite").succeeds();
    assert_ne!(read_cage(&dir, "made.obj"), cage);
}

#[test]
fn a_picture_is_a_page_and_says_so() {
    let (dir, _) = Dir::with_capture();
    let refused = dir.cager("cage --rest rest.obj -o made.obj --picture made.png").run();
    assert_eq!(refused.status, Some(1));
    assert_sentence("cage", &refused.stderr, &["made.png does not end with .html", "name it cage.html"]);
    assert_eq!(dir.names(""), ["cage.obj", "frames.npy", "rest.obj"]);
}

#[test]
fn general_cages_enclose_one_model_or_several() {
    let (dir, small) = Dir::with_capture();
    let mut other = small.rest.clone();
    other.points.iter_mut().for_each(|p| p[0] += 3.0);
    dir.model("other.obj", &other);
    for shape in ["box", "sphere", "hull"] {
        let line = format!("cage --rest rest.obj --rest other.obj --general {shape} --vertices 42 -o {shape}.obj");
        dir.cager(&line).succeeds();
        let cage = read_cage(&dir, &format!("{shape}.obj"));
        assert!(cage.points.len() <= 42, "{shape}");
        for rest in [&small.rest, &other] {
            assert_eq!(faults(&cage, rest), Vec::<String>::new(), "{shape}");
        }
    }
    let refused = dir.cager("cage --rest rest.obj --rest other.obj -o two.obj").run();
    assert!(refused.status == Some(1) && refused.stderr.contains("--general"), "{refused:?}");
}

#[test]
fn a_designed_cage_encodes_more_accurately_than_one_of_the_rest_pose_and_is_reported() {
    let (dir, small) = Dir::with_capture();
    dir.cager("cage --rest rest.obj --vertices 40 -o rest40.obj").succeeds();
    dir.cager(
        "cage --rest rest.obj --frames frames.npy --vertices 40 --time-limit 20 -o moved.obj --report moved.json",
    )
    .succeeds();
    let cage = read_cage(&dir, "moved.obj");
    assert_eq!(faults(&cage, &small.rest), Vec::<String>::new());
    let error = |cage: &str| {
        let line =
            format!("encode --rest rest.obj --cage {cage} --frames frames.npy --handles all -o out.cager --overwrite");
        dir.cager(&line).succeeds();
        dir.cager("decode out.cager -o out.npy --overwrite").succeeds();
        mean(
            &measure(&small.rest.points, &small.frames, &read_frames(&dir.path("out.npy"), small.rest.points.len())).l2,
        )
    };
    let (before, after) = (error("rest40.obj"), error("moved.obj"));
    assert!(after < 0.9 * before, "{before} {after}");
    let design = &dir.json("moved.json")["design"];
    assert_eq!(design["style"], "editable");
    let stages = design["stages"].as_array().expect("stages");
    let held_back = |k: usize| stages[k]["held_back_error"].as_f64().expect("an error");
    assert!(held_back(stages.len() - 1) < held_back(0));
    assert_eq!(design["held_back_error"].as_f64(), Some(held_back(stages.len() - 1)));
}

#[test]
fn encode_without_a_cage_designs_one_and_its_file_decodes() {
    let (dir, small) = Dir::with_capture();
    let line = "encode --rest rest.obj --frames frames.npy --cage-vertices 40 --time-limit 10 -o out.cager --overwrite --report report.json";
    dir.cager(line).succeeds();
    let report = dir.json("report.json");
    assert_eq!(report["design"]["style"], "free");
    assert_eq!(report["design"]["vertices"], report["cage_vertices"]);
    assert!(report["cage_vertices"].as_u64().expect("a number") <= 40);
    dir.cager("decode out.cager -o out.npy --overwrite").succeeds();
    let found = measure(&small.rest.points, &small.frames, &read_frames(&dir.path("out.npy"), small.rest.points.len()));
    let told = report["error"]["l2_mean"].as_f64().expect("an error");
    assert!((mean(&found.l2) - told).abs() < 1e-6 * told + 1e-9, "{told}");
}

#[test]
fn harmonic_coordinates_without_a_cage_get_one_with_every_point_inside() {
    let (dir, _) = Dir::with_capture();
    let line = "encode --rest rest.obj --frames frames.npy --coordinates harmonic --cage-vertices 30 --time-limit 5 -o out.cager --overwrite --report report.json";
    dir.cager(line).succeeds();
    assert_eq!(dir.json("report.json")["design"]["style"], "editable");
}

#[test]
fn check_names_everything_that_is_wrong_and_repair_puts_it_right() {
    let (dir, small) = Dir::with_capture();
    let said = dir.cager("cage --rest rest.obj --check cage.obj").succeeds().stdout;
    assert!(said.starts_with("cage.obj: usable, free of self-intersection"), "{said}");
    // Inside out, with a doubled vertex along a seam and a loose one.
    let mut broken = small.cage.clone().flipped();
    broken.vertices.push([9.0, 9.0, 9.0]);
    let [a, _, _] = broken.triangles[0];
    broken.vertices.push(broken.vertices[a as usize]);
    let doubled = broken.vertices.len() as u32 - 1;
    broken.triangles[0] = broken.triangles[0].map(|v| if v == a { doubled } else { v });
    dir.model("broken.obj", &as_model(&broken));
    let checked = dir.cager("cage --rest rest.obj --check broken.obj --report check.json").run();
    assert_eq!(checked.status, Some(1));
    for word in ["not usable", "inwards", "no face"] {
        assert!(checked.stdout.contains(word), "{word}: {}", checked.stdout);
    }
    // The seam is closed, as where the cage is encoded with.
    assert!(checked.stderr.contains("broken.obj: merged 1 "), "{}", checked.stderr);
    assert_eq!(dir.json("check.json")["usable"], false);
    let repaired = dir.cager("cage --rest rest.obj --repair broken.obj -o repaired.obj").succeeds().stdout;
    assert!(repaired.contains("changed"), "{repaired}");
    assert_eq!(faults(&read_cage(&dir, "repaired.obj"), &small.rest), Vec::<String>::new());
    dir.cager("encode --rest rest.obj --cage repaired.obj --frames frames.npy -o out.cager --overwrite").succeeds();
}

#[test]
fn a_cage_in_other_units_or_of_more_vertices_than_points_does_not_fit() {
    let (dir, small) = Dir::with_capture();
    let mut large = as_model(&small.cage);
    large.points.iter_mut().flatten().for_each(|x| *x *= 1000.0);
    dir.model("large.obj", &large);
    dir.model("box.obj", &quad_box(&small.rest.points));
    for (line, what) in [
        ("--rest rest.obj --check large.obj", "check the units"),
        ("--rest box.obj --check cage.obj", "more than the 8 points"),
    ] {
        let coarser = line.contains("box");
        let said = dir.cager(&format!("cage {line} --report check.json --overwrite")).run();
        assert_eq!(said.status, Some(1));
        assert!(said.stdout.contains("not usable for this rest pose") && said.stdout.contains(what), "{}", said.stdout);
        assert_eq!(said.stderr.contains("take a coarser cage"), coarser, "{}", said.stderr);
        assert_eq!(dir.json("check.json")["usable"], false);
    }
    // Nor is such a cage made.
    dir.cager("cage --rest rest.obj --vertices 1400 -o fits.obj").succeeds();
    assert!(read_cage(&dir, "fits.obj").points.len() <= small.rest.points.len());
    let repaired = dir.cager("cage --rest rest.obj --repair large.obj -o repaired.obj").succeeds().stdout;
    assert!(repaired.contains("not usable for this rest pose"), "{repaired}");
}

#[test]
fn a_repair_moves_a_cage_out_to_the_points_it_left_outside_and_keeps_its_quads() {
    let (dir, small) = Dir::with_capture();
    let mut tight = quad_box(&small.rest.points);
    let centre = vector::mean(&tight.points);
    tight.points.iter_mut().for_each(|p| *p = along(centre, 0.86, sub(*p, centre)));
    dir.model("tight.obj", &tight);
    let checked = dir.cager("cage --rest rest.obj --check tight.obj").succeeds().stdout;
    assert!(checked.contains("points outside the cage"), "{checked}");
    dir.cager("cage --rest rest.obj --repair tight.obj -o roomy.obj").succeeds();
    let roomy = read_cage(&dir, "roomy.obj");
    assert_eq!(roomy.faces, tight.faces);
    assert_eq!(faults(&roomy, &small.rest), Vec::<String>::new());
}

#[test]
fn an_improved_cage_keeps_its_faces() {
    let (dir, small) = Dir::with_capture();
    let start = quad_box(&small.rest.points);
    dir.model("box.obj", &start);
    dir.cager("cage --rest rest.obj --frames frames.npy --improve box.obj --time-limit 5 -o better.obj").succeeds();
    let better = read_cage(&dir, "better.obj");
    assert_eq!(better.faces, start.faces);
    assert_ne!(better.points, start.points);
    assert_eq!(faults(&better, &small.rest), Vec::<String>::new());
}

#[test]
fn what_cannot_be_done_is_one_sentence_and_leaves_nothing() {
    let (dir, small) = Dir::with_capture();
    let with_points = |name: &str, points: Vec<[f64; 3]>| dir.model(name, &Model { points, ..Model::default() });
    with_points("one.obj", vec![[1.0, 2.0, 3.0]]);
    with_points("same.obj", vec![[1.0, 2.0, 3.0]; 40]);
    dir.write("empty.obj", "");
    dir.write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nv 0 0 1\n");
    let mut fewer = small.frames.clone();
    fewer.iter_mut().for_each(|frame| frame.truncate(30));
    dir.frames("fewer.npy", &fewer);
    let before = dir.contents();
    let cases: [(&str, &[&str]); 10] = [
        ("cage --rest one.obj -o c.obj", &["one.obj", "one place"]),
        ("cage --rest same.obj -o c.obj", &["same.obj", "one place"]),
        ("cage --rest empty.obj -o c.obj", &["empty.obj"]),
        ("cage --rest nan.obj -o c.obj", &["nan.obj"]),
        ("cage --rest rest.obj --frames fewer.npy -o c.obj", &["fewer.npy", "10 points where"]),
        ("cage --rest rest.obj --frames frames.npy --mean-error 0 -o c.obj", &["--mean-error", "above 0"]),
        ("encode --rest rest.obj --frames frames.npy --mean-error nan -o c.cager", &["--mean-error"]),
        ("cage --rest rest.obj --frames frames.npy --improve cage.obj --symmetry x -o c.obj", &["cage.obj", "mirror"]),
        ("cage --rest rest.obj -o c.stl", &["c.stl", ".obj"]),
        ("cage --rest rest.obj -o missing/c.obj", &["missing"]),
    ];
    for (line, words) in cases {
        let done = dir.cager(line).run();
        assert_eq!(done.status, Some(1), "{line}: {done:?}");
        assert_eq!(done.stderr.trim_end().lines().count(), 1, "{line}: {}", done.stderr);
        for word in words {
            assert!(done.stderr.contains(word), "{line}: {word} is missing in {}", done.stderr);
        }
        assert_eq!(dir.contents(), before, "{line}");
    }
    for line in [
        "cage --rest rest.obj --vertices 3 -o c.obj",
        "cage --rest rest.obj",
        "cage --rest rest.obj --style free -o c.obj",
        "cage --rest rest.obj --improve cage.obj -o c.obj",
        "encode --rest rest.obj --cage cage.obj --cage-vertices 50 --frames frames.npy -o c.cager",
    ] {
        assert_eq!(dir.cager(line).run().status, Some(2), "{line}");
    }
}

#[test]
fn the_smallest_cage_for_an_error_is_found() {
    let (dir, small) = Dir::with_capture();
    let made = Small::new();
    assert_eq!(made.rest, small.rest);
    dir.cager("cage --rest rest.obj --frames frames.npy --mean-error 0.004 -o small.obj --report small.json")
        .succeeds();
    let line = "encode --rest rest.obj --cage small.obj --frames frames.npy --handles spread -o out.cager --overwrite --report out.json";
    dir.cager(line).succeeds();
    let reached = dir.json("out.json")["error"]["l2_mean"].as_f64().expect("an error");
    assert!(reached < 0.0045, "{reached}");
    assert!(dir.json("small.json")["vertices"].as_u64().expect("a number") < 150);
    // A large error takes a few vertices, fewer than can be merged of a cage that is close to the model.
    let said = dir
        .cager("cage --rest rest.obj --frames frames.npy --mean-error 0.1 -o tiny.obj --report tiny.json")
        .succeeds();
    assert!(dir.json("tiny.json")["vertices"].as_u64().expect("a number") <= 12, "{}", said.stdout);
    // What no cage meets is coded.
    let line = "encode --rest rest.obj --frames frames.npy --mean-error 1e-5 --time-limit 2 -o out.cager --overwrite --report out.json";
    let said = dir.cager(line).succeeds();
    assert!(said.stderr.contains("was not reached") && said.stdout.contains("coded beside it"), "{}", said.stderr);
    let reached = dir.json("out.json")["error"]["l2_mean"].as_f64().expect("an error");
    assert!(reached <= 1e-5, "{reached}");
}
