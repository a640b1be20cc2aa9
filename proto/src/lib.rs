//! Everything of CageR that is stored or crosses a wire.
//!
//! * [`cage_messages`]: the JSON bodies of cage design.
//! * [`container`]: the `.cager` file: a rest pose, its cage and one solved cage per frame, with random access.
//! * [`messages`]: the JSON bodies of the service.
//! * [`object`]: JSON that has to be an object.
//! * [`record`]: the frame record, `application/vnd.cager.frames`: one frame with its number and its error.
//! * [`recovery_messages`]: the JSON bodies of recoveries.
//! * [`report`]: what is told of an encoding, in `report.json` and in a container.
//! * [`shape_messages`]: the JSON bodies of shape spaces.
//! * [`transfer_messages`]: the JSON bodies of transfers.
//! * [`wire`]: small structured values to and from bytes; the one module that knows bincode.
//!
//! The binary ones are little-endian with fixed-width integers. `README.md` of this crate has the frame record byte by byte,
//! `docs/FORMAT.md` of the repository the container.

pub mod cage_messages;
pub mod container;
pub mod le;
pub mod messages;
pub mod object;
pub mod record;
pub mod recovery_messages;
pub mod report;
pub mod shape_messages;
pub mod transfer_messages;
pub mod wire;
