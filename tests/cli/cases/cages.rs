//! Cases 26 and 27, and polygons of cages that are not convex: checking, repairing and encoding read a cage alike, and a repair takes nothing back.

use crate::support::{Dir, polygons};
use cager_geometry::mesh::Model;

#[test]
fn a_cage_whose_faces_were_split_is_checked_as_it_is_encoded_with() {
    let dir = Dir::with_case("26-check-refuses-a-cage-that-encode-takes");
    let merged = "warning: split.obj: merged 16 vertices with others in the same place, as seams split them\n";
    let checked = dir.cager("cage --rest rest.obj --check split.obj --report check.json").succeeds();
    assert_eq!(checked.stderr, merged);
    assert!(checked.stdout.contains("usable, free of self-intersection and around every point"), "{}", checked.stdout);
    let report = dir.json("check.json");
    assert_eq!((report["usable"].as_bool(), report["vertices"].as_u64()), (Some(true), Some(8)));
    let encoded = dir.cager("encode --rest rest.obj --frames frames.npy --cage split.obj -o a.cager").succeeds();
    assert!(encoded.stderr.contains(merged), "{}", encoded.stderr);
    let line = "cage --rest rest.obj --frames frames.npy --improve split.obj --time-limit 1 -o better.obj";
    let improved = dir.cager(line).succeeds();
    assert!(improved.stderr.contains(merged), "{}", improved.stderr);
}

#[test]
fn a_cage_in_another_unit_is_checked_as_it_is_encoded_with() {
    let dir = Dir::with_case("26-check-refuses-a-cage-that-encode-takes");
    let scene = |mesh: &str, metres: &str, scale: f64| {
        let text = String::from_utf8(dir.read(mesh)).expect("UTF-8");
        let (mut points, mut counts, mut corners) = (Vec::new(), Vec::new(), Vec::new());
        for line in text.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            if words[0] == "v" {
                let at: Vec<String> =
                    words[1..].iter().map(|x| (scale * x.parse::<f64>().expect("a number")).to_string()).collect();
                points.push(format!("({})", at.join(", ")));
            } else {
                counts.push((words.len() - 1).to_string());
                corners.extend(words[1..].iter().map(|k| (k.parse::<u32>().expect("a number") - 1).to_string()));
            }
        }
        format!(
            "#usda 1.0\n(\n    metersPerUnit = {metres}\n    upAxis = \"Z\"\n)\ndef Mesh \"mesh\"\n{{\n    point3f[] points = [{}]\n    int[] faceVertexCounts = [{}]\n    int[] faceVertexIndices = [{}]\n}}\n",
            points.join(", "),
            counts.join(", "),
            corners.join(", ")
        )
    };
    dir.write("rest.usda", scene("rest.obj", "1", 1.0));
    dir.write("cage.usda", scene("split.obj", "0.01", 100.0));
    let scaled = "cage.usda: the cage is scaled by 0.01";
    for line in [
        "cage --rest rest.usda --check cage.usda",
        "encode --rest rest.usda --frames frames.npy --cage cage.usda -o a.cager",
    ] {
        let done = dir.cager(line).succeeds();
        assert!(done.stderr.contains(scaled), "{line}: {}", done.stderr);
    }
    // And so is what a repair of it writes.
    dir.cager("cage --rest rest.usda --repair cage.usda -o repaired.obj").succeeds();
    dir.cager("cage --rest rest.usda --check repaired.obj").succeeds();
}

/// What a check finds.
fn found(dir: &Dir, cage: &str) -> Vec<String> {
    let said = dir.cager(&format!("cage --rest rest.obj --check {cage}")).run().stdout;
    said.lines().filter_map(|line| line.trim_start().strip_prefix("found ").map(str::to_owned)).collect()
}

/// A repair, what it found and what a check finds of its output: nothing more than that of the cage as it was, and nothing to repair again.
fn repaired(dir: &Dir, cage: &str) -> Vec<String> {
    let before = found(dir, cage);
    dir.cager(&format!("cage --rest rest.obj --repair {cage} -o repaired.obj --overwrite")).succeeds();
    let after = found(dir, "repaired.obj");
    assert!(after.len() <= before.len(), "{before:?} became {after:?}");
    let again = dir.cager("cage --rest rest.obj --repair repaired.obj -o again.obj --overwrite").succeeds();
    let why = if after.is_empty() { "there was nothing to repair" } else { "what was found stays" };
    assert!(again.stdout.contains(&format!("changed  nothing: {why}")), "{}", again.stdout);
    after
}

#[test]
fn an_hourglass_is_split_and_its_tips_are_moved_apart() {
    let dir = Dir::with_case("27-repair-and-check-in-a-circle");
    assert!(found(&dir, "hourglass.obj")[0].contains("1 vertex at which parts of the surface only touch"));
    let after = repaired(&dir, "hourglass.obj");
    let is_circle =
        |found: &String| ["same place", "cut or touch", "only touch"].iter().any(|what| found.contains(what));
    assert!(!after.iter().any(is_circle), "{after:?}");
    dir.cager("encode --rest rest.obj --frames rest.obj --cage repaired.obj -o a.cager").succeeds();
}

#[test]
fn parts_that_touch_in_vertices_of_their_own_are_told_to_be_moved_apart_and_are() {
    let dir = Dir::with_case("27-repair-and-check-in-a-circle");
    // What the repair of the hourglass once wrote; two boxes on each other; and two that share an edge.
    let text = String::from_utf8(dir.read("hourglass.obj")).expect("UTF-8");
    let split = text
        .replace("v 0.000000 0.000000 0.000000\n", "v 0 0 0\nv 0 0 0\n")
        .lines()
        .map(|line| match line.split_once(' ') {
            Some(("f", corners)) => {
                let corners: Vec<u32> = corners.split_whitespace().map(|k| k.parse().expect("a number")).collect();
                let is_upper = corners.iter().any(|&k| k > 5);
                let moved = corners.iter().map(|&k| if k > 5 || (k == 5 && is_upper) { k + 1 } else { k }.to_string());
                format!("f {}", moved.collect::<Vec<_>>().join(" "))
            }
            _ => line.to_owned(),
        })
        .collect::<Vec<_>>()
        .join("\n");
    dir.write("split.obj", split);
    let boxes = |other: [f64; 3]| {
        let (mut points, mut faces) = (Vec::new(), Vec::new());
        for (k, low) in [[-0.6, -0.6, -1.3], other].into_iter().enumerate() {
            points.extend(
                (0..8).map(|i| [0, 1, 2].map(|k| low[k] + if i >> k & 1 == 1 { [1.2, 1.2, 1.3][k] } else { 0.0 })),
            );
            for quad in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
                faces.push(quad.map(|v: u32| v + 8 * k as u32).to_vec());
            }
        }
        Model { points, faces: polygons(faces), ..Model::default() }
    };
    dir.model("stacked.obj", &boxes([-0.6, -0.6, 0.0]));
    dir.model("beside.obj", &boxes([0.6, -0.6, 0.0]));
    for cage in ["split.obj", "stacked.obj", "beside.obj"] {
        let before = found(&dir, cage);
        let touching = before.iter().find(|found| found.contains("of vertices in the same place")).expect(cage);
        assert!(touching.contains("only touch") && touching.ends_with("move them apart"), "{cage}: {touching}");
        let after = repaired(&dir, cage);
        assert!(
            !after.iter().any(|found| found.contains("same place") || found.contains("cut or touch")),
            "{cage}: {after:?}"
        );
    }
}

#[test]
fn concave_polygons_of_a_cage_are_read_as_they_lie() {
    let dir = Dir::new();
    // An L and a plus, drawn up; fans about their first corners leave their outline.
    let ell = vec![[1.0, 1.0], [1.0, 3.0], [0.0, 3.0], [0.0, 0.0], [3.0, 0.0], [3.0, 1.0]];
    let plus = [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [2, 2], [2, 3], [1, 3], [1, 2], [0, 2], [0, 1], [1, 1]];
    let plus: Vec<[f64; 2]> = plus.iter().map(|p| p.map(f64::from)).collect();
    let inside = |center: [f64; 2], size: f64, count: usize| -> Vec<[f64; 3]> {
        (0..count)
            .map(|k| {
                let at = |prime: f64| size * ((k as f64 * prime).fract() - 0.5);
                [center[0] + at(0.618_033_988), center[1] + at(0.754_877_666), 0.5 + 0.4 * at(0.569_840_291) / size]
            })
            .collect()
    };
    let arms = [([0.5, 0.5], [0.5, 2.0], [2.0, 0.5]), ([1.5, 1.5], [1.5, 0.5], [2.5, 1.5])];
    for ((name, outline), (a, b, c)) in [("ell", &ell), ("plus", &plus)].into_iter().zip(arms) {
        for first in 0..outline.len() {
            let n = outline.len() as u32;
            let mut outline = outline.clone();
            outline.rotate_left(first);
            let points: Vec<[f64; 3]> =
                [0.0, 1.0].iter().flat_map(|&z| outline.iter().map(move |&[x, y]| [x, y, z])).collect();
            let mut faces: Vec<Vec<u32>> = vec![(0..n).map(|k| 2 * n - 1 - k).rev().collect(), (0..n).rev().collect()];
            faces.extend((0..n).map(|k| vec![k, (k + 1) % n, (k + 1) % n + n, k + n]));
            dir.model("cage.obj", &Model { points, faces: polygons(faces), ..Model::default() });
            let rest = [a, b, c].iter().flat_map(|&center| inside(center, 0.8, 40)).collect();
            dir.model("rest.obj", &Model { points: rest, ..Model::default() });
            let checked = dir.cager("cage --rest rest.obj --check cage.obj").succeeds();
            assert!(
                checked.stdout.contains("usable, free of self-intersection and around every point"),
                "{name} from {first}: {}",
                checked.stdout
            );
            dir.cager("encode --rest rest.obj --frames rest.obj --cage cage.obj -o a.cager --overwrite").succeeds();
        }
    }
}
