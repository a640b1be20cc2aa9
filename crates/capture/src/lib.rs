#![doc = include_str!("../README.md")]
//!
//! The command line, the service and the Python module share this crate; it knows neither requests nor options as they are typed.

pub mod belonging;
pub mod cage_export;
pub mod capture;
pub mod coding;
pub mod decode;
pub mod design;
pub mod edit;
pub mod edited;
pub mod encode;
pub mod frames;
mod inverter;
pub mod memory;
pub mod mismatch;
mod open;
pub mod origin;
pub mod preparation_warnings;
pub mod sizes;
pub mod speed;
pub mod timing;

pub use cager_core::cage::Cage;
pub use cager_formats::{FrameReader, Target, read_model, write_model};
pub use cager_geometry::mesh::{Model, Point, TriMesh};
pub use cager_proto::report::Report;
pub use coding::Goal;
pub use decode::{Animation, DecodeError};
pub use encode::{Encode, EncodeError, Encoder, encode};
pub use inverter::{Inverter, LengthError};
pub use open::Capture;
