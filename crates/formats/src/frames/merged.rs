//! Corners of `.stl` triangles that are one point: the same in all frames of a capture.

use std::path::{Path, PathBuf};

use cager_geometry::mesh::{Model, Polygons};

use crate::error::{Error, Fault};
use crate::mesh::{MeshFormat, read_model};

/// Files in which the merging of the rest pose is looked for.
const LOOKED_AT: usize = 16;

/// The points that corners belong to, of a frame with as many points as the rest pose.
#[derive(Default)]
pub(super) struct Merged(Option<Polygons>);

impl Merged {
    /// A model from one of `files`, its corners merged as in the rest pose.
    ///
    /// # Errors
    /// Points that the rest pose has in one place and that part in this frame.
    pub(super) fn apply(
        &mut self,
        model: Model,
        path: &Path,
        files: &[PathBuf],
        points: usize,
    ) -> Result<Model, Error> {
        if MeshFormat::guess(path) != Some(MeshFormat::Stl) {
            return Ok(model);
        }
        let as_at_rest = |model: &Model| (model.points.len() == points).then(|| model.faces.clone());
        if self.0.is_none() {
            let others = || files.iter().take(LOOKED_AT).filter_map(|file| read_model(file).ok());
            self.0 = as_at_rest(&model).or_else(|| others().find_map(|other| as_at_rest(&other)));
        }
        let Some(faces) = self.0.as_ref().filter(|faces| faces.arities() == model.faces.arities()) else {
            return Ok(model);
        };
        if *faces == model.faces {
            return Ok(model);
        }
        let mut merged = vec![None; points];
        for (&to, &from) in faces.indices().iter().zip(model.faces.indices()) {
            let (place, point) = (&mut merged[to as usize], model.points[from as usize]);
            if place.is_some_and(|known| known != point) {
                let what = format!(
                    "point {to} lies in two places, which an .stl of the rest pose has as one; export both as .ply or \
                     .obj, which keep vertices"
                );
                return Err(Fault::invalid(what).at(path));
            }
            *place = Some(point);
        }
        Ok(Model { points: merged.into_iter().flatten().collect(), faces: faces.clone(), ..model })
    }
}
