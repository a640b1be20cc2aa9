//! What is wrong with files in several places.

use std::fmt::Display;

use crate::error::Fault;

pub(super) fn too_large() -> Fault {
    Fault::unsupported(
        "repeats its meshes too often, to more than 512 MiB; export fewer copies, or bake them into a single mesh",
    )
}

/// Damage in a part of the document, such as `mesh 0, primitive 1`.
pub(super) fn damaged(place: &str, what: impl Display) -> Fault {
    Fault::damaged(format!("{place}: {what}; export the mesh again"))
}

/// The item of a list of the document to which an index refers.
pub(super) fn item<'a, T>(list: &'a [T], kind: &str, index: usize) -> Result<&'a T, Fault> {
    let missing =
        || Fault::damaged(format!("refers to {kind} {index}, but has {} of those; export the mesh again", list.len()));
    list.get(index).ok_or_else(missing)
}
