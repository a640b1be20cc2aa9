//! `cager inspect`.

use super::args::InspectArgs;
use super::{grouped, human_bytes, plain, print, warn};
use crate::decode::{self, Container, DecodeError};
use crate::report::{FrameError, WorstError};
use crate::timing::counted_from_zero;
use anyhow::Result;
use cager_core::mesh::diagonal;
use cager_formats::missing_frames;
use cager_proto::container::Summary;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;

pub(super) fn run(args: &InspectArgs) -> Result<()> {
    let mut container = decode::open(&args.input)?;
    let fail = |cause| DecodeError::container(&args.input, cause);
    container.verify().map_err(fail)?;
    let summary = container.summary().map_err(fail)?;
    let errors = container.errors().map_err(fail)?;
    let numbers = container.frame_numbers().map_err(fail)?;
    let bytes = std::fs::metadata(&args.input)?.len();
    if args.json {
        let per_frame: Vec<FrameError> =
            errors.iter().map(|e| FrameError { l2: e.l2.into(), linf: e.linf.into() }).collect();
        let diagonal = diagonal(&container.rest().map_err(fail)?.points);
        let value = as_json(&container, summary.as_ref(), &numbers, (diagonal, &per_frame), bytes);
        return print(&format!("{}\n", serde_json::to_string_pretty(&value)?));
    }
    warn(summary.as_ref().map_or(&[], |s| &s.warnings));
    print(&as_text(&args.input.display().to_string(), &container, summary.as_ref(), &numbers, bytes)?)
}

/// The keys of `report.json`, less the times and plus the sections.
fn as_json(
    container: &Container,
    summary: Option<&Summary>,
    numbers: &[f64],
    (diagonal, per_frame): (f64, &[FrameError]),
    bytes: u64,
) -> Value {
    let h = container.header();
    let mut out = Map::new();
    let mut put = |key: &str, value: Value| out.insert(key.to_owned(), value);
    put("points", json!(h.points));
    put("frames", json!(container.frames()));
    if !counted_from_zero(numbers) {
        put("frame_numbers", json!(numbers));
    }
    if let Some(rate) = h.frame_rate {
        put("frame_rate", json!(rate));
    }
    put("diagonal", json!(diagonal));
    put("unknowns", json!(h.rows_per_frame));
    put("cage_vertices", json!(h.cage_vertices));
    put("cage_faces", json!(h.cage_faces));
    put("coordinates", json!(h.coordinates));
    put("handles", json!(h.handles));
    put("regularizer", json!(h.regularizer));
    put("spectrum", json!(h.spectrum));
    put("lambda", json!(h.lambda));
    let mut error = Map::new();
    if let Some(s) = summary {
        put("generator", json!(s.generator));
        put("triangles", json!(s.triangles));
        put("affine_reproduction_error", json!(s.affine_reproduction_error));
        put("condition_number", json!(s.condition_number));
        put("rank", json!(s.rank));
        put("singular_values", json!(s.singular_values));
        put("maxvol", json!(s.maxvol));
        put("handle_indices", json!(s.handle_indices));
        put("warnings", json!(s.warnings));
        let frames = (h.points * container.frames() as u64) as f64;
        put(
            "bytes",
            json!({
                "capture": s.capture_bytes,
                "output": bytes,
                "ratio": s.capture_bytes as f64 / bytes as f64,
                "bits_per_vertex_per_frame": 8.0 * bytes as f64 / frames,
            }),
        );
        if let Value::Object(map) = json!(s.error) {
            error = map;
        }
    } else {
        put("bytes", json!({ "output": bytes }));
    }
    if let Some(worst) = WorstError::of_frames(per_frame, diagonal) {
        error.insert("worst".to_owned(), json!(worst));
    }
    error.insert("per_frame".to_owned(), json!(per_frame));
    put("error", Value::Object(error));
    let sections: Vec<Value> = sections(container)
        .into_iter()
        .map(|(tag, s)| json!({ "tag": tag, "count": s.count, "bytes": s.bytes, "raw_bytes": s.raw_bytes }))
        .collect();
    put("sections", Value::Array(sections));
    Value::Object(out)
}

#[derive(Default)]
struct Sizes {
    order: usize,
    count: usize,
    bytes: u64,
    raw_bytes: u64,
}

/// Sections of one kind added up, in the order of the file.
fn sections(container: &Container) -> Vec<(String, Sizes)> {
    let mut kinds: BTreeMap<String, Sizes> = BTreeMap::new();
    for (order, section) in container.sections().into_iter().enumerate() {
        let sizes = kinds.entry(section.tag).or_insert_with(|| Sizes { order, ..Sizes::default() });
        sizes.count += 1;
        sizes.bytes += section.bytes;
        sizes.raw_bytes += section.raw_bytes;
    }
    let mut kinds: Vec<_> = kinds.into_iter().collect();
    kinds.sort_by_key(|(_, sizes)| sizes.order);
    kinds
}

fn as_text(
    name: &str,
    container: &Container,
    summary: Option<&Summary>,
    numbers: &[f64],
    bytes: u64,
) -> Result<String> {
    let h = container.header();
    let mut out = String::new();
    writeln!(out, "{name}: {}, every checksum matches", human_bytes(bytes))?;
    writeln!(out, "  capture   {} frames of {} points", grouped(container.frames() as u64), grouped(h.points))?;
    let rate = h.frame_rate.map(|rate| format!(", {rate} frames per second")).unwrap_or_default();
    if let ([first, .., last] | [first @ last], false) = (numbers, counted_from_zero(numbers) && rate.is_empty()) {
        let gaps = missing_frames(numbers).map(|missing| format!(" without {missing}")).unwrap_or_default();
        writeln!(out, "  numbers   {first} to {last}{gaps}{rate}")?;
    }
    writeln!(out, "  cage      {} vertices, {} faces", grouped(h.cage_vertices), grouped(h.cage_faces))?;
    // How many of them is known where not every point is read.
    let read = summary.filter(|_| h.handles != "all").map(|s| format!(" ({})", s.handle_indices.len()));
    writeln!(
        out,
        "  solver    coordinates {}, handles {}{}, regularizer {}, spectrum {}, lambda {}",
        plain(&h.coordinates),
        plain(&h.handles),
        read.unwrap_or_default(),
        plain(&h.regularizer),
        h.spectrum,
        h.lambda
    )?;
    if let Some(s) = summary {
        let e = &s.error;
        writeln!(out, "  written   by {}", plain(&s.generator))?;
        writeln!(
            out,
            "  size      {:.1} times smaller than {}",
            s.capture_bytes as f64 / bytes as f64,
            human_bytes(s.capture_bytes)
        )?;
        if e.l2_mean.is_nan() {
            writeln!(out, "  error     not measured, or not of every frame (--json has those that are)")?;
        } else {
            writeln!(
                out,
                "  error     L2 {:.4} % mean, {:.4} % max; L∞ {:.3} % mean, {:.3} % max (of the rest diagonal); KG {:.3} %",
                100.0 * e.l2_mean,
                100.0 * e.l2_max,
                100.0 * e.linf_mean,
                100.0 * e.linf_max,
                e.kg_percent
            )?;
        }
        let (first, last) =
            (s.singular_values.first().copied().unwrap_or(0.0), s.singular_values.last().copied().unwrap_or(0.0));
        writeln!(
            out,
            "  spectrum  {:.4} … {:.4e}, rank {} of {}; condition {:.1} (all points {:.1})",
            first, last, s.rank, h.rows_per_frame, s.condition_number.handles, s.condition_number.full
        )?;
    }
    writeln!(out, "  sections  {:<6}{:>8}{:>12}{:>12}", "tag", "number", "stored", "decoded")?;
    for (tag, s) in sections(container) {
        writeln!(
            out,
            "            {tag:<6}{:>8}{:>12}{:>12}",
            s.count,
            human_bytes(s.bytes),
            human_bytes(s.raw_bytes)
        )?;
    }
    Ok(out)
}
