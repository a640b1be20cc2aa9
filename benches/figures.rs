//! Times every step on a built-in capture and prints one JSON document; `benches/run.py` puts the peers beside it.
//!
//! `figures FOLDER` writes rest.obj, cage.obj and frames.npy there first, so that other programs measure the same data.
//! `figures --encoding REST CAGE FRAMES` times what bounds an encoding of files with default options from below.
//! `figures --growth POINTS CAGE_VERTICES` prepares once and prints times and sizes.

use anyhow::Context;
use cager_codec::{AdjacentGroups, CageBasis, decode_cages, encode_cages};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Coordinates, Green, Harmonic, MeanValue, Refinement};
use cager_core::inversion::{BATCH, PrepareContext, Rows, Solver, SolverOptions, Step};
use cager_core::spectral::maxvol::{self, maxvol};
use cager_demo::{Capture, Options};
use cager_formats::{FrameOptions, create_frames, open_frames, read_model, write_model};
use cager_geometry::linalg::svd::svd;
use cager_geometry::linalg::to_single;
use cager_geometry::mesh::{self, Model, Point, Polygons, TriMesh};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

const POINTS: usize = 20_000;
const FRAMES: usize = 499;
const CAGE_VERTICES: usize = 330;
const RUNS: usize = 9;
/// Step of coded cages over the diagonal and the root of their rows: that of `--quality preview`.
const CAGE_STEP: f64 = 2.8e-3;
/// Frames of a group of coded cages.
const GROUP: usize = 256;
/// Runs of what takes seconds.
const FEW_RUNS: usize = 3;

fn main() -> anyhow::Result<()> {
    // `cargo bench` adds --bench.
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let value = match args.as_slice() {
        [flag, points, vertices] if flag == "--growth" => growth(points.parse()?, vertices.parse()?)?,
        [flag, files @ ..] if flag == "--encoding" && files.len() == 3 => encoding(files)?,
        [folder] => figures(Path::new(folder))?,
        _ => anyhow::bail!(
            "usage: figures FOLDER | figures --encoding REST CAGE FRAMES | figures --growth POINTS CAGE_VERTICES; `make bench` does it all"
        ),
    };
    #[allow(clippy::print_stdout)]
    {
        println!("{value:#}");
    }
    Ok(())
}

/// Best and median seconds of several runs after one that is not counted.
fn timed<T>(work: impl FnMut() -> T) -> Value {
    timed_runs(RUNS, work).0
}

/// The same of so many runs, with the result of the one that is not counted.
fn timed_runs<T>(runs: usize, mut work: impl FnMut() -> T) -> (Value, T) {
    let result = black_box(work());
    let mut seconds: Vec<f64> = (0..runs)
        .map(|_| {
            let clock = Instant::now();
            black_box(work());
            clock.elapsed().as_secs_f64()
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    (json!({ "best": seconds[0], "median": seconds[runs / 2], "runs": runs }), result)
}

fn per_frame(mut figure: Value, frames: usize) -> Value {
    for key in ["best", "median"] {
        let seconds = figure[key].as_f64().unwrap_or(f64::NAN);
        figure[key] = json!(seconds / frames as f64);
    }
    figure
}

fn capture(points: usize, cage_vertices: usize) -> anyhow::Result<(Capture, Cage)> {
    let capture = Capture::new(&Options { points, frames: FRAMES, cage_vertices });
    let cage = Cage::new(capture.cage.clone())?;
    Ok((capture, cage))
}

fn figures(folder: &Path) -> anyhow::Result<Value> {
    let (capture, cage) = capture(POINTS, CAGE_VERTICES)?;
    let points = &capture.rest.points;
    let frames = write(&capture, &cage, folder)?;

    let (mvc, mean_value) = timed_runs(RUNS, || MeanValue.coordinates(&cage, points, None));
    let (green, green_found) = timed_runs(RUNS, || Green::Free.coordinates(&cage, points, None));
    let (harmonic, harmonic_found) = timed_runs(FEW_RUNS, || Harmonic.coordinates(&cage, points, None));
    let mean_value = mean_value?;
    let coordinates = json!({
        "mvc": quality(&MeanValue, &cage, points, &mean_value),
        "green": quality(&Green::Free, &cage, points, &green_found?),
        "harmonic": quality(&Harmonic, &cage, points, &harmonic_found?),
    });
    let phi = mean_value.phi;
    let upstream = to_single(phi.as_ref(), phi.nrows());
    let gradient = timed(|| MeanValue.gradient(&cage, points, upstream.as_ref()));
    let handles = maxvol(phi.as_ref(), maxvol::TOLERANCE)?;
    let maxvol_figure = timed(|| maxvol(phi.as_ref(), maxvol::TOLERANCE));
    let m = phi.ncols();
    let square = faer::Mat::from_fn(m, m, |i, j| phi[(handles.rows[i] as usize, j)]);
    let svd = timed(|| svd(square.as_ref()));
    let prepare = timed(|| Solver::prepare(&MeanValue, &cage, points, SolverOptions::PAPER));

    let solver = Solver::prepare(&MeanValue, &cage, points, SolverOptions::PAPER)?;
    let batches: Vec<Vec<&[f32]>> = frames.chunks(BATCH).map(|b| b.iter().map(Vec::as_slice).collect()).collect();
    // Side by side, as `encode` does; the peers multiply on as many threads.
    let invert = timed(|| batches.par_iter().map(|b| solver.invert(Rows::All, None, b)).collect::<Vec<_>>());
    // Normals that follow from the vertices: an iteration for every frame.
    let consistent = Solver::prepare(&Green::Consistent, &cage, points, SolverOptions::PAPER)?;
    let green_invert =
        timed_runs(FEW_RUNS, || batches.par_iter().map(|b| consistent.invert(Rows::All, None, b)).collect::<Vec<_>>())
            .0;
    let inverted: Vec<_> = batches.iter().map(|b| solver.invert(Rows::All, None, b)).collect();
    let cages: Vec<Vec<&[f32]>> =
        inverted.iter().map(|batch| batch.iter().map(|inverted| inverted.cage.as_slice()).collect()).collect();
    let invert_measure = timed(|| {
        for batch in &batches {
            let inverted = solver.invert(Rows::All, None, batch);
            let views: Vec<&[f32]> = inverted.iter().map(|inverted| inverted.cage.as_slice()).collect();
            black_box(solver.decoder().measure(&views, batch));
        }
    });
    let mut out = vec![Vec::new(); BATCH];
    let decode = timed(|| {
        for views in &cages {
            solver.decoder().decode(views, &mut out[..views.len()]);
        }
    });
    let (basis, _) = CageBasis::of(&MeanValue, &cage, points, None, None)?.context("a basis")?;
    let views = cages.concat();
    let step = CAGE_STEP * mesh::diagonal(points) / (basis.rows() as f64).sqrt();
    let groups = || views.chunks(GROUP).map(|group| encode_cages(&basis, group, step, AdjacentGroups::default()));
    let code_cages = timed(|| groups().collect::<Vec<_>>());
    let coded: Vec<Vec<u8>> = groups().collect::<Option<_>>().context("cages that can be coded")?;
    let read_cages = timed(|| {
        for (group, bytes) in views.chunks(GROUP).zip(&coded) {
            black_box(decode_cages(&basis, group.len(), bytes)).ok();
        }
    });
    Ok(json!({
        "points": points.len(),
        "cage_vertices": cage.vertices().len(),
        "cage_faces": cage.faces().len(),
        "frames": frames.len(),
        "coded_cages_bytes": coded.iter().map(Vec::len).sum::<usize>(),
        "threads": rayon::current_num_threads(),
        "log_volume": handles.volume.log_volume,
        "swaps": handles.volume.swaps,
        "solver_bytes": solver.size_bytes(),
        "coordinates": coordinates,
        "seconds": {
            "mvc": mvc,
            "mvc_gradient": gradient,
            "green": green,
            "harmonic": harmonic,
            "maxvol": maxvol_figure,
            "svd": svd,
            "prepare": prepare,
            "invert_batched": per_frame(invert, frames.len()),
            "green_invert_batched": per_frame(green_invert, frames.len()),
            "invert_measure": per_frame(invert_measure, frames.len()),
            "decode": per_frame(decode, frames.len()),
            "code_cages": per_frame(code_cages, frames.len()),
            "read_cages": per_frame(read_cages, frames.len()),
        },
    }))
}

/// How well coordinates reproduce the rest pose, at worst and over its diagonal, and how they were refined.
fn quality(system: &dyn CoordinateSystem, cage: &Cage, points: &[Point], found: &Coordinates) -> Value {
    let values = system.values(cage).rest;
    let values = faer::Mat::from_fn(values.len(), 3, |j, k| values[j][k]);
    let reproduced = &found.phi * &values;
    let miss = |(i, p): (usize, &Point)| (0..3).map(|k| (reproduced[(i, k)] - p[k]).powi(2)).sum::<f64>().sqrt();
    let farthest = points.iter().enumerate().map(miss).max_by(f64::total_cmp).unwrap_or(f64::NAN);
    let mut quality = json!({ "affine_error": farthest / mesh::diagonal(points) });
    if let Some(Refinement { elements, refinements, change }) = found.refinement {
        quality["elements"] = json!(elements);
        quality["refinements"] = json!(refinements);
        quality["change"] = json!(change);
    }
    quality
}

/// Writes the capture for other programs; returns its frames as they read them.
fn write(capture: &Capture, cage: &Cage, folder: &Path) -> anyhow::Result<Vec<Vec<f32>>> {
    std::fs::create_dir_all(folder)?;
    write_model(&folder.join("rest.obj"), &capture.rest)?;
    write_model(&folder.join("cage.obj"), &Model::from(cage.mesh().clone()))?;
    let (n, count) = (capture.rest.points.len(), capture.frames());
    let mut writer = create_frames(folder.join("frames.npy"), n, count, &Polygons::new(), &FrameOptions::default())?;
    let mut frame = Vec::new();
    let mut frames = Vec::with_capacity(count);
    for t in 0..count {
        capture.frame(t, &mut frame);
        frames.push(frame.iter().map(|&x| x as f32).collect::<Vec<f32>>());
        writer.write_frame(&frames[t])?;
    }
    writer.finish()?;
    Ok(frames)
}

/// What an encoding with default options does at the least, one after the other: reading the frames, and the two products of every frame, that of the
/// operator with its handles and that of the coordinates with its cage, for the errors. Beside them the preparation, without reading files.
fn encoding(files: &[String]) -> anyhow::Result<Value> {
    let [rest, cage, frames] = [0, 1, 2].map(|file| Path::new(&files[file]));
    let points = &read_model(rest)?.points;
    let cage = Cage::new(TriMesh::from(&read_model(cage)?))?;
    let options = SolverOptions::for_unknowns(cage.vertices().len());
    let prepare = timed(|| Solver::prepare(&MeanValue, &cage, points, options));
    let solver = Solver::prepare(&MeanValue, &cage, points, options)?;
    let mut kept = Vec::new();
    let read = timed(|| {
        let mut reader = open_frames(frames, points.len())?;
        let mut frame = Vec::new();
        kept.clear();
        while reader.read_next(&mut frame)? {
            kept.push(frame.iter().map(|&x| x as f32).collect::<Vec<f32>>());
        }
        Ok::<_, anyhow::Error>(())
    });
    let mut out = vec![Vec::new(); BATCH];
    let batches: Vec<Vec<&[f32]>> = kept.chunks(BATCH).map(|b| b.iter().map(Vec::as_slice).collect()).collect();
    let products = timed(|| {
        let inverted: Vec<_> = batches.par_iter().map(|b| solver.invert(Rows::All, None, b)).collect();
        for inverted in inverted {
            let cages: Vec<&[f32]> = inverted.iter().map(|inverted| inverted.cage.as_slice()).collect();
            solver.decoder().decode(&cages, &mut out[..cages.len()]);
        }
    });
    Ok(json!({
        "points": points.len(),
        "cage_vertices": cage.vertices().len(),
        "frames": kept.len(),
        "seconds": { "prepare": prepare, "read": read, "products": products },
    }))
}

fn growth(points: usize, cage_vertices: usize) -> anyhow::Result<Value> {
    let (capture, cage) = capture(points, cage_vertices)?;
    let clock = Instant::now();
    let begun = RefCell::new(Vec::new());
    let before_step = |step| {
        begun.borrow_mut().push((step, clock.elapsed().as_secs_f64()));
        ControlFlow::Continue(())
    };
    let context = PrepareContext { before_step: &before_step, ..PrepareContext::default() };
    let solver = Solver::prepare_with(&MeanValue, &cage, &capture.rest.points, SolverOptions::PAPER, &context)?;
    let seconds = clock.elapsed().as_secs_f64();
    let begin = |step| begun.borrow().iter().find(|(name, _)| *name == step).map_or(seconds, |(_, begin)| *begin);
    let [coordinates, handles, rest] = [Step::Coordinates, Step::Handles, Step::SingularValues].map(begin);
    Ok(json!({
        "points": capture.rest.points.len(),
        "cage_vertices": cage.vertices().len(),
        "seconds": seconds,
        "coordinates_seconds": handles - coordinates,
        "maxvol_seconds": rest - handles,
        "svd_seconds": seconds - rest,
        "solver_bytes": solver.size_bytes(),
    }))
}
