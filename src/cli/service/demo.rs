//! `cager demo`: the main job on a built-in capture, through a service.

use super::demo_report::{self, Row};
use crate::cli::encode_summary::write_report;
use crate::cli::{grouped, human_bytes, interrupt, progress, tell};
use crate::remote::{
    EncodedRemotely, RemoteCage, RemoteError, RemoteJob, RemoteProgress, Steps, encode_remotely, mesh_file,
};
use anyhow::{Context, Result, ensure};
use cager_capture::decode::{self, Decoding};
use cager_capture::encode::Encoded;
use cager_client::FnFrames;
use cager_client::messages::SessionOptions;
use cager_compare::report_page::{NO_PAGE, ReportPage};
use cager_core::cage::Cage;
use cager_core::sted::{Sted, StedMeter};
use cager_demo::{Capture, Options};
use cager_formats::{AtomicFile, Target, commit_together, open_frames, write_model};
use cager_geometry::mesh::diagonal;
use cager_proto::report::Report;
use cager_service::local::LocalService;
use clap::Args;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Encode and decode a built-in capture through a service of its own: needs no files and no network.
///
/// Example: cager demo -o my-first-capture
#[derive(Args, Debug)]
pub(crate) struct DemoArgs {
    /// Folder for the results: rest.obj, cage.obj, capture.cager, decoded.npy, report.json and report.html.
    #[arg(short, long, value_name = "DIR", default_value = "cager-demo")]
    output: PathBuf,

    /// Points of the capture, about.
    #[arg(long, value_name = "N", default_value_t = 20_000,
          value_parser = clap::value_parser!(u32).range(100..=4_000_000))]
    points: u32,

    /// Frames of the capture.
    #[arg(long, value_name = "F", default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: u32,

    /// Vertices of the cage, about.
    #[arg(long, value_name = "V", default_value_t = 330, value_parser = clap::value_parser!(u32).range(26..=5_000))]
    cage_vertices: u32,
}

pub(super) fn run(args: &DemoArgs) -> Result<()> {
    let capture = Arc::new(Capture::new(&Options {
        points: args.points as usize,
        frames: args.frames as usize,
        cage_vertices: args.cage_vertices as usize,
    }));
    let cage = Cage::new(capture.cage.clone()).context("the built-in cage")?;
    let folder = &args.output;
    interrupt::remove_temporaries_on_signal()?;
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let (rest_file, cage_file) = (folder.join("rest.obj"), folder.join("cage.obj"));
    write_model(&rest_file, &capture.rest)?;
    write_model(&cage_file, &cage.mesh().clone().into())?;

    // There rather than in the system's folder for temporaries, which may be small, or memory.
    let service = LocalService::start(folder)?;
    let output = folder.join("capture.cager");
    let job = RemoteJob {
        address: service.address(),
        token: None,
        rest: mesh_file(&rest_file)?,
        cage: RemoteCage::File(&cage_file),
        session: None,
        matrix: None,
        frames: generated(&capture),
        output: &Target::from(&output),
        options: SessionOptions { name: Some("demo".to_owned()), ..SessionOptions::default() },
        connections: 1,
    };
    let bar = progress::frames("encoding", capture.frames());
    let result = encode_remotely(job, &mut |told| {
        if let RemoteProgress::Frames(done) = told {
            bar.set_position(done as u64);
        }
    });
    bar.finish_and_clear();
    let result = result.map_err(RemoteError::without_session)?;
    let EncodedRemotely { encoded: Encoded { report, container }, steps, .. } = result;
    service.stop()?;
    let report_file = write_report(AtomicFile::create(folder.join("report.json"))?, &report)?;
    commit_together(vec![report_file, container])?;

    let decoded = folder.join("decoded.npy");
    let clock = Instant::now();
    let bar = progress::frames("decoding", capture.frames());
    decode::decode(&output, &decoded, Decoding::default(), &mut |done| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    let decode_seconds = clock.elapsed().as_secs_f64();
    let sted = compare(&capture, &decoded, &report)?;

    let rows = rows(&report, &sted, &steps, decode_seconds);
    let page_file = folder.join("report.html");
    let page = ReportPage::built_in();
    if let Some(page) = &page {
        let mut file = AtomicFile::create(&page_file)?;
        file.write_all(&demo_report::page(page, (&capture, &report, &rows), (&output, &decoded))?)?;
        file.commit()?;
    }
    tell(&table(&rows, page.is_some().then_some(&page_file))?)
}

/// The frames of the built-in capture, made as they are sent.
fn generated(capture: &Arc<Capture>) -> impl cager_client::FrameSource + 'static {
    let capture = Arc::clone(capture);
    let mut wide = Vec::new();
    FnFrames::new(capture.rest.points.len(), u32::try_from(capture.frames()).ok(), move |frame, out: &mut Vec<f32>| {
        capture.frame(frame as usize, &mut wide);
        out.extend(wide.iter().map(|&x| x as f32));
        Ok(true)
    })
}

/// Measures the decoded file anew, to show that the report says what a user gets.
fn compare(capture: &Capture, decoded: &Path, report: &Report) -> Result<Sted> {
    let n = capture.rest.points.len();
    let size = diagonal(&capture.rest.points);
    let mut reader = open_frames(decoded, n)?;
    let mut sted = StedMeter::new(&capture.rest.faces, n, size)?;
    let (mut truth, mut found) = (Vec::new(), Vec::new());
    for (t, said) in report.error.per_frame.iter().enumerate() {
        capture.frame(t, &mut truth);
        // As they were sent.
        truth.iter_mut().for_each(|x| *x = f64::from(*x as f32));
        ensure!(reader.read_next(&mut found)?, "{}: frame {t} is missing", decoded.display());
        let squares = truth
            .chunks_exact(3)
            .zip(found.chunks_exact(3))
            .map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>());
        let (sum, max) = squares.fold((0.0, 0.0), |(sum, max): (f64, f64), s| (sum + s, max.max(s)));
        let (l2, linf) = ((sum / n as f64).sqrt() / size, max.sqrt() / size);
        ensure!(
            (l2 - said.l2).abs() <= 1e-6 * said.l2 && (linf - said.linf).abs() <= 1e-6 * said.linf,
            "frame {t}: the report says L2 {:e} and L∞ {:e}, but the decoded file has {l2:e} and {linf:e}; please \
             report this",
            said.l2,
            said.linf
        );
        sted.add(&truth, &found)?;
    }
    Ok(sted.result())
}

fn rows(report: &Report, sted: &Sted, steps: &Steps, decode_seconds: f64) -> Vec<Row> {
    let s = &report.seconds;
    let seconds = |s: f64| format!("{s:.3} s");
    let mut rows = Vec::new();
    let mut row = |name, value: String, note: &str| rows.push(Row { name, value, note: note.to_owned() });
    row("points × frames", format!("{} × {}", grouped(report.points), report.frames), "");
    row("cage vertices / faces", format!("{} / {}", report.cage_vertices, report.cage_faces), "");
    row("capture", human_bytes(report.bytes.capture), "positions as f32 and one connectivity");
    row("capture.cager", human_bytes(report.bytes.output), "rest pose and cage included");
    row("ratio", format!("{:.1} ×", report.bytes.ratio), "");
    row(
        "L2 mean / max",
        format!("{:.3} / {:.3} %", 100.0 * report.error.l2_mean, 100.0 * report.error.l2_max),
        "of the rest diagonal",
    );
    row(
        "L∞ mean / max",
        format!("{:.3} / {:.3} %", 100.0 * report.error.linf_mean, 100.0 * report.error.linf_max),
        "of the rest diagonal",
    );
    row(
        "STED-like",
        format!("{:.5}", sted.total),
        "uneven change of edges, and trembling; after Váša and Skala 2011, with our constants",
    );
    row("affine reproduction", format!("{:.1e}", report.affine_reproduction_error), "of the rest diagonal");
    row(
        "condition number",
        format!("{:.1}", report.condition_number.handles),
        &format!("{:.1} over all points", report.condition_number.full),
    );
    row("coordinates", seconds(s.coordinates), "");
    row("maxvol", seconds(s.maxvol), &format!("{} swaps", report.maxvol.swaps));
    row("spectrum and operator", seconds(s.svd), "");
    let step = |step: Duration| seconds(step.as_secs_f64());
    let per_frame = 1e3 * steps.upload.as_secs_f64() / report.frames as f64;
    row("service: prepare", step(steps.prepare), "the three above, and sending rest pose and cage");
    row(
        "service: upload, solve",
        step(steps.upload),
        &format!("{per_frame:.3} ms per frame, made, sent, solved, measured, on disk"),
    );
    row("service: complete", step(steps.complete), "writing the container");
    row("service: download", step(steps.download), "fetching and checking it");
    row("encoding in all", seconds(s.total), "");
    row("decoding in all", seconds(decode_seconds), "coordinates and writing decoded.npy included");
    rows
}

/// The rows, and where the page is, if there is one.
fn table(rows: &[Row], page: Option<&PathBuf>) -> Result<String> {
    let mut out = String::new();
    for Row { name, value, note } in rows {
        writeln!(out, "  {name:<24}{value:>14}   {note}")?;
    }
    writeln!(out, "All went through a real service over HTTP: started for it on this machine, and stopped again.")?;
    writeln!(out, "Decoded again and measured anew: the errors are those of the report.")?;
    match page {
        Some(page) => writeln!(
            out,
            "Open {} in a browser: the errors of every frame, and the model moving in its cage.",
            page.display()
        )?,
        None => writeln!(out, "There is no report.html, since {NO_PAGE}.")?,
    }
    Ok(out)
}
