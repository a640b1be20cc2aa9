//! Singular values.

use super::SystemSection;
use super::parts::{Html, Table, condition, number};
use crate::plot::{Axis, AxisRange, Chart, Mark, Series};

/// Spectra of all systems.
pub(super) fn section(html: &mut Html, systems: &[SystemSection<'_>]) {
    html.section("spectra", "Spectra of the coordinate matrices");
    let mut charts = Vec::new();
    let mut table = Table::new(
        &["system", "matrix", "condition", "σ first", "σ at ¼", "σ at ½", "σ at ¾", "σ last", "last over first"],
        2,
    );
    for (name, found, _) in systems {
        let squares: Vec<f64> = found.spectra.full.iter().map(|s| s * s).collect();
        let spectra = [
            ("Φ□ (maxvol)", "k-cager", &found.spectra.handles, found.spectra.condition_handles),
            ("Φ (all points)", "k-all", &found.spectra.full, found.spectra.condition_full),
            ("ΦᵀΦ (normal equations)", "k-normal", &squares, found.spectra.condition_normal),
        ];
        let line = |values: &[f64], from: usize| -> Vec<(f64, f64)> {
            let top = values.first().copied().unwrap_or(1.0);
            values.iter().enumerate().skip(from).map(|(k, s)| ((k + 1) as f64, s / top)).collect()
        };
        let chart = |title: String, from: usize, cover: AxisRange| Chart {
            title,
            x: Axis::counting("singular value number"),
            y: Axis::new("over the largest", cover),
            series: spectra
                .iter()
                .map(|(label, class, values, _)| Series {
                    label: (*label).to_owned(),
                    class,
                    mark: Mark::Line,
                    points: line(values, from),
                })
                .collect(),
        };
        charts.push(chart(format!("{name}: whole spectrum"), 0, AxisRange::Logarithmic));
        charts.push(chart(format!("{name}: last fifth"), found.unknowns * 4 / 5, AxisRange::FromZero));
        for (label, class, values, cond) in spectra {
            let at = |part: f64| values.get(((values.len() - 1) as f64 * part) as usize).map_or(f64::NAN, |s| *s);
            let cells = [0.0, 0.25, 0.5, 0.75, 1.0].map(|part| value(at(part)));
            let mut row = vec![(*name).to_owned(), super::parts::coloured(class, label), condition(cond)];
            row.extend(cells);
            row.push(value(at(1.0) / at(0.0)));
            table.row(row);
        }
    }
    html.plots(
        &charts,
        "Singular values over the largest one, for the maxvol handles Φ□, for all points Φ, and for the normal equations ΦᵀΦ.",
        "A perturbation of the capture along a direction is amplified by the inverse of its singular value, so a curve that stays high to the right end means stable cages. The last fifth is where the differences are; each curve's last value is the inverse of its condition number.",
        "Paper: Figs. 6 and 9.",
    );
    html.table(&table);
}

/// Four significant digits, or a power of ten where the number is small.
fn value(x: f64) -> String {
    if x < 1e-3 { format!("{x:.3e}") } else { number(x, 4) }
}
