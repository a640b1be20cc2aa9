//! Parts that are not there in all files of a capture of a file each: they stay where they were, and
//! are hidden.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cager_geometry::mesh::Model;
use cager_geometry::surface::{PartRange, shown_in};

use crate::mesh::{MeshFormat, read_model};
use crate::text::Lines;

/// The parts of the rest pose, each of a name of its own, and where they were last.
pub(super) struct Parts {
    rest: Arc<Model>,
    last: Vec<[f64; 3]>,
}

impl Parts {
    /// Of a rest pose of several parts.
    pub(super) fn of(rest: Option<&Arc<Model>>, points: usize) -> Option<Self> {
        let rest = rest.filter(|rest| rest.points.len() == points)?;
        let mut paths: Vec<&str> = rest.surface.parts.iter().map(|part| part.path.as_str()).collect();
        paths.sort_unstable();
        let is_named = paths.len() > 1 && paths.windows(2).all(|pair| pair[0] != pair[1]);
        is_named.then(|| Self { rest: Arc::clone(rest), last: rest.points.clone() })
    }

    /// A frame that lacks some parts, with these where they were last; none of another mesh.
    pub(super) fn complete(&mut self, path: &Path) -> Option<Model> {
        let model = read_model(path).ok()?;
        let there: Vec<_> = model.surface.ranges(&model.faces).collect();
        let mut found = 0;
        for (part, range) in self.rest.surface.ranges(&self.rest.faces) {
            let Some((_, own)) = there.iter().find(|(other, _)| other.path == part.path) else { continue };
            let is_same = |range: &PartRange, own: &PartRange| {
                range.points.len() == own.points.len() && range.local(&self.rest.faces) == own.local(&model.faces)
            };
            if !is_same(&range, own) {
                return None;
            }
            self.last[range.points].copy_from_slice(&model.points[own.points.clone()]);
            found += 1;
        }
        let is_part_of_it = found > 0 && found == there.len();
        is_part_of_it.then(|| Model { points: self.last.clone(), faces: self.rest.faces.clone(), ..Model::default() })
    }

    pub(super) fn count(&self) -> usize {
        self.rest.surface.parts.len()
    }

    /// Takes a frame of all parts.
    pub(super) fn keep(&mut self, points: &[[f64; 3]]) {
        self.last.copy_from_slice(points);
    }

    /// Files in which each part is there.
    pub(super) fn shown(&self, files: &[PathBuf]) -> Vec<Option<Vec<Range<u32>>>> {
        let objects: Vec<Option<Vec<String>>> = files.iter().map(|path| objects(path)).collect();
        let parts = self.rest.surface.parts.iter();
        let is_there = |objects: &Option<Vec<String>>, path: &str| {
            objects.as_ref().is_none_or(|objects| objects.iter().any(|name| name == path))
        };
        parts.map(|part| shown_in(objects.iter().map(|objects| is_there(objects, &part.path)))).collect()
    }
}

/// The objects of an `.obj` file as paths of parts; none of other files and of those without.
fn objects(path: &Path) -> Option<Vec<String>> {
    if MeshFormat::guess(path) != Some(MeshFormat::Obj) {
        return None;
    }
    let bytes = fs::read(path).ok()?;
    let names = Lines::new(&bytes).filter_map(|line| line.strip_prefix(b"o "));
    let path = |name: &[u8]| format!("/{}", String::from_utf8_lossy(name.trim_ascii()).replace('/', "_"));
    Some(names.map(path).collect()).filter(|names: &Vec<String>| !names.is_empty())
}
