//! What `cager encode` is asked of errors and sizes.

use anyhow::{Result, bail};
use cager_capture::coding::Goal;
use cager_capture::sizes::bytes;
use cager_formats::Units;
use cager_geometry::mesh::{Model, diagonal};
use clap::{Args, ValueEnum};
use std::str::FromStr;

/// How exactly and how small frames are stored. Without any of these, cages are stored as they are solved for.
#[derive(Args, Debug)]
pub(crate) struct CodingArgs {
    /// Guarantee that no point of any frame is farther than E from where it was captured: a
    /// fraction of the rest pose's diagonal, such as
    /// 0.001, or a length such as 0.2mm, with --unit.
    #[arg(long, value_name = "E", allow_hyphen_values = true,
          conflicts_with_all = ["target_size", "quality", "mean_error"])]
    pub(crate) max_error: Option<ErrorBound>,

    /// Write at most so many bytes, such as 500KB, or so many bits for each point and frame, such as 0.5bpvf.
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true, conflicts_with_all = ["quality", "mean_error"])]
    pub(crate) target_size: Option<TargetSize>,

    /// preview: cages alone; standard: errors that are not seen; master: a guaranteed maximum error
    /// of 0.0001 of the rest pose's diagonal.
    #[arg(long, value_enum, value_name = "QUALITY", conflicts_with = "mean_error")]
    pub(crate) quality: Option<Quality>,

    /// Write the smallest file whose mean L2 error is at most E, a fraction of the rest pose's
    /// diagonal; where a cage is designed, the smallest cage of which that holds.
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    pub(crate) mean_error: Option<f64>,

    /// What one unit of the positions is in files that do not say it: for lengths given to
    /// --max-error, and for programs that read what is decoded.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub(crate) unit: Option<Unit>,

    /// What the file of the rest pose says.
    #[arg(skip)]
    pub(crate) said: Units,

    /// Store the rest pose and the cage as they are, not on a grid finer than the errors asked for.
    #[arg(long)]
    pub(crate) exact_rest: bool,
}

/// A largest error: a fraction of the diagonal, or a length in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ErrorBound {
    Fraction(f64),
    Metres(f64),
}

/// A size of a file: bytes, or bits for each point and frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TargetSize {
    Bytes(u64),
    BitsPerPoint(f64),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Quality {
    Preview,
    Standard,
    Master,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Unit {
    Mm,
    Cm,
    M,
    In,
    Ft,
}

impl Unit {
    pub(super) fn metres(self) -> f64 {
        match self {
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::M => 1.0,
            Self::In => 0.0254,
            Self::Ft => 0.3048,
        }
    }
}

impl CodingArgs {
    /// What the file of the rest pose says of its positions, or else is told.
    pub(super) fn units(&self) -> Units {
        self.said.or(Units { metres_per_unit: self.unit.map(Unit::metres), up: None })
    }
}

/// The number before a unit, and the unit.
fn parts(text: &str) -> Result<(f64, &str), String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    // The exponent of a number ends in a digit.
    let number: f64 = digits.trim().parse().map_err(|_| format!("{text:?} does not begin with a number"))?;
    if number.is_finite() && number > 0.0 {
        Ok((number, &text[digits.len()..]))
    } else {
        Err(format!("{text:?} is not a finite number above 0"))
    }
}

impl FromStr for ErrorBound {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit) = parts(text)?;
        match unit {
            "" if number >= 1.0 => Err(format!("{number} is a fraction of the rest pose's diagonal, so below 1")),
            "" => Ok(Self::Fraction(number)),
            unit => Unit::from_str(unit, true)
                .map(|unit| Self::Metres(number * unit.metres()))
                .map_err(|_| format!("{unit:?} is no unit; use mm, cm, m, in or ft, or leave it out for a fraction")),
        }
    }
}

impl FromStr for TargetSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(number) = text.trim().strip_suffix("bpvf") {
            return parts(number).and_then(|(number, unit)| match unit {
                "" => Ok(Self::BitsPerPoint(number)),
                unit => Err(format!("{unit:?} before bpvf")),
            });
        }
        match bytes(text) {
            Some(bytes @ 1..) => Ok(Self::Bytes(bytes)),
            _ => Err(format!(
                "{text:?} is neither a size such as 500KB nor bits for each point and frame such as 0.5bpvf"
            )),
        }
    }
}

/// What the file is to meet, for this rest pose and so many frames; `None` where nothing is asked.
/// A mean error is met by coding, or by a cage that is designed for it.
pub(super) fn goal(
    coding: &CodingArgs,
    units: Units,
    codes_mean: bool,
    rest: &Model,
    frames: usize,
) -> Result<Option<Goal>> {
    let unit = units.metres_per_unit;
    Ok(match (coding.max_error, coding.target_size, coding.quality) {
        (Some(ErrorBound::Fraction(error)), ..) => Some(Goal::MaxError(error)),
        (Some(ErrorBound::Metres(length)), ..) => {
            let Some(unit) = unit else {
                bail!(
                    "--max-error: a length needs --unit, what one unit of the capture's positions is, such as --unit cm"
                )
            };
            let diagonal = diagonal(&rest.points);
            let error = length / unit / diagonal;
            if error.is_nan() || error >= 1.0 {
                bail!(
                    "--max-error: is {error:.3} times the rest pose's diagonal, {diagonal:.4} units; check --unit, or \
                     give a shorter length"
                );
            }
            Some(Goal::MaxError(error))
        }
        (_, Some(TargetSize::Bytes(bytes)), _) => Some(Goal::Size(bytes)),
        (_, Some(TargetSize::BitsPerPoint(bits)), _) => {
            Some(Goal::Size((bits * rest.points.len() as f64 * frames as f64 / 8.0) as u64))
        }
        (.., Some(Quality::Preview)) => Some(Goal::Preview),
        (.., Some(Quality::Standard)) => Some(Goal::Standard),
        (.., Some(Quality::Master)) => Some(Goal::MASTER),
        _ => match coding.mean_error {
            Some(error) if codes_mean => {
                if !(error > 0.0 && error < 1.0) {
                    bail!(
                        "--mean-error: is {error}; give a fraction of the rest pose's diagonal above 0, such as 0.001"
                    );
                }
                Some(Goal::MeanError(error))
            }
            _ => None,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_and_sizes_are_read_with_their_units() {
        assert_eq!("1e-3".parse(), Ok(ErrorBound::Fraction(1e-3)));
        assert_eq!("0.2mm".parse(), Ok(ErrorBound::Metres(0.2e-3)));
        assert_eq!("2 in".parse(), Ok(ErrorBound::Metres(2.0 * 0.0254)));
        assert_eq!("500KB".parse(), Ok(TargetSize::Bytes(500_000)));
        assert_eq!("0.5bpvf".parse(), Ok(TargetSize::BitsPerPoint(0.5)));
        for wrong in ["", "mm", "-1", "0", "NaN", "inf", "1", "2e-3furlong"] {
            assert!(wrong.parse::<ErrorBound>().is_err(), "{wrong}");
        }
        for wrong in ["", "KB", "-1", "0", "5 parsecs"] {
            assert!(wrong.parse::<TargetSize>().is_err(), "{wrong}");
        }
    }
}
