//! Singular vectors on the cage.

use super::SystemSection;
use super::parts::{Html, Table, number, scale};
use crate::compare::render::diverging_css;
use crate::plot::{Axis, AxisRange, Chart, Mark, Series};

/// Where singular vectors live.
pub(super) fn section(html: &mut Html, systems: &[SystemSection<'_>]) {
    html.section("vectors", "Singular vectors on the cage");
    for (name, _, pictures) in systems {
        html.pictures(
            &pictures.vectors,
            &scale("largest negative", "largest positive", &diverging_css()),
            &format!("{name}: a few of the first and the last right singular vectors of Φ□, painted on the rest cage."),
            "Each has its own scale about zero. The first move the whole cage, and the points say clearly how far; the last are concentrated on a few vertices that hardly influence any point, so smoothing them costs little accuracy. (Of systems with unknowns on faces, the vertices' part is shown.)",
            "Paper: Figs. 11 and 15.",
        );
    }
    let mut table = Table::new(&["system", "vector", "singular value", "lives on so many unknowns"], 1);
    for (name, found, _) in systems {
        for &k in &found.vectors.painted {
            let sigma = found.spectra.handles.get(k).copied().unwrap_or(f64::NAN);
            table.row(vec![
                (*name).to_owned(),
                format!("{} of {}", k + 1, found.unknowns),
                number(sigma, 4),
                number(found.vectors.spread[k], 1),
            ]);
        }
    }
    let charts: Vec<Chart> = systems
        .iter()
        .map(|(name, found, _)| Chart {
            title: format!("{name}: how widely vectors are spread"),
            x: Axis::counting("singular vector number"),
            y: Axis::new("unknowns it lives on", AxisRange::FromZero),
            series: vec![Series {
                label: String::new(),
                class: "k-cager",
                mark: Mark::Line,
                points: found.vectors.spread.iter().enumerate().map(|(k, s)| ((k + 1) as f64, *s)).collect(),
            }],
        })
        .collect();
    html.plots(
        &charts,
        "The number of unknowns on which each right singular vector of Φ□ lives.",
        "Measured by 1 / Σ v⁴: all unknowns for a vector spread evenly, one for a vector on a single unknown. Where the curve is low at the right end, regularising the last directions acts locally.",
        "Paper: Figs. 11 and 15, as a measure.",
    );
    html.table(&table);
}
