//! STED: what it sees, what it does not, and a second implementation in numpy.

use cager_core::sted::{Sted, StedError, StedMeter};
use cager_geometry::mesh::Polygons;
use std::io::Write;
use std::process::{Command, Stdio};

const SIDE: usize = 12;
const FRAMES: usize = 9;
const DIAGONAL: f64 = 1.5;

type Frames = Vec<Vec<f64>>;

fn grid() -> Polygons {
    let mut faces = Polygons::new();
    for y in 0..SIDE - 1 {
        for x in 0..SIDE - 1 {
            let a = (y * SIDE + x) as u32;
            let (b, c, d) = (a + 1, a + 1 + SIDE as u32, a + SIDE as u32);
            // Polygons of two arities.
            if (x + y) % 3 == 0 {
                faces.push(&[a, b, c, d]);
            } else {
                faces.push(&[a, b, c]);
                faces.push(&[a, c, d]);
            }
        }
    }
    faces
}

/// A cloth that waves.
fn capture() -> Frames {
    let frame = |t: usize| {
        (0..SIDE * SIDE)
            .flat_map(|v| {
                let (x, y) = ((v % SIDE) as f64 / SIDE as f64, (v / SIDE) as f64 / SIDE as f64);
                let phase = 0.4 * t as f64;
                [x + 0.03 * (5.0 * y + phase).sin(), y, 0.1 * (7.0 * x + 3.0 * y + phase).cos()]
            })
            .collect()
    };
    (0..FRAMES).map(frame).collect()
}

/// The capture with something added to each number.
fn displaced(capture: &Frames, mut by: impl FnMut(usize, usize) -> f64) -> Frames {
    let frame = |(t, frame): (usize, &Vec<f64>)| frame.iter().enumerate().map(|(i, x)| x + by(t, i)).collect();
    capture.iter().enumerate().map(frame).collect()
}

fn noise(amplitude: f64, seed: u64) -> impl FnMut(usize, usize) -> f64 {
    let mut random = fastrand::Rng::with_seed(seed);
    move |_, _| amplitude * (2.0 * random.f64() - 1.0)
}

fn sted(captured: &Frames, decoded: &Frames) -> Sted {
    let mut meter = StedMeter::new(&grid(), SIDE * SIDE, DIAGONAL).unwrap();
    captured.iter().zip(decoded).for_each(|(a, b)| meter.add(a, b).unwrap());
    meter.result()
}

#[test]
fn equal_captures_differ_by_nothing() {
    assert_eq!(sted(&capture(), &capture()), Sted { spatial: 0.0, temporal: Some(0.0), total: 0.0 });
}

#[test]
fn a_displacement_that_stays_is_not_seen() {
    let found = sted(&capture(), &displaced(&capture(), |_, i| [0.3, -0.2, 0.1][i % 3]));
    assert!(found.total < 1e-12, "{found:?}");
}

#[test]
fn a_displacement_that_changes_with_time_is_seen_in_time_alone() {
    let found = sted(&capture(), &displaced(&capture(), |t, _| if t % 2 == 0 { 0.01 } else { 0.0 }));
    assert!(found.spatial < 1e-12 && found.temporal.unwrap() > 0.01, "{found:?}");
}

#[test]
fn another_size_everywhere_is_not_seen_in_space() {
    let larger: Frames = capture().iter().map(|frame| frame.iter().map(|x| 1.1 * x).collect()).collect();
    assert!(sted(&capture(), &larger).spatial < 1e-12);
}

#[test]
fn a_rigid_motion_of_both_changes_nothing() {
    let decoded = displaced(&capture(), noise(0.004, 1));
    let (sine, cosine) = 0.7f64.sin_cos();
    let moved = |frames: &Frames| -> Frames {
        let turned = |p: &[f64]| [cosine * p[0] - sine * p[1] + 3.0, sine * p[0] + cosine * p[1], p[2] - 1.0];
        frames.iter().map(|frame| frame.chunks_exact(3).flat_map(turned).collect()).collect()
    };
    let (here, there) = (sted(&capture(), &decoded), sted(&moved(&capture()), &moved(&decoded)));
    assert!((here.total - there.total).abs() < 1e-10 * here.total, "{here:?}, {there:?}");
    assert!(here.spatial > 0.01 && here.temporal.unwrap() > 0.01, "{here:?}");
}

#[test]
fn the_size_and_unit_of_the_capture_change_nothing() {
    let decoded = displaced(&capture(), noise(0.004, 1));
    let scaled =
        |frames: &Frames| displaced(frames, |_, _| 0.0).iter().map(|f| f.iter().map(|x| 100.0 * x).collect()).collect();
    let (captured, found): (Frames, Frames) = (scaled(&capture()), scaled(&decoded));
    let mut meter = StedMeter::new(&grid(), SIDE * SIDE, 100.0 * DIAGONAL).unwrap();
    captured.iter().zip(&found).for_each(|(a, b)| meter.add(a, b).unwrap());
    let here = sted(&capture(), &decoded);
    assert!((meter.result().total - here.total).abs() < 1e-10 * here.total);
}

#[test]
fn noise_is_seen_more_than_a_smooth_deformation_of_the_same_l2() {
    let captured = capture();
    let l2 = |frames: &Frames| {
        let squares = frames.iter().flatten().zip(captured.iter().flatten()).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let rough = displaced(&captured, noise(0.004, 2));
    let wave = |amplitude: f64| {
        displaced(&captured, |t, i| amplitude * (2.0 * (i / 3 % SIDE) as f64 / SIDE as f64 + 0.1 * t as f64).sin())
    };
    let smooth = wave(l2(&rough) / l2(&wave(1.0)));
    assert!((l2(&smooth) - l2(&rough)).abs() < 1e-9);
    let (rough, smooth) = (sted(&captured, &rough), sted(&captured, &smooth));
    assert!(rough.spatial > 5.0 * smooth.spatial, "{rough:?}, {smooth:?}");
    assert!(rough.temporal > smooth.temporal.map(|part| 3.0 * part), "{rough:?}, {smooth:?}");
}

#[test]
fn more_noise_is_seen_more() {
    let of = |amplitude| sted(&capture(), &displaced(&capture(), noise(amplitude, 3))).total;
    assert!(of(1e-4) < of(1e-3) && of(1e-3) < of(1e-2));
}

#[test]
fn one_frame_has_no_temporal_part_and_points_alone_have_no_spatial_one() {
    let decoded = displaced(&capture(), noise(0.004, 1));
    let found = sted(&capture()[..1].to_vec(), &decoded);
    assert_eq!((found.temporal, found.total), (None, found.spatial));
    assert!(found.total > 0.01);
    let mut cloud = StedMeter::new(&Polygons::new(), SIDE * SIDE, DIAGONAL).unwrap();
    capture().iter().zip(&decoded).for_each(|(a, b)| cloud.add(a, b).unwrap());
    let found = cloud.result();
    assert!(found.spatial.is_nan() && found.total.is_nan() && found.temporal.is_some_and(|part| part > 0.0));
}

#[test]
fn what_cannot_be_measured_is_refused_or_nan() {
    let mut faces = Polygons::new();
    faces.push(&[0, 1, 3]);
    assert_eq!(StedMeter::new(&faces, 3, 1.0).err(), Some(StedError::NoSuchVertex { vertex: 3, points: 3 }));
    for diagonal in [0.0, f64::NAN] {
        assert!(matches!(StedMeter::new(&faces, 4, diagonal).err(), Some(StedError::NoExtent { .. })));
    }
    let mut meter = StedMeter::new(&faces, 4, 1.0).unwrap();
    meter.add(&[0.0; 12], &[0.0f32; 12]).unwrap();
    let refused = meter.add(&[0.0; 12], &[0.0; 9]).unwrap_err();
    assert_eq!(refused, StedError::Points { frame: 1, captured: 12, decoded: 9, expected: 12 });
    // All edges are points.
    assert!(meter.result().spatial.is_nan());
    let mut broken = capture();
    broken[4][5] = f64::NAN;
    assert!(sted(&capture(), &broken).total.is_nan());
}

#[test]
fn more_threads_change_no_bit() {
    let decoded = displaced(&capture(), noise(0.004, 1));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sted(&capture(), &decoded))
    };
    assert_eq!(on(1), on(3));
}

/// `benches/sted.py` from its own definition, also of a capture shorter than a run of frames.
#[test]
fn numpy_finds_the_same() {
    let python = std::env::var("CAGER_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !Command::new(&python).args(["-c", "import numpy"]).output().is_ok_and(|found| found.status.success()) {
        eprintln!("skipped: {python} has no numpy");
        return;
    }
    let decoded = displaced(&capture(), noise(0.004, 1));
    for frames in [FRAMES, 4] {
        let (captured, decoded) = (capture()[..frames].to_vec(), decoded[..frames].to_vec());
        let found = sted(&captured, &decoded);
        let [spatial, temporal, total] = by_numpy(&python, &captured, &decoded);
        for (a, b) in [(found.spatial, spatial), (found.temporal.unwrap(), temporal), (found.total, total)] {
            assert!((a - b).abs() <= 1e-12 * b.abs(), "{found:?}, but numpy has {spatial}, {temporal}, {total}");
        }
    }
}

fn by_numpy(python: &str, captured: &Frames, decoded: &Frames) -> [f64; 3] {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../benches/sted.py");
    let faces: Vec<Vec<u32>> = grid().iter().map(<[u32]>::to_vec).collect();
    let input =
        format!(r#"{{"faces": {faces:?}, "captured": {captured:?}, "decoded": {decoded:?}, "diagonal": {DIAGONAL}}}"#);
    let mut child =
        Command::new(python).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python runs");
    child.stdin.take().expect("piped").write_all(input.as_bytes()).expect("python reads");
    let done = child.wait_with_output().expect("python ends");
    assert!(done.status.success());
    let text = String::from_utf8(done.stdout).expect("text");
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
    numbers.try_into().expect("three numbers")
}
