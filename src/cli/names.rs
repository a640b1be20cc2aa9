//! Values of options that are named as the library names them, each with its help.

use cager_cages::Style;
use cager_capture::design::{PerPart, style_by_name};
use cager_core::coordinates;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::time::Duration;

/// A name and what it means.
type Names = [(&'static str, &'static str)];

const COORDINATES: &Names = &[
    ("mvc", "Mean value coordinates: defined everywhere, fast"),
    (
        "harmonic",
        "Harmonic coordinates: between 0 and 1 up to about 1e-3, with influence through the inside of the cage only, \
         where all points must be; seconds to prepare",
    ),
    (
        "green",
        "Green coordinates: the model keeps its angles better; normals of the cage follow from its vertices, found by \
         iterating",
    ),
    (
        "green-free",
        "Green coordinates whose normals are unknowns of their own: the lowest errors, by cages with spikes",
    ),
];

const HANDLES: &Names = &[
    ("maxvol", "As many as the cage has unknowns, of maximum volume: stable and fast"),
    ("rectangular", "Those and the points of the largest leverage beside them: for comparison"),
    (
        "spread",
        "Those and points spread over the model, between which frames are interpolated: nearly the error of all",
    ),
    ("all", "Every point: least squares, the lowest error"),
];

const REGULARIZERS: &Names = &[
    ("laplacian", "Smooth the last S singular directions by the cage's Laplacian"),
    ("differential", "Give the last S singular directions the shape of the rest cage"),
    (
        "temporal",
        "Give the last S singular directions the shape of the previous frame's cage; frames are inverted in order",
    ),
    (
        "matrix",
        "Make the product of the matrix in --regularizer-matrix and the cage small in the last S singular directions",
    ),
    ("none", "Follow the data alone"),
    ("truncated-svd", "Drop the last S singular directions"),
    ("tikhonov", "Damp every direction, with α = L"),
    ("global", "Smooth the whole spectrum by the cage's Laplacian (for other terms: --spectrum all)"),
];

const STYLES: &Names = &[
    ("free", "For compression and viewing: the lowest error; the cage may cut itself"),
    ("editable", "For editing by hand: closed, free of self-intersection, enclosing, smooth"),
];

const PER_PART: &Names = &[
    ("auto", "Parts that move together share one, where components follow the motion better than one cage for all"),
    ("yes", "One for each part"),
    ("no", "One cage for all parts"),
];

pub(super) fn coordinates() -> impl TypedValueParser<Value = &'static dyn CoordinateSystem> {
    named(COORDINATES, coordinates::by_name)
}

/// A time above 0, also in parts of a second.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds| *seconds > 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| "give seconds above 0, such as 30".to_owned())
}

/// Handles without a count of their own.
pub(super) fn handles() -> impl TypedValueParser<Value = Handles> {
    named(HANDLES, |name| Handles::by_name(name, None))
}

pub(super) fn regularizer() -> impl TypedValueParser<Value = Regularizer> {
    named(REGULARIZERS, Regularizer::by_name)
}

pub(super) fn style() -> impl TypedValueParser<Value = Style> {
    named(STYLES, style_by_name)
}

pub(super) fn per_part() -> impl TypedValueParser<Value = PerPart> {
    named(PER_PART, |name| match name {
        "auto" => Some(PerPart::Auto),
        "yes" => Some(PerPart::Yes),
        "no" => Some(PerPart::No),
        _ => None,
    })
}

fn named<T: Clone + Send + Sync + 'static>(
    names: &Names,
    by_name: fn(&str) -> Option<T>,
) -> impl TypedValueParser<Value = T> + use<T> {
    PossibleValuesParser::new(names.iter().map(|&(name, help)| PossibleValue::new(name).help(help)))
        .try_map(move |name| by_name(&name).ok_or("this program has none of that name"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_capture::design::{STYLES as ALL_STYLES, style_name};

    #[test]
    fn every_name_of_the_library_can_be_given_and_no_other() {
        let names = |names: &Names| names.iter().map(|&(name, _)| name).collect::<Vec<_>>();
        assert_eq!(names(COORDINATES), coordinates::SYSTEMS.map(CoordinateSystem::name));
        assert_eq!(names(HANDLES), Handles::NAMES);
        assert_eq!(names(REGULARIZERS), Regularizer::ALL.map(Regularizer::name));
        assert_eq!(names(STYLES), ALL_STYLES.map(style_name));
    }
}
