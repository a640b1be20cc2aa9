//! Cages with a component for parts that move apart: `encode --per-part`.

use crate::refused::refused;
use crate::support::{Dir, largest, measure, read_frames};
use cager_geometry::mesh::Point;
use std::fmt::Write;

/// Points around and along a ball.
const AROUND: usize = 12;
const RINGS: usize = 9;
const POINTS: usize = AROUND * RINGS + 2;
const ENCODE: &str = "encode --rest rest.obj --frames frames.npy --cage-vertices 40 --max-error 0.001 -o out.cager";

fn ball(center: Point, radius: f64) -> Vec<Point> {
    let at = |ring: usize, k: usize| {
        let (z, turn) = (
            std::f64::consts::PI * (ring + 1) as f64 / (RINGS + 1) as f64,
            std::f64::consts::TAU * k as f64 / AROUND as f64,
        );
        [
            center[0] + radius * z.sin() * turn.cos(),
            center[1] + radius * z.sin() * turn.sin(),
            center[2] + radius * z.cos(),
        ]
    };
    let mut points: Vec<Point> = (0..RINGS).flat_map(|ring| (0..AROUND).map(move |k| at(ring, k))).collect();
    points.extend([[center[0], center[1], center[2] + radius], [center[0], center[1], center[2] - radius]]);
    points
}

/// Two balls as two objects: a rock that stands still, and a bird that flies away from it and bends.
fn scene(dir: &Dir) -> (Vec<Point>, Vec<Vec<f64>>) {
    let rest = [ball([0.0; 3], 0.5), ball([1.2, 0.0, 0.0], 0.4)].concat();
    let mut text = String::new();
    for (name, first) in [("rock", 0), ("bird", POINTS)] {
        writeln!(text, "o {name}").unwrap();
        rest[first..first + POINTS].iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
        let id = |ring: usize, k: usize| first + ring * AROUND + k % AROUND + 1;
        for k in 0..AROUND {
            for ring in 0..RINGS - 1 {
                let [a, b, c, d] = [id(ring, k), id(ring + 1, k), id(ring + 1, k + 1), id(ring, k + 1)];
                writeln!(text, "f {a} {b} {c} {d}").unwrap();
            }
            writeln!(text, "f {} {} {}", first + POINTS - 1, id(0, k), id(0, k + 1)).unwrap();
            writeln!(text, "f {} {} {}", first + POINTS, id(RINGS - 1, k + 1), id(RINGS - 1, k)).unwrap();
        }
    }
    dir.write("rest.obj", text);
    let moved = |i: usize, p: &Point, t: f64| {
        if i < POINTS {
            *p
        } else {
            [p[0] + 0.3 * t, p[1] + 0.1 * t, p[2] + 0.4 * (0.5 * t).sin() * (p[0] - 1.2).powi(2)]
        }
    };
    let frame = |t: usize| rest.iter().enumerate().flat_map(|(i, p)| moved(i, p, t as f64)).collect();
    let frames: Vec<Vec<f64>> = (0..12).map(frame).collect();
    dir.frames("frames.npy", &frames);
    (rest, frames)
}

#[test]
fn parts_that_move_apart_get_components_and_every_command_takes_the_file() {
    let dir = Dir::new();
    let (rest, frames) = scene(&dir);
    dir.cager(&format!("{ENCODE} --per-part no")).succeeds();
    let of_one = dir.read("out.cager").len();
    let done = dir.cager(&format!("{ENCODE} --overwrite")).succeeds();
    assert!(done.stdout.contains("the cage has 2 components"), "{}", done.stdout);
    assert_eq!(done.stderr, "");
    assert!(dir.read("out.cager").len() < of_one, "{} bytes, {of_one} with one cage", dir.read("out.cager").len());
    let holds = |file: &str| {
        let found = read_frames(&dir.path(file), rest.len());
        let errors = measure(&rest, &frames, &found);
        assert!(largest(&errors.linf) <= 0.001, "{file}: {}", largest(&errors.linf));
    };
    dir.cager("decode out.cager -o back.npy").succeeds();
    holds("back.npy");
    // Computed in parts, to the same result.
    dir.cager("decode out.cager --memory 100MB -o parts.npy").succeeds();
    assert!(dir.read("parts.npy") == dir.read("back.npy"));
    // One of them alone, whose points the other component carries none of.
    for (part, first) in [("rock", 0), ("bird", POINTS)] {
        dir.cager(&format!("decode out.cager --part {part} -o {part}.npy")).succeeds();
        let alone = read_frames(&dir.path(&format!("{part}.npy")), POINTS);
        let off = |(alone, frame): (&Vec<f64>, &Vec<f64>)| {
            let own = &frame[3 * first..3 * (first + POINTS)];
            alone.iter().zip(own).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        assert!(alone.len() == 12 && alone.iter().zip(&frames).map(off).fold(0.0, f64::max) < 0.01, "{part}");
    }

    let said = dir.cager("inspect out.cager").succeeds().stdout;
    assert!(said.contains(" carry /rock\n") && said.contains(" carry /bird\n") && said.contains("COMP"), "{said}");
    dir.cager("inspect --json out.cager").succeeds();
    // Its cage serves another take, edits and a picture of cages.
    let again = "encode --rest rest.obj --frames frames.npy --cage out.cager --max-error 0.001 -o again.cager";
    dir.cager(again).succeeds();
    let said = dir.cager("inspect again.cager").succeeds().stdout;
    assert!(said.contains(" carry /rock\n"), "{said}");
    dir.cager("decode again.cager -o again.npy").succeeds();
    holds("again.npy");
    dir.cager("decode out.cager --cages -o cages.npy").succeeds();
    dir.cager("edit out.cager --with-cages cages.npy --flatten -o edited.cager").succeeds();
    dir.cager("decode edited.cager -o edited.npy").succeeds();
    holds("edited.npy");
    dir.cager("cage --rest rest.obj --check out.cager").succeeds();
}

#[test]
fn each_part_can_have_a_component_and_what_cannot_be_is_refused() {
    let dir = Dir::new();
    scene(&dir);
    let said = dir.cager(&format!("{ENCODE} --per-part yes --time-limit 2")).succeeds().stdout;
    assert!(said.contains("the cage has 2 components"), "{said}");
    let other = ENCODE.replace("out.cager", "other.cager");
    refused(
        &dir,
        &format!("{other} --per-part yes --coordinates harmonic"),
        &["--per-part: components carry parts with mean value"],
    );
    refused(
        &dir,
        &format!("{other} --per-part yes --server http://127.0.0.1:1"),
        &["--per-part: a service makes one cage"],
    );
    refused(&dir, &other.replace("40", "12").replace("--max-error 0.001", "--per-part yes"), &["ask for at least 16"]);
    let again = "encode --rest rest.obj --frames frames.npy --cage out.cager -o other.cager";
    refused(&dir, &format!("{again} --coordinates harmonic"), &["use mean value coordinates"]);
    refused(&dir, &format!("{again} --server http://127.0.0.1:1"), &["which a service does not know"]);
    refused(&dir, "decode out.cager --model rest.obj -o other.npy", &["--per-part no"]);
}
