//! Plots as SVG: scales, words and the two kinds of picture.

mod chart;
mod errors;
mod scale;
mod text;

pub(crate) use chart::{Axis, Chart, Mark, Series};
pub(crate) use errors::error_plot;
pub(crate) use scale::AxisRange;
pub(crate) use text::{escaped, grouped};
