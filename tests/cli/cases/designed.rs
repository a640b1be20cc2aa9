//! Case 09: cages of few poses, which determine some of a cage's vertices hardly at all. They stay near the model, and what is said blames the cage.

use crate::support::{Dir, Small, as_model, read_cages};
use cager_geometry::mesh::{Point, TriMesh, bounds, diagonal};
use cager_geometry::vector::{centroid, distance};

/// Farthest that a vertex may be from the box around a frame's points, in diagonals, beyond what it is in the rest pose.
const NEAR: f64 = 1.25;

/// With `rest.obj`, `frames.npy` of few trembling poses, which only --force is sure to take, and `weak.obj`: the cage with one face divided again and again, into vertices that hardly move
/// the model.
fn few_poses() -> (Dir, Small) {
    let (dir, mut small) = Dir::with_capture();
    let size = 0.05 * diagonal(&small.rest.points);
    let mut state = 7_u64;
    let mut tremble = |x: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from((x + size * ((state >> 33) as f64 / (1_u64 << 30) as f64 - 1.0)) as f32)
    };
    small.frames.truncate(6);
    small.frames.iter_mut().skip(1).flatten().for_each(|x| *x = tremble(*x));
    dir.frames("frames.npy", &small.frames);
    let mut weak: TriMesh = small.cage.clone();
    for _ in 0..12 {
        let [a, b, c] = weak.triangles[0];
        let center = weak.vertices.len() as u32;
        weak.vertices.push(centroid([a, b, c].map(|v| weak.vertices[v as usize])));
        weak.triangles[0] = [a, b, center];
        weak.triangles.extend([[b, c, center], [c, a, center]]);
    }
    dir.model("weak.obj", &as_model(&weak));
    (dir, small)
}

/// How many diagonals the cages of a container are away from their frames, at the most.
fn away(dir: &Dir, small: &Small) -> f64 {
    let unit = diagonal(&small.rest.points);
    let of_frame = |(cage, frame): (Vec<f32>, &Vec<f64>)| {
        let (low, high) = bounds(frame.as_chunks().0);
        let beyond = |v: &[f32; 3]| {
            let v: Point = v.map(f64::from);
            distance(v, [0, 1, 2].map(|k| v[k].clamp(low[k], high[k])))
        };
        cage.as_chunks().0.iter().map(beyond).fold(0.0, f64::max) / unit
    };
    read_cages(&dir.path("out.cager")).into_iter().zip(&small.frames).map(of_frame).fold(0.0, f64::max)
}

#[test]
fn a_cage_that_would_run_away_stays_near_and_is_blamed_with_what_helps() {
    let (dir, small) = few_poses();
    let encode = "encode --rest rest.obj --frames frames.npy --cage weak.obj -o out.cager --overwrite --force";
    for options in ["", " --handles all", " --regularizer temporal", " --max-error 0.01", " --lambda 10"] {
        let said = dir.cager(&format!("{encode}{options}")).succeeds().stderr;
        assert!(away(&dir, &small) < NEAR + 0.2, "{options}: {} diagonals", away(&dir, &small));
        assert!(!said.contains("closer to the origin"), "{options}: {said}");
    }
    let told = |options: &str, what: &[&str]| {
        let said = dir.cager(&format!("{encode}{options}")).succeeds().stderr;
        assert!(what.iter().all(|what| said.contains(what)), "{said}");
        said
    };
    told(
        "",
        &[
            "the cage would have run away",
            "handles at all points (handles all) follow more closely, an error bound (max_error) stores",
        ],
    );
    let said = told(
        " --handles all",
        &["the cage would have run away", "there; an error bound (max_error) stores what it leaves"],
    );
    assert!(!said.contains("handles at all points"), "{said}");
    // What is advised helps.
    let said = dir.cager(&encode.replace("weak.obj", "cage.obj")).succeeds().stderr;
    assert!(!said.contains("run away") && away(&dir, &small) < NEAR, "{said}");
}

#[test]
fn a_cage_that_nothing_holds_is_blamed_and_not_the_capture() {
    let (dir, _) = few_poses();
    let encode = "encode --rest rest.obj --frames frames.npy --cage weak.obj -o out.cager --overwrite --force";
    let said = dir.cager(&format!("{encode} --regularizer none")).succeeds().stderr;
    assert!(said.contains("the cage ran away") && !said.contains("move the capture closer"), "{said}");
}
