//! What is wrong with files in several places.

use crate::error::Fault;

pub(super) fn too_large() -> Fault {
    Fault::unsupported(
        "repeats its meshes too often, to more than 512 MiB; export fewer copies, or bake them into a single mesh",
    )
}

/// A reference to something that is not there.
pub(super) fn dangling(what: &str, count: usize) -> Fault {
    Fault::damaged(format!("refers to {what}, but has {count} of those; export the mesh again"))
}
