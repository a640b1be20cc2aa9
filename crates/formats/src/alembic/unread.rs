//! What a mesh of an archive has that is not read.

use super::objects::Archive;
use super::properties::{Kind, Property};
use crate::dropped::Dropped;
use crate::error::Fault;

/// Adds what a mesh of these properties has beside points, faces and what is read of what lies on them.
pub(super) fn add(
    archive: &mut Archive<'_>,
    mesh: usize,
    properties: &[Property],
    dropped: &mut Dropped,
) -> Result<(), Fault> {
    let is_there = |found: &Property| found.kind == Kind::Compound || found.samples > 0;
    let has = |name: &str| properties.iter().any(|found| found.name == name.as_bytes() && is_there(found));
    for (name, what) in
        [(".velocities", "velocities"), (".cornerIndices", "sharp corners (cornerIndices)"), (".holes", "holes")]
    {
        if has(name) {
            dropped.add(what);
        }
    }
    let mut has_material = false;
    for object in archive.sets(mesh).into_iter().take(1).chain([mesh]) {
        has_material |= archive.top_properties(object)?.iter().any(|found| found.name.starts_with(b".material"));
    }
    if has_material {
        dropped.add_on_faces("what materials look like");
    }
    Ok(())
}
