//! Other models moved by the cages of a real capture, whose true motion is known.

use crate::real_data::data;
use crate::support::{Dir, mean, measure, polygons, read_frames};
use cager_formats::{open_frames, read_model, write_model};
use cager_geometry::mesh::{Model, Point, diagonal};
use cager_geometry::vector::{add, along, cross, norm, sub};
use std::path::Path;

/// Frames that are looked at.
const FRAMES: &str = "0-72x6";

fn encoded(root: &Path) -> (Dir, Model, Vec<Vec<f64>>, f64) {
    let folder = root.join("makehuman-cmu-walk");
    let rest = read_model(&folder.join("rest.obj")).expect("a rest pose");
    let dir = Dir::new();
    let (rest_file, cage, frames) = (folder.join("rest.obj"), folder.join("cage350.obj"), folder.join("frames.npy"));
    let line = format!("encode --frames-range {FRAMES} -o walk.cager --report walk.json --rest");
    dir.cager(&line).arg(&rest_file).arg("--cage").arg(&cage).arg("--frames").arg(&frames).succeeds();
    let own = dir.json("walk.json")["error"]["l2_mean"].as_f64().expect("an error");
    let mut reader = open_frames(&frames, rest.points.len()).expect("frames");
    let mut truth = Vec::new();
    for k in 0..73 {
        let mut frame = Vec::new();
        reader.read_next(&mut frame).expect("a frame");
        if k % 6 == 0 {
            truth.push(frame);
        }
    }
    (dir, rest, truth, own)
}

/// What the program makes of another model, over the diagonal of the original's rest pose.
fn error(dir: &Dir, rest: &Model, model: &Model, truth: &[Vec<f64>]) -> f64 {
    write_model(&dir.path("other.ply"), model).expect("a model");
    dir.cager("decode walk.cager --model other.ply -o other.npy --overwrite").succeeds();
    let found = read_frames(&dir.path("other.npy"), model.points.len());
    mean(&measure(&model.points, truth, &found).l2) * diagonal(&model.points) / diagonal(&rest.points)
}

#[test]
#[ignore = "needs the captures: make captures"]
fn makehuman_at_another_resolution_follows_its_cages_within_a_tenth_of_its_own_error() {
    let root = data();
    let (dir, rest, truth, own) = encoded(&root);

    // Finer: the centre of every face beside the points, which moves as the face's corners do.
    let centres = |frame: &[f64]| -> Vec<f64> {
        let points: &[Point] = frame.as_chunks().0;
        let centre =
            |f: &[u32]| [0, 1, 2].map(|k| f.iter().map(|&i| points[i as usize][k]).sum::<f64>() / f.len() as f64);
        rest.faces.iter().flat_map(centre).collect()
    };
    let finer = |frame: &[f64]| [frame.to_vec(), centres(frame)].concat();
    let fine = Model { points: finer(rest.points.as_flattened()).as_chunks().0.to_vec(), ..Model::default() };
    let fine_truth: Vec<_> = truth.iter().map(|frame| finer(frame)).collect();
    let fine_error = error(&dir, &rest, &fine, &fine_truth);

    // Coarser: every third point.
    let coarser = |frame: &[f64]| -> Vec<f64> { frame.chunks_exact(9).flat_map(|c| c[..3].to_vec()).collect() };
    let coarse = Model { points: coarser(rest.points.as_flattened()).as_chunks().0.to_vec(), ..Model::default() };
    let coarse_truth: Vec<_> = truth.iter().map(|frame| coarser(frame)).collect();
    let coarse_error = error(&dir, &rest, &coarse, &coarse_truth);

    eprintln!(
        "L2 of the original {:.4} %; of {} points {:.4} %, of {} points {:.4} %",
        100.0 * own,
        fine.points.len(),
        100.0 * fine_error,
        coarse.points.len(),
        100.0 * coarse_error
    );
    for error in [fine_error, coarse_error] {
        assert!((error / own - 1.0).abs() < 0.1, "{error} {own}");
    }
}

#[test]
#[ignore = "needs the captures: make captures"]
fn garments_over_makehuman_follow_its_cages_within_a_tenth_of_the_error_of_the_body_under_them() {
    let root = data();
    let (dir, rest, truth, own) = encoded(&root);
    // A thousandth of the diagonal above the skin: a garment that moves with it.
    let lift = 0.001 * diagonal(&rest.points);
    let lifted = |frame: &[f64], worn: &[u32], lift: f64| -> Vec<f64> {
        let points: &[Point] = frame.as_chunks().0;
        let normals = normals(&rest, points);
        worn.iter().flat_map(|&i| along(points[i as usize], lift, normals[i as usize])).collect()
    };
    let error_of = |worn: &[u32], lift: f64| {
        let truth: Vec<_> = truth.iter().map(|frame| lifted(frame, worn, lift)).collect();
        let points = lifted(rest.points.as_flattened(), worn, lift).as_chunks().0.to_vec();
        error(&dir, &rest, &Model { points, faces: polygons([]), ..Model::default() }, &truth)
    };
    // A suit all over, and a garment from the knees to the shoulders.
    let (low, high) = cager_geometry::mesh::bounds(&rest.points);
    let up = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(1);
    let height = |i: &u32| (rest.points[*i as usize][up] - low[up]) / (high[up] - low[up]);
    let all: Vec<u32> = (0..rest.points.len() as u32).collect();
    let middle: Vec<u32> = all.iter().copied().filter(|i| (0.3..0.8).contains(&height(i))).collect();
    let suit = error_of(&all, lift);
    let (garment, skin) = (error_of(&middle, lift), error_of(&middle, 0.0));
    eprintln!(
        "L2 of the original {:.4} %; of a suit {:.4} %; of the skin under a garment of {} points {:.4} %, of the garment {:.4} %",
        100.0 * own,
        100.0 * suit,
        middle.len(),
        100.0 * skin,
        100.0 * garment
    );
    for (worn, body) in [(suit, own), (garment, skin)] {
        assert!((worn / body - 1.0).abs() < 0.1, "{worn} {body}");
    }
}

/// Unit normals at the points, by the areas of the faces around them.
fn normals(rest: &Model, points: &[Point]) -> Vec<Point> {
    let mut sums = vec![[0.0; 3]; points.len()];
    for face in rest.faces.iter() {
        for k in 1..face.len() - 1 {
            let [a, b, c] = [face[0], face[k], face[k + 1]].map(|i| points[i as usize]);
            let (u, v) = (sub(b, a), sub(c, a));
            let normal = cross(u, v);
            for i in [face[0], face[k], face[k + 1]] {
                sums[i as usize] = add(sums[i as usize], normal);
            }
        }
    }
    let unit = |n: Point| {
        let length = norm(n).max(f64::MIN_POSITIVE);
        n.map(|x| x / length)
    };
    sums.into_iter().map(unit).collect()
}
