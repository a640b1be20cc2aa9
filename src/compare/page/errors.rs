//! Errors of the model: per frame, per method, and with noise.

use super::SystemSection;
use super::parts::{Html, Table, coloured, percent, scale};
use crate::compare::figures::{Figures, MethodFigures, SystemFigures};
use crate::compare::methods::Method;
use crate::compare::render::Ramp;
use crate::plot::{Axis, AxisRange, Chart, Mark, Series};

/// The error curves and their table.
pub(super) fn section(html: &mut Html, figures: &Figures, systems: &[SystemSection<'_>]) {
    html.section("errors", "Errors of the reconstructed model");
    for (name, found, pictures) in systems {
        html.heading(name);
        let charts = [("L2", "L2, %", false), ("L∞", "L∞, %", true)].map(|(title, label, linf)| Chart {
            title: format!("{name}: {title}"),
            x: Axis::counting("frame"),
            y: Axis::new(label, AxisRange::FromZero),
            series: found
                .methods
                .iter()
                .filter(|m| m.method.curve)
                .map(|m| curve(m, &figures.capture.measured, linf))
                .collect(),
        });
        html.plots(
            &charts,
            "Error of every measured frame, by method.",
            "L2 is the root mean square over the model's points, L∞ the largest distance of a point, both in percent of the rest diagonal. Lower is better; a method whose curve lies close to “all points, data alone” loses little to what any cage of this system could reach, if the system is linear: with green, whose cages are iterated for, other methods may come lower than it. Dashed lines are regularised over the whole spectrum or damped.",
            "Paper: Figs. 14 and 18.",
        );
        html.table(&table(found));
        html.pictures(
            &pictures.models,
            &scale("0", &format!("{} % and more", percent(pictures.models_top, 2)), &Ramp::css()),
            &format!("Frame {} reconstructed, coloured by the distance of every point from the capture.", figures.capture.shown),
            "It is the frame in which the cage of plain least squares spikes most. One scale for all pictures of the row but for the first, whose points were drawn at random and whose errors may be off the scale.",
            "Paper: Figs. 3, 10 and 18.",
        );
        html.pictures(
            &pictures.row,
            "",
            "The capture as the paper's method encodes it.",
            "Maxvol handles with sub-spectral regularisation at the usual threshold: the reconstructed model, and its cage around it.",
            "Paper: Fig. 14.",
        );
        html.folded("Every frame in numbers", &frames(found, &figures.capture.measured));
    }
}

fn curve(found: &MethodFigures, measured: &[usize], linf: bool) -> Series {
    let values = if linf { &found.per_frame.linf } else { &found.per_frame.l2 };
    series(&found.method, found.method.name(), measured, values)
}

fn series(method: &Method, label: String, measured: &[usize], values: &[f64]) -> Series {
    let points = measured.iter().zip(values).map(|(&frame, x)| (frame as f64, 100.0 * x)).collect();
    Series { label, class: method.class, mark: if method.is_dashed() { Mark::Dashes } else { Mark::Line }, points }
}

fn table(found: &SystemFigures) -> Table {
    let mut table =
        Table::new(&["method", "mean L2 %", "largest L2 %", "mean L∞ %", "largest L∞ %", "mean L2 over the least"], 1);
    let least = found.methods.iter().map(|m| m.totals.l2_mean).fold(f64::INFINITY, f64::min);
    for m in &found.methods {
        let t = &m.totals;
        table.row(vec![
            coloured(m.method.class, &m.method.name()),
            percent(t.l2_mean, 4),
            percent(t.l2_max, 4),
            percent(t.linf_mean, 3),
            percent(t.linf_max, 3),
            format!("{:.2} ×", t.l2_mean / least),
        ]);
    }
    table
}

fn frames(found: &SystemFigures, measured: &[usize]) -> Table {
    let curves: Vec<&MethodFigures> = found.methods.iter().filter(|m| m.method.curve).collect();
    let names: Vec<String> =
        curves.iter().map(|m| format!("{}<br/>L2 %, L∞ %", crate::plot::escaped(&m.method.name()))).collect();
    let headers: Vec<&str> = std::iter::once("frame").chain(names.iter().map(String::as_str)).collect();
    let mut table = Table::new(&headers, 0);
    for (k, frame) in measured.iter().enumerate() {
        let cell =
            |m: &&MethodFigures| format!("{}, {}", percent(m.per_frame.l2[k], 3), percent(m.per_frame.linf[k], 2));
        table.row(std::iter::once(frame.to_string()).chain(curves.iter().map(cell)).collect());
    }
    table
}

/// The noise test.
pub(super) fn noise(html: &mut Html, figures: &Figures, systems: &[SystemSection<'_>]) {
    html.section("noise", "Noise on the capture");
    let radius = percent(figures.capture.noise_radius, 1);
    let measured = &figures.capture.measured;
    let mut charts = Vec::new();
    let mut table = Table::new(
        &[
            "system",
            "method",
            "mean L2 %",
            "without",
            "largest L∞ %",
            "without",
            "rise",
            "mean L2 to clean %",
            "mean spike %",
            "without",
        ],
        2,
    );
    for (name, found, _) in systems {
        let mut lines = Vec::new();
        for noisy in &found.noise {
            let Some(clean) = found.method(|m| *m == noisy.method) else { continue };
            table.row(vec![
                (*name).to_owned(),
                coloured(noisy.method.class, &noisy.method.name()),
                percent(noisy.totals.l2_mean, 4),
                percent(clean.totals.l2_mean, 4),
                percent(noisy.totals.linf_max, 3),
                percent(clean.totals.linf_max, 3),
                percent(noisy.totals.linf_max - clean.totals.linf_max, 3),
                percent(noisy.clean_l2_mean, 4),
                percent(noisy.totals.spike_mean, 4),
                percent(clean.totals.spike_mean, 4),
            ]);
            if noisy.method.is_cager() || noisy.method.is_full_least_squares() {
                let label = noisy.method.name();
                lines.push(series(&noisy.method, format!("{label}, noise"), measured, &noisy.per_frame.linf));
                let plain = series(&clean.method, label, measured, &clean.per_frame.linf);
                lines.push(Series { mark: Mark::Dashes, ..plain });
            }
        }
        charts.push(Chart {
            title: format!("{name}: L∞"),
            x: Axis::counting("frame"),
            y: Axis::new("L∞, %", AxisRange::FromZero),
            series: lines,
        });
    }
    html.plots(
        &charts,
        &format!("L∞ of every frame with and without noise of {radius} %."),
        &format!("Every point of every frame is displaced at random, evenly within a ball whose radius is {radius} % of the rest diagonal. Solid lines: error against the noisy capture, as in the paper; dashed: the capture as it is. The curves should keep their course and rise by about the radius."),
        "Paper: Fig. 16.",
    );
    html.table(&table);
    html.paragraph("“To clean” is the error against the capture without noise: where it is below the error against the noisy one, the cage has filtered noise out.");
}
