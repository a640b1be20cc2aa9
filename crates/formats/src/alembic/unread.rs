//! What a mesh of an archive has that is not read.

use super::objects::{Archive, Kind as ObjectKind};
use super::properties::{Kind, Property};
use crate::dropped::{Dropped, counted, listed};
use crate::error::Fault;

/// Adds what a mesh has beside points and faces.
pub(super) fn add(archive: &mut Archive<'_>, mesh: usize, dropped: &mut Dropped) -> Result<(), Fault> {
    let properties = archive.schema(mesh, ".geom")?;
    // With indices, as most programs write them, values are in a compound.
    let is_there = |found: &Property| found.kind == Kind::Compound || found.samples > 0;
    let has = |name: &str| properties.iter().any(|found| found.name == name.as_bytes() && is_there(found));
    let on_faces = [("uv", "texture coordinates (uv)"), ("N", "normals (N)")].into_iter().filter(|(name, _)| has(name));
    on_faces.for_each(|(_, what)| dropped.add_on_faces(what));
    let parameters = archive.within(&properties, ".arbGeomParams")?;
    if !parameters.is_empty() {
        let names = listed(parameters.iter().map(|parameter| parameter.name.as_slice()));
        dropped.add_on_faces(format!("parameters (arbGeomParams: {names})"));
    }
    for (name, what) in [
        (".velocities", "velocities"),
        (".creaseIndices", "creases"),
        (".cornerIndices", "creases"),
        (".holes", "holes"),
        (".scheme", "the subdivision scheme (SubD)"),
    ] {
        if has(name) {
            dropped.add(what);
        }
    }
    let is_set = |k: &usize| archive.objects[*k].kind == ObjectKind::FaceSet && archive.nodes[*k].parent == Some(mesh);
    let sets: Vec<usize> = (0..archive.objects.len()).filter(is_set).collect();
    let mut has_material = false;
    for &object in sets.iter().take(1).chain([&mesh]) {
        has_material |= archive.top_properties(object)?.iter().any(|found| found.name.starts_with(b".material"));
    }
    if has_material {
        dropped.add_on_faces("materials");
    }
    if !sets.is_empty() {
        let names = listed(sets.iter().map(|&set| &*archive.nodes[set].name));
        dropped.add_on_faces(format!("{} of faces ({names})", counted(sets.len(), "set")));
    }
    Ok(())
}
