#![doc = include_str!("../README.md")]
//!
//! The command line, the service and the Python module share this crate.

pub mod belonging;
pub mod cage_export;
pub mod cage_file;
pub mod capture;
pub mod checks;
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
mod positions;
pub mod preparation_warnings;
pub mod sizes;
pub mod speed;
pub mod timing;

pub use cager_core::cage::{Cage, CageError};
pub use cager_core::coordinates::{CoordinateSystem, Green, Harmonic, MeanValue};
pub use cager_core::inversion::{PrepareError, SolverOptions};
pub use cager_formats::{FrameRange, FrameReader, FrameSelection, Target, read_model, write_model};
pub use cager_geometry::mesh::{Model, Point, TriMesh};
pub use cager_geometry::units::{Units, Up};
pub use cager_proto::report::Report;
pub use coding::Goal;
pub use decode::{Animation, DecodeError};
pub use encode::{Encode, EncodeError, Encoder, encode};
pub use frames::CaptureFiles;
pub use inverter::{InvertError, Inverter};
pub use open::{Capture, OpenOptions, Opened};
