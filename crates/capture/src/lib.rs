//! From files to containers and back: encode, decode, edit, coding.
//!
//! The command line, the service and the Python module share it; it knows neither requests nor options as they are typed.

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
pub mod memory;
pub mod mismatch;
pub mod origin;
pub mod preparation_warnings;
pub mod reach;
pub mod sizes;
pub mod speed;
pub mod timing;
