//! What a layer has that another one is to move: the meshes of its parts, and what of these would
//! contradict other points.

use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{Part, Surface};
use cager_geometry::units::Units;

use super::layer::{Kind, Layer};
use super::{compose, mesh, open_layer};
use crate::error::{Error, Fault};
use crate::scene::{self, most_corners};

/// Attributes that hold at the points of the source alone, or move them once more.
const BLOCKED: [&str; 8] = [
    "normals",
    "primvars:normals",
    "primvars:normals:indices",
    "velocities",
    "accelerations",
    "primvars:skel:jointIndices",
    "primvars:skel:jointWeights",
    "skel:blendShapes",
];

/// A layer whose meshes get other points.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Onto {
    /// The file, as the layer on top of it names it.
    pub(crate) file: String,
    pub(crate) units: Units,
    /// Those of the parts of the model.
    pub(crate) meshes: Vec<Moved>,
}

/// A mesh that gets other points.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Moved {
    pub(crate) path: String,
    /// Attributes that are blocked, with their types.
    pub(crate) blocked: Vec<(String, String)>,
    /// Whether its faces are those of the part in the opposite order of corners.
    pub(crate) is_turned: bool,
    /// Whether its faces are those of the part, none left out.
    pub(crate) has_all_faces: bool,
}

impl Onto {
    /// Looks up the parts of a surface in a file; `output` is what will name it.
    ///
    /// # Errors
    /// A file that is not USD, or lacks a part.
    pub(crate) fn find(source: &Path, output: &Path, (surface, faces): (&Surface, &Polygons)) -> Result<Self, Error> {
        let read = |cause| Error::read(source, cause);
        let file = File::open(source).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        let find = || {
            let ((layer, _), is_package) = open_layer(Box::new(file), length, false)?;
            let mut layer = compose::compose(layer, length, source.parent().filter(|_| !is_package))?;
            let units = mesh::units(&layer.stage);
            let mut paths = HashMap::new();
            for mesh in (0..layer.prims.len()).filter(|&k| layer.prims[k].kind == Kind::Mesh) {
                paths.insert(scene::path(&layer.nodes, mesh), mesh);
            }
            let meshes = surface.ranges(faces).map(|(part, range)| {
                let mesh = paths.get(&part.path).copied();
                found(&mut layer, mesh, part, &range.local(faces))
            });
            Ok(Self { file: relative(source, output), units, meshes: meshes.collect::<Result<_, _>>()? })
        };
        if surface.is_empty() {
            let what = "cannot get the points of a model that has no paths; encode it from this file";
            return Err(Fault::invalid(what).at(source));
        }
        find().map_err(|fault: Fault| fault.at(source))
    }
}

/// A part's mesh in a layer.
fn found(layer: &mut Layer<'_>, mesh: Option<usize>, part: &Part, faces: &Polygons) -> Result<Moved, Fault> {
    let path = &part.path;
    let cure = "give the file that it was encoded from";
    let Some(mesh) = mesh else {
        return Err(Fault::invalid(format!("has no mesh {path}, a part of the model; {cure}")));
    };
    let there = match layer.first(mesh, "points")? {
        Some(value) => layer.source.points(value)?.count,
        None => part.points,
    };
    if there != part.points {
        let own = part.points;
        return Err(Fault::invalid(format!("{path} has {there} points, and the part of the model {own}; {cure}")));
    }
    let mut integers = |name| layer.integers(mesh, name, most_corners(there));
    let [counts, corners] = [integers("faceVertexCounts")?, integers("faceVertexIndices")?];
    let read = |is_turned| {
        let numbers = |list: &[i32]| list.iter().map(|&number| number as u32).collect::<Vec<_>>().into_iter();
        scene::faces(numbers(&counts), numbers(&corners), there, is_turned)
    };
    let (own, left_out) = read(false)?;
    let is_turned = own != *faces;
    if is_turned && read(true)?.0 != *faces {
        return Err(Fault::invalid(format!("{path} has other faces than the part of the model; {cure}")));
    }
    let properties = layer.source.properties(mesh);
    let blocked = properties.into_iter().filter(|(name, _)| BLOCKED.contains(&name.as_str())).collect();
    Ok(Moved { path: path.clone(), blocked, is_turned, has_all_faces: left_out == 0 })
}

/// A file as another one names it: from its own folder where that can be told.
fn relative(file: &Path, from: &Path) -> String {
    let folder = |path: &Path| match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.canonicalize(),
        _ => Path::new(".").canonicalize(),
    };
    let name = file.file_name().unwrap_or_default();
    let (Ok(there), Ok(here)) = (folder(file), folder(from)) else { return file.display().to_string() };
    let common = there.components().zip(here.components()).take_while(|(a, b)| a == b).count();
    let up = here.components().skip(common).map(|_| "..");
    let down: PathBuf = there.components().skip(common).collect();
    let path: PathBuf = up.collect::<PathBuf>().join(down).join(name);
    let text = path.to_string_lossy().replace('\\', "/");
    if text.starts_with("..") { text } else { format!("./{text}") }
}
