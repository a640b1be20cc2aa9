//! The motion of one model moved onto another: frames in, frames out that can be encoded as any capture.

mod error;
mod job;
mod method;
mod motion_file;
mod pairs;
mod placing;
mod report;
mod run;
pub(crate) mod words;

pub use error::TransferFailed;
pub use job::{MethodChoice, Public, TransferJob};
pub(crate) use motion_file::{MotionFile, decoded};
pub(crate) use pairs::read_pairs;
pub(crate) use placing::about_origin;
pub use report::{QualityReport, Seconds, TransferReport};
pub(crate) use run::MOVED;
pub use run::{Transferred, transfer};
