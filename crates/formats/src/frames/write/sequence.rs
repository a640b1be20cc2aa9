//! Each frame in a mesh file of its own.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{Material, Surface};

use super::super::numbered::NumberedNames;
use super::mesh::FrameMesh;
use super::output::{Announced, FrameOptions, Output};
use crate::atomic::{AtomicDir, AtomicGroup, Target};
use crate::error::Error;
use crate::mesh::{MeshFormat, materials_text};

pub(super) struct SequenceWriter {
    place: Place,
    mesh: FrameMesh,
    names: NumberedNames,
    options: FrameOptions,
    /// Materials with other pictures in other frames, each of which has a file of them.
    moving: Option<Vec<Material>>,
}

/// Where the files go.
enum Place {
    /// Into a folder of their own, which is new or replaced as a whole.
    Own(AtomicDir),
    /// Into one with files.
    Shared(AtomicGroup),
}

impl Place {
    fn create_file(&mut self, name: &str, path: &Path) -> Result<File, Error> {
        match self {
            Self::Own(folder) => folder.create_file(name),
            Self::Shared(group) => group.create_file(name),
        }
        .map_err(|cause| Error::write(path, cause))
    }

    /// Writes a file of this name and text into the folder at `path`.
    fn write_file(&mut self, name: &str, text: &[u8], path: &Path) -> Result<(), Error> {
        let path = path.join(name);
        self.create_file(name, &path)?.write_all(text).map_err(|cause| Error::write(&path, cause))
    }
}

impl SequenceWriter {
    pub(super) fn create(
        announced: &Announced,
        target: &Target,
        faces: &Polygons,
        names: NumberedNames,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let format = if names.extension_is("ply") { MeshFormat::Ply } else { MeshFormat::Obj };
        let library = names.library();
        let mut mesh = FrameMesh::new(format, announced, faces, options, &library)?;
        let moving =
            (mesh.library.is_some() && options.surface.has_sequences()).then(|| options.surface.materials.clone());
        let one = mesh.library.take_if(|_| moving.is_none());
        // Files of materials of an earlier output too, which had one of all frames, or one of each.
        let is_frame = |name: &str| {
            let is_library = || name == library || names.is_own_library(name);
            names.number(name).is_some() || format == MeshFormat::Obj && is_library()
        };
        let path = &announced.path;
        let mut place = if shares_folder(target.path()) {
            let numbers = || (0..announced.frames).map(|frame| options.number(frame));
            let libraries = numbers().filter(|_| moving.is_some()).map(|number| names.own_library(number));
            let frames = numbers().map(|number| names.name(number)).chain(libraries);
            let new = frames.chain(one.is_some().then(|| library.clone())).collect();
            Place::Shared(AtomicGroup::create(path, target.replaces(), &new, is_frame)?)
        } else {
            Place::Own(AtomicDir::create(path, |name| target.replaces() && is_frame(name))?)
        };
        if let Some((name, text)) = &one {
            place.write_file(name, text, path)?;
        }
        Ok(Self { place, mesh, names, options: options.clone(), moving })
    }
}

impl Output for SequenceWriter {
    fn write(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error> {
        let number = self.options.number(announced.written);
        if let Some(materials) = &self.moving {
            let library = self.names.own_library(number);
            self.place.write_file(
                &library,
                materials_text(materials, announced.written).as_bytes(),
                &announced.path,
            )?;
            self.mesh.name_library(&library);
        }
        let name = self.names.name(number);
        let path = announced.path.join(&name);
        let mut file = BufWriter::with_capacity(1 << 16, self.place.create_file(&name, &path)?);
        self.mesh.write(&mut file, positions, &path)?;
        file.flush().map_err(|cause| Error::write(&path, cause))
    }

    fn change_mesh(
        &mut self,
        announced: &mut Announced,
        points: usize,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<(), Error> {
        announced.points = points;
        announced.check(&self.options).map_err(|fault| fault.at(&announced.path))?;
        self.mesh = FrameMesh::new(self.mesh.format, announced, faces, options, &self.names.library())?;
        self.moving = None;
        Ok(())
    }

    fn keeps_surface(&self) -> bool {
        self.mesh.format == MeshFormat::Obj
    }

    fn lost(&self, surface: &Surface) -> Vec<String> {
        self.mesh.lost(surface)
    }

    fn finish(self: Box<Self>, _: &Announced) -> Result<(), Error> {
        match self.place {
            Place::Own(folder) => folder.commit(),
            Place::Shared(group) => group.commit(),
        }
    }
}

/// Whether files of a numbered name go into the current folder, or one that holds something.
pub(super) fn shares_folder(path: &Path) -> bool {
    if NumberedNames::of(path).is_none() {
        return false;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(place) = folder.canonicalize() else { return false };
    let holds_current =
        std::env::current_dir().and_then(|here| here.canonicalize()).is_ok_and(|here| here.starts_with(&place));
    holds_current || place.read_dir().is_ok_and(|mut entries| entries.next().is_some())
}
