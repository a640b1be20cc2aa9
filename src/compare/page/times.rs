//! Times, in the form of the paper's Table 1.

use super::SystemSection;
use super::parts::{Html, Table, coloured, percent, seconds};
use crate::compare::figures::Figures;
use crate::plot::{escaped, grouped};

/// A row of the paper's Table 1: points, cage, frames, preparation, one frame, total (all in milliseconds), and where the
/// text gives it, the mean L2 (in 1e-2).
type PaperRow = (&'static str, usize, &'static str, usize, usize, usize, usize, &'static str);

const PAPER: [PaperRow; 5] = [
    ("Fig. 14, 1st row (capoeira)", 19_998, "330 / 656", 499, 5_616, 568, 289_048, "0.12"),
    ("Fig. 14, 2nd row", 19_998, "330 / 656", 179, 5_616, 568, 107_288, "–"),
    ("Fig. 14, 3rd row (skirt)", 19_990, "368 / 732", 437, 7_291, 890, 396_221, "–"),
    ("Fig. 14, 4th row", 15_002, "339 / 674", 169, 5_617, 624, 111_073, "–"),
    ("Fig. 14, 5th row (horse)", 8_431, "348 / 692", 48, 5_029, 748, 40_933, "0.19"),
];

/// The table.
pub(super) fn section(html: &mut Html, figures: &Figures, systems: &[SystemSection<'_>]) {
    html.section("times", "Times");
    let capture = &figures.capture;
    let mut table = Table::new(
        &[
            "input",
            "points",
            "cage #V / #T",
            "frames",
            "coordinates",
            "maxvol + SVD",
            "one frame",
            "inverting all",
            "mean L2 %",
            "mean L∞ %",
        ],
        1,
    );
    for (name, found, _) in systems {
        let usual = found.method(|m| m.is_cager() && m.curve);
        let error = |f: fn(&crate::compare::evaluation::Totals) -> f64| usual.map_or(f64::NAN, |m| f(&m.totals));
        let s = &found.seconds;
        table.row(vec![
            format!("{}, {name}", escaped(&capture.source)),
            grouped(capture.points),
            format!("{} / {}", capture.cage_vertices, capture.cage_faces),
            grouped(capture.frames),
            seconds(s.coordinates),
            seconds(s.maxvol + s.svd),
            seconds(s.per_frame),
            seconds(s.per_frame * capture.frames as f64),
            percent(error(|t| t.l2_mean), 3),
            percent(error(|t| t.linf_mean), 3),
        ]);
    }
    for (input, points, cage, frames, prepare, frame, total, l2) in PAPER {
        let ms = |t: usize| seconds(t as f64 / 1e3);
        table.row_of(
            "paper",
            vec![
                format!("the paper: {input}"),
                grouped(points),
                cage.to_owned(),
                frames.to_string(),
                "–".to_owned(),
                ms(prepare),
                ms(frame),
                ms(total),
                l2.to_owned(),
                "–".to_owned(),
            ],
        );
    }
    html.table(&table);
    html.paragraph("Times of this machine and run, for maxvol handles with sub-spectral regularisation at the usual threshold; they differ from run to run. “Maxvol + SVD” here includes the decomposition over all points, which other methods need. One frame is one inversion on one thread within a batch of sixteen, without reading and measuring it; methods that read the same rows take the same matrix product, which is timed once, and green coordinates are timed while other methods run. Grey rows: Table 1 and §6.3 of the paper (Core 2 Duo 2.53 GHz and GeForce GTX 260 M, 2012), whose total includes the preparation; captures and cages are others than here, so they are for orientation. Form of the table: the paper's Table 1.");
    let mut methods = Table::new(&["system", "method", "one frame"], 2);
    for (name, found, _) in systems {
        for m in &found.methods {
            methods.row(vec![(*name).to_owned(), coloured(m.method.class, &m.method.name()), seconds(m.frame_seconds)]);
        }
    }
    html.folded("One inversion by every method", &methods);
}
