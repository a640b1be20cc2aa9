//! `cager demo`: the main job on a built-in capture.

use super::args::DemoArgs;
use super::encode::write_report;
use super::{grouped, human_bytes, interrupt, print, progress};
use crate::coordinates;
use crate::coordinates::default_spectrum;
use crate::decode;
use crate::encode::{self, Encoded, Job};
use crate::plot::error_plot;
use crate::report::Report;
use anyhow::{Context, Result, bail, ensure};
use cager_core::cage::Cage;
use cager_core::inversion::SolverOptions;
use cager_core::mesh::{Model, Polygons, diagonal};
use cager_core::synthetic::{Capture, Options};
use cager_formats::{AtomicFile, FrameReader, commit_together, open_frames, write_model};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

pub(super) fn run(args: &DemoArgs) -> Result<()> {
    let capture = Capture::new(&Options {
        points: args.points as usize,
        frames: args.frames as usize,
        cage_vertices: args.cage_vertices as usize,
    });
    let cage = Cage::new(capture.cage.clone()).context("the built-in cage")?;
    let Some(system) = coordinates::by_name("mvc") else { bail!("mean value coordinates are missing") };
    let folder = &args.output;
    interrupt::leaves_nothing()?;
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    write_model(&folder.join("rest.obj"), &capture.rest)?;
    write_model(&folder.join("cage.obj"), &as_model(&cage))?;

    let output = folder.join("capture.cager");
    let bar = progress::frames("encoding", capture.frames());
    let mut frames = Generated { capture: &capture, next: 0 };
    let job = Job {
        rest: &capture.rest,
        cage: &cage,
        frames: &mut frames,
        output: &output,
        system,
        options: SolverOptions { spectrum: default_spectrum(cage.vertices().len()), ..SolverOptions::default() },
    };
    let Encoded { report, container } = encode::encode(job, &mut |done| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    let report_file = write_report(AtomicFile::create(folder.join("report.json"))?, &report)?;
    commit_together(vec![report_file, container])?;

    let decoded = folder.join("decoded.npy");
    let clock = Instant::now();
    let bar = progress::frames("decoding", capture.frames());
    decode::decode(&output, &decoded, &mut |done| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    let decode_seconds = clock.elapsed().as_secs_f64();
    compare(&capture, &decoded, &report)?;

    let (l2, linf): (Vec<f64>, Vec<f64>) = report.error.per_frame.iter().map(|e| (e.l2, e.linf)).unzip();
    let title = format!(
        "Built-in capture: {} points, cage of {} vertices",
        grouped(report.points as u64),
        report.cage_vertices
    );
    let mut plot = AtomicFile::create(folder.join("errors.svg"))?;
    plot.write_all(error_plot(&title, &l2, &linf).as_bytes())?;
    plot.commit()?;
    print(&table(&report, decode_seconds, folder)?)
}

fn as_model(cage: &Cage) -> Model {
    let mut faces = Polygons::new();
    for triangle in &cage.mesh().triangles {
        faces.push(triangle);
    }
    Model { points: cage.vertices().to_vec(), faces }
}

/// The built-in capture as a source of frames.
struct Generated<'a> {
    capture: &'a Capture,
    next: usize,
}

impl FrameReader for Generated<'_> {
    fn points(&self) -> usize {
        self.capture.rest.points.len()
    }

    fn frames(&self) -> usize {
        self.capture.frames()
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, cager_formats::Error> {
        out.clear();
        if self.next == self.capture.frames() {
            return Ok(false);
        }
        self.capture.frame(self.next, out);
        self.next += 1;
        Ok(true)
    }
}

/// Measures the decoded file anew, to show that the report says what a user gets.
fn compare(capture: &Capture, decoded: &Path, report: &Report) -> Result<()> {
    let n = capture.rest.points.len();
    let size = diagonal(&capture.rest.points);
    let mut reader = open_frames(decoded, n)?;
    let (mut truth, mut found) = (Vec::new(), Vec::new());
    for (t, said) in report.error.per_frame.iter().enumerate() {
        capture.frame(t, &mut truth);
        ensure!(reader.read_next(&mut found)?, "{}: frame {t} is missing", decoded.display());
        let squares = truth
            .chunks_exact(3)
            .zip(found.chunks_exact(3))
            .map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>());
        let (sum, max) = squares.fold((0.0, 0.0), |(sum, max): (f64, f64), s| (sum + s, max.max(s)));
        let (l2, linf) = ((sum / n as f64).sqrt() / size, max.sqrt() / size);
        ensure!(
            (l2 - said.l2).abs() <= 1e-6 * said.l2 && (linf - said.linf).abs() <= 1e-6 * said.linf,
            "frame {t}: the report says L2 {:e} and L∞ {:e}, but the decoded file has {l2:e} and {linf:e}; please report this",
            said.l2,
            said.linf
        );
    }
    Ok(())
}

fn table(report: &Report, decode_seconds: f64, folder: &Path) -> Result<String> {
    let s = &report.seconds;
    let frames = report.frames as f64;
    let mut out = String::new();
    let mut row = |name: &str, value: String, note: &str| writeln!(out, "  {name:<24}{value:>14}   {note}");
    row("points × frames", format!("{} × {}", grouped(report.points as u64), report.frames), "")?;
    row("cage vertices / faces", format!("{} / {}", report.cage_vertices, report.cage_faces), "")?;
    row("capture", human_bytes(report.bytes.capture), "positions as f32 and one connectivity")?;
    row("capture.cager", human_bytes(report.bytes.output), "rest pose and cage included")?;
    row("ratio", format!("{:.1} ×", report.bytes.ratio), "")?;
    row(
        "L2 mean / max",
        format!("{:.3} / {:.3} %", 100.0 * report.error.l2_mean, 100.0 * report.error.l2_max),
        "of the rest diagonal",
    )?;
    row(
        "L∞ mean / max",
        format!("{:.3} / {:.3} %", 100.0 * report.error.linf_mean, 100.0 * report.error.linf_max),
        "of the rest diagonal",
    )?;
    row("affine reproduction", format!("{:.1e}", report.affine_reproduction_error), "of the rest diagonal")?;
    row(
        "condition number",
        format!("{:.1}", report.condition_number.handles),
        &format!("{:.1} over all points", report.condition_number.full),
    )?;
    row("coordinates", format!("{:.3} s", s.coordinates), "")?;
    row("maxvol", format!("{:.3} s", s.maxvol), &format!("{} swaps", report.maxvol.swaps))?;
    row("spectrum and operator", format!("{:.3} s", s.svd), "")?;
    row("inversion", format!("{:.3} s", s.invert), &format!("{:.1} µs per frame", 1e6 * s.invert / frames))?;
    row("error measurement", format!("{:.3} s", s.measure), &format!("{:.3} ms per frame", 1e3 * s.measure / frames))?;
    row("encoding in all", format!("{:.3} s", s.total), "generating the frames included")?;
    row("decoding in all", format!("{decode_seconds:.3} s"), "coordinates and writing decoded.npy included")?;
    writeln!(out, "Decoded again and measured anew: the errors are those of the report.")?;
    writeln!(out, "Look at {}: the errors of every frame.", folder.join("errors.svg").display())?;
    Ok(out)
}
