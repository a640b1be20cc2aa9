//! Guaranteed errors in every format, and on another processor: coded files are written here and decoded without AVX and FMA, and the other way
//! round. `make emulated` names the emulator in `CAGER_QEMU`; without it that is not tested.

use crate::support::{Dir, Small, as_model, largest, measure, read_frames};
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_geometry::vector::{add, middle};
use std::collections::HashMap;

const SYSTEMS: [&str; 4] = ["mvc", "harmonic", "green", "green-free"];

/// An octahedron whose faces are cut in four so many times, on a sphere: its symmetries make eigenvalues of Gram matrices equal.
fn sphere(radius: f64, cuts: u32) -> TriMesh {
    let corners =
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let mut vertices: Vec<Point> = corners.to_vec();
    let mut triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..cuts {
        let mut middles = HashMap::new();
        let mut between = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let p = middle(vertices[a as usize], vertices[b as usize]);
                vertices.push(p.map(|x| x / p.iter().map(|x| x * x).sum::<f64>().sqrt()));
                vertices.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [between(a, b), between(b, c), between(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    TriMesh { vertices: vertices.into_iter().map(|p| p.map(|x| radius * x)).collect(), triangles }
}

/// A sphere that twists, waves and travels.
fn capture() -> Small {
    let rest = sphere(1.0, 3);
    let moved = |t: f64, [x, y, z]: Point| {
        let (sin, cos) = (0.5 * t.sin() * y).sin_cos();
        let wave = |k: f64| 0.003 * (9.0 * k + t).sin();
        [x * cos - z * sin + 0.1 * (3.0 * y + t).sin() + 0.02 * t + wave(y), y + wave(z), x * sin + z * cos + wave(x)]
    };
    let frames = (0..16).map(|t| rest.vertices.iter().flat_map(|&p| moved(0.4 * f64::from(t), p)).collect()).collect();
    Small { rest: rest.into(), cage: sphere(1.3, 2), frames }
}

/// The capture so many diagonals away from the origin, in double precision.
fn with_capture(diagonals: f64) -> (Dir, Small) {
    let mut small = capture();
    let size = diagonal(&small.rest.points);
    let place = [diagonals * size, -0.5 * diagonals * size, 0.0].map(f64::round);
    let moved = |points: &mut [Point]| points.iter_mut().for_each(|p| *p = add(*p, place));
    moved(&mut small.rest.points);
    moved(&mut small.cage.vertices);
    small.frames.iter_mut().for_each(|frame| moved(frame.as_chunks_mut().0));
    let dir = Dir::new();
    dir.model("rest.obj", &small.rest);
    dir.model("cage.obj", &as_model(&small.cage));
    let (frames, points) = (small.frames.len(), small.rest.points.len());
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({frames}, {points}, 3), }}");
    header = format!("{header:<117}\n");
    let values = small.frames.iter().flatten().flat_map(|x| x.to_le_bytes());
    let head = [b"\x93NUMPY\x01\0".as_slice(), &118u16.to_le_bytes(), header.as_bytes()].concat();
    dir.write("frames.npy", head.into_iter().chain(values).collect::<Vec<u8>>());
    (dir, small)
}

fn encode(system: &str, bound: f64) -> String {
    format!(
        "encode --rest rest.obj --cage cage.obj --frames frames.npy -o coded.cager --overwrite --coordinates {system} --max-error {bound}"
    )
}

fn error_of(dir: &Dir, name: &str, small: &Small) -> f64 {
    let found = read_frames(&dir.path(name), small.rest.points.len());
    largest(&measure(&small.rest.points, &small.frames, &found).linf)
}

#[test]
fn formats_hold_guaranteed_errors_or_refuse_them() {
    for (place, diagonals) in [("near", 0.0), ("far", 900.0)] {
        let (dir, small) = with_capture(diagonals);
        for (system, bound) in SYSTEMS.into_iter().flat_map(|system| [(system, 1e-3), (system, 1e-5)]) {
            dir.cager(&encode(system, bound)).succeeds();
            let mut cells = Vec::new();
            for format in ["npy", "pc2", "mdd", "mcx", "abc", "usdc", "glb"] {
                let name = format!("decoded.{format}");
                let done = dir.cager(&format!("decode coded.cager -o {name} --overwrite")).run();
                if done.status != Some(0) {
                    assert!(
                        done.stderr.contains("write .npy") || done.stderr.contains("write .usdc"),
                        "{}",
                        done.stderr
                    );
                    cells.push(format!("{format} refused"));
                    continue;
                }
                let share = error_of(&dir, &name, &small) / bound;
                cells.push(format!("{format} {share:.4}"));
                assert!(share <= 1.0, "{place}, {system}, {bound:e}, {format}: {share} of the bound");
            }
            eprintln!("{place}, {system}, {bound:e}: {}", cells.join(", "));
            let always =
                if diagonals > 0.0 { ["npy", "abc", "usdc"].as_slice() } else { &["npy", "pc2", "mdd", "abc", "usdc"] };
            assert!(always.iter().all(|format| !cells.contains(&format!("{format} refused"))), "{cells:?}");
        }
    }
}

#[test]
fn emulated_processors_hold_guaranteed_errors() {
    let Ok(emulator) = std::env::var("CAGER_QEMU") else {
        eprintln!("CAGER_QEMU names no emulator, so nothing is tested; see `make emulated`");
        return;
    };
    let (dir, small) = with_capture(0.0);
    let run = |is_emulated: bool, line: &str| {
        let program = env!("CARGO_BIN_EXE_cager");
        let words = line.split_whitespace();
        if is_emulated {
            dir.command(&emulator, ["-cpu", "Nehalem", program].into_iter().chain(words)).succeeds();
        } else {
            dir.command(program, words).succeeds();
        }
    };
    for (system, bound) in SYSTEMS.into_iter().flat_map(|system| [(system, 1e-3), (system, 1e-5)]) {
        for is_written_here in [true, false] {
            run(!is_written_here, &encode(system, bound));
            run(is_written_here, "decode coded.cager -o decoded.npy --overwrite");
            let share = error_of(&dir, "decoded.npy", &small) / bound;
            let place = if is_written_here { "decoded" } else { "encoded" };
            eprintln!("{system}, {bound:e}, {place} without AVX: {share:.4} of the bound");
            assert!(share <= 1.0, "{system}, {bound:e}, {place} without AVX: {share} of the bound");
        }
    }
}
