//! The report: one HTML file that refers to no other.

mod cages;
mod errors;
mod handles;
mod parts;
mod spectra;
mod summary;
mod times;
mod vectors;

use super::figures::{Figures, SystemFigures};
use super::pictures::Pictures;
use crate::plot::escaped;
use parts::Html;

/// A computed system: its name, figures and pictures.
type SystemSection<'a> = (&'a str, &'a SystemFigures, &'a Pictures);

/// The whole page.
pub(crate) fn page(figures: &Figures, pictures: &[Pictures]) -> String {
    let systems: Vec<SystemSection<'_>> =
        figures.computed().zip(pictures).map(|((name, found), pictures)| (name, found, pictures)).collect();
    let mut html = Html::default();
    summary::claims(&mut html, figures);
    summary::refused(&mut html, figures);
    errors::section(&mut html, figures, &systems);
    cages::section(&mut html, figures, &systems);
    spectra::section(&mut html, &systems);
    handles::swaps(&mut html, &systems);
    handles::random(&mut html, &systems);
    errors::noise(&mut html, figures, &systems);
    vectors::section(&mut html, &systems);
    times::section(&mut html, figures, &systems);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" content=\"width=device-width\"/>\n<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n",
        escaped(&format!("Comparison: {}", figures.capture.source)),
        include_str!("style.css")
    );
    page.push_str(&summary::head(figures));
    page.push_str(&html.contents());
    page.push_str(&html.text);
    page.push_str(&summary::foot(figures));
    page.push_str("</body>\n</html>\n");
    page
}
