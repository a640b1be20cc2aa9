//! Which mesh of an archive is meant.

use std::io::{Read, Seek};

use super::mesh::Mesh;
use super::objects::{Archive, Kind};
use super::properties::{Kind as PropertyKind, find};
use crate::error::Fault;
use crate::scene::{Failure, Objects, choose as choose_object, shown, shown_path};

/// Bytes of the path of what an instance is of.
const LONGEST_PATH: usize = 4096;

/// The mesh that `prim` names, or the only one.
pub(super) fn choose<R: Read + Seek>(archive: &mut Archive<R>, prim: Option<&str>) -> Result<usize, Failure> {
    let is_candidate = |k: &usize| matches!(archive.objects[*k].kind, Kind::Mesh | Kind::Instance);
    let all: Vec<usize> = (0..archive.objects.len()).filter(is_candidate).collect();
    if all.is_empty() {
        return Err(Fault::unsupported("holds no polygon mesh; export the mesh itself as Alembic").into());
    }
    let chosen = choose_object(archive, &all, prim)?;
    if archive.objects[chosen].kind == Kind::Mesh {
        return Ok(chosen);
    }
    let (path, source) = (shown_path(archive, chosen), source(archive, chosen)?);
    let what = format!(
        "{path} is an instance of {source}, which is not read; make instances real where it is exported, or export {source} alone"
    );
    Err(Fault::unsupported(what).into())
}

impl<R: Read + Seek> Objects for Archive<R> {
    fn name(&self, object: usize) -> &[u8] {
        &self.objects[object].name
    }

    fn parent(&self, object: usize) -> Option<usize> {
        self.objects[object].parent
    }

    fn depth(&self, object: usize) -> usize {
        self.objects[object].depth
    }

    fn told(&mut self, object: usize) -> String {
        if self.objects[object].kind == Kind::Instance {
            return "an instance".to_owned();
        }
        match Mesh::open(self, object).and_then(|opened| opened.points(&mut self.container, 0)) {
            Ok((points, _)) => format!("{points} points"),
            Err(_) => "unreadable".to_owned(),
        }
    }
}

/// What an instance is of.
fn source<R: Read + Seek>(archive: &mut Archive<R>, instance: usize) -> Result<String, Failure> {
    let properties = archive.top_properties(instance)?;
    let Some(told) = find(&properties, ".instanceSource", PropertyKind::Scalar) else {
        return Ok("another object".to_owned());
    };
    let bytes = told.table(&mut archive.container, 0, LONGEST_PATH)?;
    Ok(shown(String::from_utf8_lossy(&bytes).trim_end_matches('\0')))
}
