//! The meshes of a scene, one after another, frame by frame.

use std::path::Path;

use cager_geometry::mesh::{Model, Polygons};
use cager_geometry::surface::{Material, Picture, Surface, shown_in};
use cager_geometry::units::Units;

use super::mesh::{MeshTracks, MovingMesh};
use super::reader::{Animation, MeshInfo, open};
use super::track::{Timeline, Values};
use crate::error::{Error, Fault};
use crate::frames::PictureSequence;

/// What a parser finds of a scene.
#[derive(Default)]
pub(crate) struct SceneTracks {
    /// The meshes that are read.
    pub(crate) meshes: Vec<MeshTracks>,
    pub(crate) timeline: Timeline,
    pub(crate) units: Units,
    /// What the user should know of how it is read.
    pub(crate) notes: Vec<String>,
    /// Those that parts name, where a model is read.
    pub(crate) materials: Vec<Material>,
    /// Those that lie in the file itself.
    pub(crate) pictures: Vec<Picture>,
    /// Those of materials by frame, where frames are read.
    pub(crate) sequences: Vec<PictureSequence>,
}

pub(crate) struct MovingScene<'a> {
    source: Box<dyn Values + 'a>,
    meshes: Vec<MovingMesh>,
    at: Vec<f64>,
    materials: Vec<Material>,
    pictures: Vec<Picture>,
    info: MeshInfo,
}

/// The fault of a mesh that begins with nothing.
pub(crate) fn no_points() -> Fault {
    Fault::invalid("has a mesh without points in its first frame; export it with its points")
}

impl<'a> MovingScene<'a> {
    pub(crate) fn new(mut source: Box<dyn Values + 'a>, tracks: SceneTracks) -> Result<Self, Fault> {
        let SceneTracks { meshes: found, timeline, units, mut notes, materials, pictures, sequences } = tracks;
        let (mut meshes, mut faces, mut points) = (Vec::new(), Polygons::new(), 0);
        let several = found.len() > 1;
        for tracks in found {
            let path = tracks.part.path.clone();
            let named = |fault: Fault| if several { fault.within(&path) } else { fault };
            let Some(mesh) = MovingMesh::new(source.as_mut(), tracks, &timeline.at).map_err(named)? else {
                if several {
                    notes.push(format!("{path} has no points in the first frame and is left out"));
                }
                continue;
            };
            for face in mesh.faces.iter() {
                faces.push(&face.iter().map(|&point| point + points as u32).collect::<Vec<_>>());
            }
            points += mesh.points;
            if points > u32::MAX as usize {
                return Err(Fault::unsupported(
                    "has meshes of more than 4294967295 points together; choose some with --prim",
                ));
            }
            meshes.push(mesh);
        }
        if meshes.is_empty() {
            return Err(no_points());
        }
        let shown = meshes.iter().map(|mesh| shown_in(timeline.at.iter().map(|&time| mesh.is_shown(time)))).collect();
        let (frames, times) = (timeline.at.len(), timeline.times);
        let info = MeshInfo { points, frames, times, faces, units, notes, shown, pictures: sequences };
        Ok(Self { source, meshes, at: timeline.at, materials, pictures, info })
    }

    /// The first frame, and how many faces were left out that have fewer than three corners.
    pub(crate) fn into_model(mut self, path: &Path) -> Result<(Model, usize, Units), Error> {
        let (units, mut values) = (self.info.units, Vec::new());
        let parts = self.meshes.iter().map(|mesh| mesh.part().clone()).collect();
        let surface = Surface {
            parts,
            materials: std::mem::take(&mut self.materials),
            pictures: std::mem::take(&mut self.pictures),
        };
        let left_out = self.meshes.iter().map(|mesh| mesh.left_out).sum();
        let (faces, points) = (std::mem::take(&mut self.info.faces), self.info.points);
        open(path, self, points)?.read_next(&mut values)?;
        let points = values.as_chunks().0.to_vec();
        Ok((Model { points, faces, surface, ..Model::default() }, left_out, units))
    }
}

impl Animation for MovingScene<'_> {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Fault> {
        let several = self.meshes.len() > 1;
        // Every value is overwritten below.
        out.resize(3 * self.info.points, 0.0);
        let (mut rest, mut finite) = (out.as_mut_slice(), true);
        for mesh in &mut self.meshes {
            let (own, others) = rest.split_at_mut(3 * mesh.points);
            rest = others;
            finite &= mesh
                .read(self.source.as_mut(), self.at[frame], own)
                .map_err(|fault| if several { fault.within(&mesh.part().path) } else { fault })?;
        }
        Ok(finite)
    }
}
