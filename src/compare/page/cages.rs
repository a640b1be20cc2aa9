//! Stability of the cages.

use super::SystemSection;
use super::parts::{Html, Table, coloured, percent, scale};
use crate::compare::figures::{Figures, MethodFigures, SystemFigures};
use crate::compare::render::Ramp;
use crate::plot::{Axis, AxisRange, Chart, Mark, Series};
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;

/// Spikes and edges, per method and threshold.
pub(super) fn section(html: &mut Html, figures: &Figures, systems: &[SystemSection<'_>]) {
    html.section("cages", "Stability of the cages");
    html.paragraph("A good cage moves as smoothly as the model. The second difference in time, |C(t+1) − 2 C(t) + C(t−1)|, is what the eye sees as shaking: its mean over vertices and frames measures how much a cage jitters, its largest value the worst spike. The change of the cage's edges against the rest cage measures how far it has lost its shape.");
    for (name, found, pictures) in systems {
        html.heading(name);
        html.plots(
            &[
                by_threshold(name, found, "mean spike", "mean second difference, %", |m| m.totals.spike_mean),
                by_threshold(name, found, "largest spike", "largest second difference, %", |m| m.totals.spike_max),
                by_threshold(name, found, "edges", "mean change of edges, %", |m| m.totals.edges_mean),
                error_and_jitter(name, found, figures.capture.motion_mean),
                over_time(name, found, &figures.capture.measured),
            ],
            "How smoothly the cages move, and what it costs.",
            "The first three over the spectrum threshold s, for every choice of points read; global regularisation has no threshold and is a level line. Then every method by its error and its jitter, both better towards the lower left corner, with the model's own mean as a line; and the largest spike of every frame. Axes need not begin at zero.",
            "Paper: Figs. 8, 12, 13, 19 and 20.",
        );
        html.table(&table(found, figures));
        html.pictures(
            &pictures.cages,
            &scale("0", &format!("{} % and more", percent(pictures.cages_top, 2)), &Ramp::css()),
            &format!("Cages of frame {}, coloured by each vertex's second difference in time.", figures.capture.shown),
            "It is the frame of plain least squares' largest spike, and all pictures have the same view and scale. Spikes that reach beyond the picture are cut off.",
            "Paper: Figs. 8, 13, 18, 19 and 20.",
        );
    }
}

fn by_threshold(
    name: &str,
    found: &SystemFigures,
    title: &str,
    label: &str,
    value: fn(&MethodFigures) -> f64,
) -> Chart {
    let mut series = Vec::new();
    let largest = found.methods.iter().map(|m| m.method.spectrum).max().unwrap_or(0) as f64;
    for handles in [Handles::All, Handles::MaxVol] {
        let of = |m: &&MethodFigures| m.method.handles == handles;
        let sub: Vec<&MethodFigures> = found
            .methods
            .iter()
            .filter(of)
            .filter(|m| matches!(m.method.regularizer, Regularizer::None | Regularizer::Laplacian))
            .collect();
        let points = sub.iter().map(|m| (m.method.spectrum as f64, 100.0 * value(m))).collect();
        let class = sub.last().map_or("k-other", |m| m.method.class);
        series.push(Series { label: format!("{}, sub-spectral", handles.name()), class, mark: Mark::Line, points });
        for m in found.methods.iter().filter(of).filter(|m| m.method.regularizer == Regularizer::Global) {
            let points = vec![(0.0, 100.0 * value(m)), (largest, 100.0 * value(m))];
            let label = format!("{}, global", handles.name());
            series.push(Series { label, class: m.method.class, mark: Mark::Dashes, points });
        }
    }
    Chart {
        title: format!("{name}: {title}"),
        x: Axis::counting("spectrum threshold s"),
        y: Axis::new(label, AxisRange::Around),
        series,
    }
}

fn error_and_jitter(name: &str, found: &SystemFigures, motion: f64) -> Chart {
    let mut series: Vec<Series> = Vec::new();
    for m in &found.methods {
        let point = (100.0 * m.totals.l2_mean, 100.0 * m.totals.spike_mean);
        match series.iter_mut().find(|s| s.class == m.method.class) {
            Some(same) => same.points.push(point),
            None => {
                let mark = if m.method.is_cager() { Mark::Diamonds } else { Mark::Dots };
                series.push(Series { label: m.method.family(), class: m.method.class, mark, points: vec![point] });
            }
        }
    }
    let ends = series.iter().flat_map(|s| &s.points).map(|p| p.0).filter(|x| x.is_finite());
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let points = vec![(low, 100.0 * motion), (high, 100.0 * motion)];
    series.push(Series { label: "the model itself".to_owned(), class: "k-random", mark: Mark::Dashes, points });
    Chart {
        title: format!("{name}: error and jitter"),
        x: Axis::new("mean L2, %", AxisRange::Around),
        y: Axis::new("mean second difference, %", AxisRange::Around),
        series,
    }
}

fn over_time(name: &str, found: &SystemFigures, measured: &[usize]) -> Chart {
    let series = found.methods.iter().filter(|m| m.method.curve).map(|m| Series {
        label: m.method.name(),
        class: m.method.class,
        mark: if m.method.is_dashed() { Mark::Dashes } else { Mark::Line },
        points: measured.iter().zip(&m.per_frame.spike_max).map(|(&t, x)| (t as f64, 100.0 * x)).collect(),
    });
    Chart {
        title: format!("{name}: largest spike"),
        x: Axis::counting("frame"),
        y: Axis::new("largest second difference, %", AxisRange::Logarithmic),
        series: series.collect(),
    }
}

fn table(found: &SystemFigures, figures: &Figures) -> Table {
    let mut table = Table::new(
        &["method", "mean spike %", "largest spike %", "edges: mean change %", "edges: largest %", "mean L2 %"],
        1,
    );
    for m in &found.methods {
        let t = &m.totals;
        table.row(vec![
            coloured(m.method.class, &m.method.name()),
            percent(t.spike_mean, 4),
            percent(t.spike_max, 3),
            percent(t.edges_mean, 2),
            percent(t.edges_max, 1),
            percent(t.l2_mean, 4),
        ]);
    }
    let capture = &figures.capture;
    let none = || "–".to_owned();
    table.row_of(
        "paper",
        vec![
            coloured("k-random", "the model's own points"),
            percent(capture.motion_mean, 4),
            percent(capture.motion_max, 3),
            none(),
            none(),
            none(),
        ],
    );
    table
}
