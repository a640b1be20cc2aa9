//! Everything of CageR that is stored or crosses a wire: the `.cager` file ([`container`]), its
//! [`report`], the frames of a stream ([`record`]), and the JSON bodies of the service.
//!
//! Binary data is little-endian with fixed-width integers. `README.md` of this crate has the frame
//! record byte by byte, `docs/FORMAT.md` of the repository the container.

pub mod cage_messages;
pub mod container;
pub mod job_messages;
pub mod le;
pub mod messages;
pub mod object;
mod options;
pub mod record;
pub mod recovery_messages;
pub mod report;
mod session_options;
pub mod shape_messages;
pub mod transfer_messages;
pub mod wire;
