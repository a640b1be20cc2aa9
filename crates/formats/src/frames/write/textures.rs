//! All frames as vertex animation textures in a folder, which are known once all frames are.

use std::io::BufWriter;

use cager_geometry::mesh::Polygons;

use super::collected::{Collected, Collection, MOST_BYTES, check_room};
use super::output::{Announced, FrameOptions, check_precision};
use super::scene::name;
use crate::atomic::{AtomicDir, Target};
use crate::error::{Error, Fault};
use crate::faces::check_faces;
use crate::vat::{self, Scene, Textures};

/// How the names of the files end.
const ENDINGS: [&str; 4] = [".glb", "_vat.png", "_vnrm.png", "-remap_info.json"];

pub(super) struct TextureWriter {
    folder: AtomicDir,
    scene: Scene,
}

impl TextureWriter {
    pub(super) fn create(
        announced: &Announced,
        target: &Target,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<Collected<Self>, Error> {
        let path = &announced.path;
        check_precision(options, path)?;
        check(announced, faces).map_err(|fault| fault.at(path))?;
        let step = options.even_step();
        let note = step.is_none().then(|| "its frames are played at even times, as images have no others".to_owned());
        let change = options.change_to_metres();
        let scene = Scene {
            name: name(path),
            triangles: faces.triangulated(),
            fps: options.fps / step.unwrap_or(1.0),
            origin: change.apply(options.origin.unwrap_or_default()),
        };
        let is_own = |name: &str| ENDINGS.iter().any(|ending| name.ends_with(ending));
        let folder = AtomicDir::create(path, |name| target.replaces() && is_own(name))?;
        Ok(Collected::new(Self { folder, scene }, change, note))
    }
}

impl Collection for TextureWriter {
    fn write(&mut self, announced: &Announced, frames: &[f32]) -> Result<Option<String>, Error> {
        let path = &announced.path;
        let textures = Textures::of(frames, announced.points, &self.scene).map_err(|fault| fault.at(path))?;
        let create = |name: &str| Ok(BufWriter::with_capacity(1 << 16, self.folder.create_file(name)?));
        textures.write(create).map_err(|cause| Error::write(path, cause))?;
        Ok(Some(format!("points are within {:.1e} of the frames (16 bits a coordinate)", textures.rounding())))
    }

    fn commit(self) -> Result<(), Error> {
        self.folder.commit()
    }
}

fn check(announced: &Announced, faces: &Polygons) -> Result<(), Fault> {
    let Announced { points, frames, .. } = *announced;
    let form = format!("images, which takes more than {} MB", MOST_BYTES >> 20);
    check_room(announced, frames.saturating_mul(12 * points), &form)?;
    vat::check(points, frames)?;
    check_faces(faces, points, "")
}
