//! The disk that fails, which the store's own tests use too.

use cager_service::store::disk;

#[path = "../faults/mod.rs"]
mod shared;

pub(crate) use shared::{Fault, FaultyDisk, Hooked, Loss, Op};
