//! Summary and report of `cager encode`.

use super::cage::judged;
use super::{counted, grouped, human_bytes, is_verbose};
use anyhow::Result;
use cager_formats::AtomicFile;
use cager_proto::report::{Errors, Report, json_file};
use serde::Serialize;
use std::io::Write;
use std::path::Path;

pub(super) fn write_report(mut file: AtomicFile, report: &impl Serialize) -> Result<AtomicFile> {
    file.write_all(&json_file(report)?)?;
    Ok(file)
}

pub(super) fn summary(report: &Report, output: &Path) -> String {
    let chosen = report.spectrum_choice.as_ref().map_or_else(String::new, |choice| {
        format!(
            "  chosen  spectrum {}: L2 {:.2} % above that of 0 on {} frames, at most {:.2} % allowed\n",
            report.spectrum,
            100.0 * choice.extra,
            choice.frames,
            100.0 * choice.bound
        )
    });
    let refined = report.refinement.as_ref().map_or_else(String::new, |refined| {
        format!(
            "  solved  on {} boundary elements, {} times refined; coordinates are off by {:.1e} at most, about\n",
            refined.elements, refined.refinements, refined.change
        )
    });
    let worst = report.error.worst.map_or_else(String::new, |worst| {
        let point = worst.point.map_or_else(String::new, |point| format!("point {point} of "));
        let number = report.frame_numbers.get(worst.frame).filter(|&&number| number != worst.frame as f64);
        let number = number.map_or_else(String::new, |number| format!(" ({number} in its capture)"));
        format!(
            "  worst   {point}frame {}{number}: off by {} where the rest pose is {} across\n",
            worst.frame,
            significant(worst.distance),
            significant(report.diagonal)
        )
    });
    let alone = if report.coding.is_none() {
        "  cages   only, no error limit; --max-error 0.001 keeps every point within 0.1 % of the diagonal, usually in \
         a smaller file\n"
    } else {
        ""
    };
    let again = match &report.design {
        Some(design) if output.as_os_str() != "-" => format!(
            "  cage    designed, {}; for more takes of this model pass --cage {}\n",
            judged(design),
            output.display()
        ),
        _ => String::new(),
    };
    let s = &report.seconds;
    let designed = if s.design > 0.0 { format!(", {:.3} s of it for the cage", s.design) } else { String::new() };
    let steps = if is_verbose() {
        format!(
            "  steps   read {:.3} s, cage {:.3} s, coordinates {:.3} s, handles {:.3} s, SVD {:.3} s, inversion {:.3} \
             s, errors {:.3} s, coding {:.3} s, writing {:.3} s\n",
            s.read, s.design, s.coordinates, s.maxvol, s.svd, s.invert, s.measure, s.code, s.write
        )
    } else {
        String::new()
    };
    format!(
        "{}: {} of {} as cages of {} vertices\n\
         \x20 size    {} from {}: {:.1} times smaller, {:.2} bits per point and frame\n\
         \x20 error   {}\n{worst}{alone}\
         \x20 system  condition {:.1} (all points {:.1}), rank {} of {}, affine reproduction {:.1e}\n\
         {refined}{chosen}{again}\x20 time    {:.3} s{designed}\n{steps}",
        output.display(),
        counted(report.frames, "frame"),
        counted(report.points, "point"),
        grouped(report.cage_vertices),
        human_bytes(report.bytes.output),
        human_bytes(report.bytes.capture),
        report.bytes.ratio,
        report.bytes.bits_per_vertex_per_frame,
        errors(&report.error),
        report.condition_number.handles,
        report.condition_number.full,
        report.rank,
        report.unknowns,
        report.affine_reproduction_error,
        report.seconds.total,
    )
}

/// The errors of a capture in one line.
pub(super) fn errors(e: &Errors) -> String {
    format!(
        "L2 {:.4} % mean, {:.4} % max; L∞ {:.3} % mean, {:.3} % max (of the rest diagonal); KG {:.3} %",
        100.0 * e.l2_mean,
        100.0 * e.l2_max,
        100.0 * e.linf_mean,
        100.0 * e.linf_max,
        e.kg_percent
    )
}

/// A length to three digits.
fn significant(length: f64) -> String {
    if length == 0.0 || !length.is_finite() {
        return length.to_string();
    }
    let digits = 2 - length.abs().log10().floor() as i32;
    if (0..=8).contains(&digits) {
        format!("{length:.*}", digits as usize)
    } else if digits < 0 && digits > -8 {
        format!("{length:.0}")
    } else {
        format!("{length:.2e}")
    }
}
