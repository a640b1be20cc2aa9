//! Eight-wide arithmetic, compiled once per instruction set and chosen at run time. Nothing uses
//! fused multiply-add: the same source gives the same bits on every machine.

mod angle;
mod angle_ratio;
mod dispatch;
mod lanes;
mod logarithm;

pub(crate) use angle::angle;
pub(crate) use angle_ratio::{half_angle_over_sine, half_angle_over_sine_slope};
pub(crate) use dispatch::multiversion;
pub(crate) use lanes::{LANES, Lanes, Singles, cross, dot, gather, grouped, store};
pub(crate) use logarithm::ln_ratio;
