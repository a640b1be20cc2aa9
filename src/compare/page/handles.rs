//! How handles are found, compared with other choices.

use super::SystemSection;
use super::parts::{Html, Table, coloured, condition, number, percent};
use crate::compare::figures::{DRAW_FRAMES, SwapTrace};
use crate::plot::{Axis, AxisRange, Chart, Mark, Series};
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;

/// Volume and condition number over the swaps.
pub(super) fn swaps(html: &mut Html, systems: &[SystemSection<'_>]) {
    html.section("swaps", "Maxvol, swap by swap");
    let mut charts = Vec::new();
    let mut shots = Vec::new();
    let mut table =
        Table::new(&["system", "start", "points", "swaps", "ln volume first", "last", "condition first", "last"], 2);
    for (name, found, pictures) in systems {
        let traces = [
            ("pivoted LU", "k-cager", Some(&found.swaps.from_lu)),
            ("LU of a few drawn points", "k-all", found.swaps.from_random.as_ref()),
        ];
        let chart = |title: &str, label: &str, cover: AxisRange, points: fn(&SwapTrace) -> Vec<(f64, f64)>| Chart {
            title: format!("{name}: {title}"),
            x: Axis::counting("swaps"),
            y: Axis::new(label, cover),
            series: traces
                .iter()
                .filter_map(|(label, class, trace)| {
                    let label = format!("from {label}");
                    Some(Series { label, class, mark: Mark::Line, points: points((*trace)?) })
                })
                .collect(),
        };
        charts.push(chart("volume", "ln |det Φ□|", AxisRange::Around, |t| {
            t.log_volume.iter().enumerate().map(|(k, v)| (k as f64, *v)).collect()
        }));
        charts.push(chart("condition number", "condition number of Φ□", AxisRange::Logarithmic, |t| {
            t.after.iter().zip(&t.condition).map(|(&k, c)| (k as f64, *c)).collect()
        }));
        for (label, class, trace) in traces {
            let Some(trace) = trace else { continue };
            let ends =
                |values: &[f64]| [values.first().copied(), values.last().copied()].map(|x| x.unwrap_or(f64::NAN));
            let (volume, cond) = (ends(&trace.log_volume), ends(&trace.condition));
            table.row(vec![
                (*name).to_owned(),
                coloured(class, label),
                trace.points.to_string(),
                trace.swaps().to_string(),
                number(volume[0], 2),
                number(volume[1], 2),
                condition(cond[0]),
                condition(cond[1]),
            ]);
        }
        shots.push(pictures);
    }
    html.plots(
        &charts,
        "Volume and condition number of the handles' matrix Φ□ after every swap.",
        "The search starts from the rows that LU with partial pivoting picks, which is close to the end, or from those that LU picks among a few points drawn at random, which is farther away, as the paper's start is. Each swap multiplies the volume by the entry of B that called for it; it ends where no entry exceeds 1.01, or 2 from 1,536 columns on. Volume should only rise; the condition number need not fall at each swap, but does in the long run.",
        "Paper: Fig. 4.",
    );
    html.table(&table);
    for ((name, _, _), pictures) in systems.iter().zip(shots) {
        html.pictures(
            std::slice::from_ref(&pictures.handles),
            "",
            &format!("{name}: the handles (green) on the rest pose in its cage."),
            "They gather where the cage is fine and at what sticks out: fingertips, ears, edges.",
            "Paper: Figs. 4, 7 and 9.",
        );
    }
}

/// Random handles against those of maximum volume.
pub(super) fn random(html: &mut Html, systems: &[SystemSection<'_>]) {
    html.section("random", "Random handles against maxvol");
    let mut charts = Vec::new();
    let mut table = Table::new(
        &[
            "system",
            "handles",
            "rank",
            "condition",
            "mean L2 %",
            "largest L∞ %",
            "mean spike %",
            "data alone: mean L2 %",
        ],
        2,
    );
    for (name, found, _) in systems {
        let mut random = Vec::new();
        let mut start = Vec::new();
        for draw in &found.random {
            let point = (draw.condition, 100.0 * draw.totals.l2_mean);
            let lu = !draw.choice.starts_with("random");
            if lu { &mut start } else { &mut random }.push(point);
            let class = if lu { "k-maxvol" } else { "k-random" };
            table.row(vec![
                (*name).to_owned(),
                coloured(class, &draw.choice),
                draw.rank.to_string(),
                condition(draw.condition),
                percent(draw.totals.l2_mean, 4),
                percent(draw.totals.linf_max, 2),
                percent(draw.totals.spike_mean, 4),
                large(draw.data_alone.l2_mean),
            ]);
        }
        let mut series = vec![
            Series { label: "drawn at random".to_owned(), class: "k-random", mark: Mark::Dots, points: random },
            Series { label: "start of maxvol (LU)".to_owned(), class: "k-maxvol", mark: Mark::Dots, points: start },
        ];
        let plain = |handles: Handles| found.method(|m| m.handles == handles && m.regularizer == Regularizer::None);
        let usual = |handles: Handles| {
            found.method(|m| m.handles == handles && m.regularizer == Regularizer::Laplacian && m.curve)
        };
        for (handles, label, class, cond) in [
            (Handles::MaxVol, "maxvol", "k-cager", found.spectra.condition_handles),
            (Handles::All, "all points", "k-all", found.spectra.condition_full),
        ] {
            let (Some(m), Some(alone)) = (usual(handles), plain(handles)) else { continue };
            let points = vec![(cond, 100.0 * m.totals.l2_mean)];
            series.push(Series { label: label.to_owned(), class, mark: Mark::Diamonds, points });
            table.row(vec![
                (*name).to_owned(),
                coloured(class, label),
                found.rank.to_string(),
                condition(cond),
                percent(m.totals.l2_mean, 4),
                percent(m.totals.linf_max, 2),
                percent(m.totals.spike_mean, 4),
                large(alone.totals.l2_mean),
            ]);
        }
        charts.push(Chart {
            title: format!("{name}: error and condition number"),
            x: Axis::new("condition number", AxisRange::Logarithmic),
            y: Axis::new("mean L2, %", AxisRange::Logarithmic),
            series,
        });
    }
    html.plots(
        &charts,
        "Ten draws of as many points as unknowns, the rows maxvol starts from, maxvol, and all points, each with sub-spectral regularisation at the usual threshold.",
        &format!("One dot for each choice of handles: to the right the less stable, upwards the less accurate ones. Points drawn at random often lie so close together that their rows are dependent; without regularisation they reconstruct nothing at all (last column). What a draw looks like is the first picture under “Errors of the reconstructed model”. With green coordinates, where every inversion iterates, the draws and the start of maxvol are measured at {DRAW_FRAMES} frames only."),
        "Paper: Fig. 3.",
    );
    html.table(&table);
}

/// An error in percent that may be of any size.
fn large(fraction: f64) -> String {
    if fraction < 1.0 { percent(fraction, 4) } else { number_of(100.0 * fraction) }
}

fn number_of(value: f64) -> String {
    if value.is_finite() { format!("{value:.1e}") } else { "–".to_owned() }
}
