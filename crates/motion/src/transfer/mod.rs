//! The motion of one model moved onto another: frames in, frames out.

mod error;
mod job;
mod method;
mod motion_file;
mod pairs;
mod placing;
mod report;
mod run;
pub mod words;

pub use error::TransferFailed;
pub use job::{MethodChoice, Public, TransferJob};
pub use motion_file::{MotionFile, decoded};
pub use pairs::read_pairs;
pub use placing::about_origin;
pub use report::{Seconds, TransferReport};
pub use run::MOVED;
pub use run::{Transferred, transfer};
