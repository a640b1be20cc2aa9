//! All frames in a scene: an Alembic archive, or a file of USD.

use std::path::Path;

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{Material, Surface};

use super::super::CacheFormat;
use super::output::{Announced, CageMesh, FrameOptions, Output, no_cage};
use crate::alembic::{self, Schedule};
use crate::atomic::{AtomicFile, Target};
use crate::dropped::counted;
use crate::error::{Error, Fault};
use crate::faces::check_faces;
use crate::usd;

/// Bytes that a package may have.
const LONGEST_PACKAGE: usize = 0xf000_0000;

pub(super) struct SceneWriter {
    mesh: Mesh,
    /// Of the cage.
    cage: Option<Announced>,
}

enum Mesh {
    Alembic(Box<alembic::MeshWriter<AtomicFile>>),
    Usd(Box<usd::MeshWriter<AtomicFile>>),
    Over(Box<usd::OverWriter<AtomicFile>>),
}

impl SceneWriter {
    pub(super) fn create(
        announced: &Announced,
        target: &Target,
        format: CacheFormat,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let path = &announced.path;
        check(announced, format, faces, &options.surface).map_err(|fault| fault.at(path))?;
        let (name, write) = (name(path), |cause| Error::write(path, cause));
        if let Some(cage) = &options.cage {
            check_cage(cage).map_err(|fault| fault.at(path))?;
        }
        let codes = (0..announced.frames).map(|frame| options.number(frame)).collect();
        if let Some(source) = &options.onto {
            let onto = usd::Onto::find(source, path, (&options.surface, faces))?;
            if !options.units.change_to(onto.units).is_none() {
                let what = "has another unit or upward axis than what is written; bring it there with --up and --unit";
                return Err(Fault::invalid(what).at(source));
            }
            let file = AtomicFile::create(target)?;
            let (timing, origin) = ((options.fps, codes), options.origin);
            let mesh = usd::OverWriter::new(file, faces, &options.surface, onto, timing, origin).map_err(write)?;
            return Ok(Self { mesh: Mesh::Over(Box::new(mesh)), cage: None });
        }
        let file = AtomicFile::create(target)?;
        if format != CacheFormat::Abc {
            let scene = usd::Scene {
                name,
                fps: options.fps,
                codes,
                units: options.units,
                origin: options.origin,
                is_packed: format == CacheFormat::Usdz,
                surface: options.surface.clone(),
            };
            let cage = options.cage.as_ref();
            let of_cage = cage.map(|cage| (cage.points, &cage.faces));
            let mesh = usd::MeshWriter::new(file, (announced.points, faces), of_cage, scene).map_err(write)?;
            if format == CacheFormat::Usdz && mesh.size(announced.frames) > LONGEST_PACKAGE {
                return Err(too_long().at(path));
            }
            let cage = cage.map(|cage| Announced { points: cage.points, path: path.clone(), ..*announced });
            return Ok(Self { mesh: Mesh::Usd(Box::new(mesh)), cage });
        }
        let step = options.even_step();
        let numbers = if step.is_some() { vec![options.number(0)] } else { options.numbers.clone() };
        let schedule = Schedule { fps: options.fps, numbers, step };
        let (points, surface, origin) = (announced.points, &options.surface, options.origin);
        let scene = alembic::Scene { name: &name, points, faces, surface, schedule, origin };
        let mesh = alembic::MeshWriter::new(file, scene).map_err(write)?;
        Ok(Self { mesh: Mesh::Alembic(Box::new(mesh)), cage: None })
    }
}

fn check(announced: &Announced, format: CacheFormat, faces: &Polygons, surface: &Surface) -> Result<(), Fault> {
    let most = i32::MAX as usize;
    if announced.points > most || announced.frames > most || faces.indices().len() > most {
        let what = format!("cannot count more than {most} frames, points or corners; write .npy instead");
        return Err(Fault::unsupported(what));
    }
    let bytes = announced.frames.saturating_mul(12 * announced.points + 64).saturating_add(8 * faces.indices().len());
    if format == CacheFormat::Usdz && bytes > LONGEST_PACKAGE {
        return Err(too_long());
    }
    check_faces(faces, announced.points, "")?;
    let what = |what| Fault::invalid(format!("cannot have what lies on the faces ({what}); give that of this mesh"));
    surface.check(announced.points, faces).map_err(what)
}

fn too_long() -> Fault {
    Fault::unsupported("cannot hold more than 4 GiB, as packages have no room for more; write .usdc instead")
}

fn check_cage(cage: &CageMesh) -> Result<(), Fault> {
    if cage.points == 0 || cage.points > i32::MAX as usize {
        return Err(Fault::invalid(format!("cannot have a cage of {} points", cage.points)));
    }
    check_faces(&cage.faces, cage.points, " of the cage")
}

/// The name of the mesh: that of the file, with `_` for what names in Maya cannot have.
pub(super) fn name(path: &Path) -> String {
    const MOST: usize = 64;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let plain = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).take(MOST);
    let name: String = plain.collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("mesh_{name}") }
}

impl Output for SceneWriter {
    fn write(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error> {
        let written = match &mut self.mesh {
            Mesh::Alembic(mesh) => mesh.write_frame(positions),
            Mesh::Usd(mesh) => mesh.write_frame(positions, false),
            Mesh::Over(mesh) => mesh.write_frame(positions),
        };
        written.map_err(|cause| Error::write(&announced.path, cause))
    }

    fn write_cage(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error> {
        let (Mesh::Usd(mesh), Some(cage)) = (&mut self.mesh, &mut self.cage) else {
            return Err(no_cage(&announced.path));
        };
        cage.admit(positions)?;
        mesh.write_frame(positions, true).map_err(|cause| Error::write(&announced.path, cause))?;
        cage.written += 1;
        Ok(())
    }

    fn keeps_surface(&self) -> bool {
        true
    }

    fn lost(&self, surface: &Surface) -> Vec<String> {
        if !matches!(self.mesh, Mesh::Alembic(_)) {
            return Vec::new();
        }
        // Archives have the names of materials alone, those of sets of faces.
        let is_lost = |found: &&Material| **found != Material { name: found.name.clone(), ..Material::default() };
        let count = surface.materials.iter().filter(is_lost).count();
        (count > 0).then(|| format!("the values and pictures of {}", counted(count, "material"))).into_iter().collect()
    }

    fn finish(self: Box<Self>, announced: &Announced) -> Result<(), Error> {
        self.cage.map_or(Ok(()), |cage| cage.check_complete())?;
        let finished = match self.mesh {
            Mesh::Alembic(mesh) => mesh.finish(),
            Mesh::Usd(mesh) => mesh.finish(),
            Mesh::Over(mesh) => mesh.finish(),
        };
        finished.map_err(|cause| Error::write(&announced.path, cause))?.commit()
    }
}
