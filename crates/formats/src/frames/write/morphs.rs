//! All frames as morph targets of glTF, their principal components.

use std::io::{BufWriter, Write};

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{Subdivision, Surface};

use super::super::CacheFormat;
use super::collected::{Collected, Collection, MOST_BYTES, check_room};
use super::output::{Announced, FrameOptions, MorphOptions, check_precision};
use super::scene::name;
use crate::atomic::{AtomicFile, Target, commit_together};
use crate::dropped::{groups_phrase, listed};
use crate::error::{Error, Fault};
use crate::faces::check_faces;
use crate::glb::{MOST_FRAMES, MorphScene, Morphs, Piece, Wanted, lost_pictures};

pub(super) struct MorphWriter {
    file: AtomicFile,
    /// Of text, the numbers.
    data: Option<AtomicFile>,
    wanted: Wanted,
    scene: MorphScene,
    /// What lies on the faces and has no place.
    lost: Vec<String>,
}

impl MorphWriter {
    pub(super) fn create(
        announced: &Announced,
        target: &Target,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<Collected<Self>, Error> {
        let path = &announced.path;
        check_precision(options, path)?;
        let change = options.change_to_metres();
        let MorphOptions { targets, max_error, is_guarantee, diagonal, floats, normals } = options.morphs;
        let diagonal = diagonal.map(|diagonal| change.scale * diagonal).filter(|&diagonal| diagonal > 0.0);
        let wanted = Wanted { targets, max_error, is_guarantee, diagonal };
        check(announced, faces, &wanted).map_err(|fault| fault.at(path))?;
        let (times, note, at_zero) = times(announced.frames, options).map_err(|fault| fault.at(path))?;
        let (name, surface) = (name(path), &options.surface);
        let pieces = if surface.is_empty() {
            vec![Piece::bare(&name, announced.points, faces, normals)]
        } else {
            Piece::of(surface, faces, &name, normals)
        };
        let scene = MorphScene {
            name,
            pieces,
            materials: surface.materials.clone(),
            times,
            numbering: [at_zero, options.fps],
            origin: change.apply(options.origin.unwrap_or_default()),
            floats,
        };
        let mut lost = lost(surface, faces);
        let hidden = surface.parts.iter().zip(&scene.pieces).filter(|(_, piece)| piece.is_hidden());
        let hidden = hidden.map(|(part, _)| part.path.as_bytes());
        if announced.frames < 2 && hidden.clone().next().is_some() {
            lost.push(format!("what is hidden ({})", listed(hidden)));
        }
        let is_text = CacheFormat::from_path(path) == Some(CacheFormat::Gltf);
        let data = is_text.then(|| AtomicFile::create(target.beside("bin"))).transpose()?;
        let file = AtomicFile::create(target)?;
        Ok(Collected::new(Self { file, data, wanted, scene, lost }, change, note))
    }
}

impl Collection for MorphWriter {
    fn write(&mut self, announced: &Announced, all: &[f32]) -> Result<Option<String>, Error> {
        let Announced { path, points, frames, .. } = announced;
        let morphs = Morphs::of(all, *points, &self.wanted, &self.scene).map_err(|fault| fault.at(path))?;
        let mut out = BufWriter::with_capacity(1 << 16, &mut self.file);
        let written = match &mut self.data {
            None => morphs.write(&mut out),
            Some(data) => {
                let name = path.with_extension("bin");
                let name = name.file_name().unwrap_or_default().to_string_lossy();
                let mut data = BufWriter::with_capacity(1 << 16, data);
                morphs.write_apart(&mut out, &mut data, &name).and_then(|()| data.flush())
            }
        };
        written.and_then(|()| out.flush()).map_err(|cause| Error::write(path, cause))?;
        let found = morphs.deviation();
        Ok((found.targets > 0).then(|| {
            format!(
                "its {} morph targets are {:.1e} of the diagonal from the {frames} frames at most, {:.1e} in the mean \
                 ({})",
                found.targets,
                found.share(found.largest),
                found.share(found.rms),
                if self.scene.floats { "floats" } else { "16 bits a coordinate" },
            )
        }))
    }

    fn lost_of_surface(&self) -> Option<&[String]> {
        Some(&self.lost)
    }

    fn commit(self) -> Result<(), Error> {
        // The numbers first, as the text says that they are there.
        commit_together(self.data.into_iter().chain([self.file]).collect())
    }
}

/// What of a surface has no place.
fn lost(surface: &Surface, faces: &Polygons) -> Vec<String> {
    let parts = || surface.parts.iter();
    let mut lost = Vec::new();
    if parts().any(|part| part.subdivision != Subdivision::None) {
        lost.push("subdivision".to_owned());
    }
    if parts().any(|part| !part.creases.is_empty()) {
        lost.push("creases".to_owned());
    }
    lost.extend(groups_phrase(surface));
    if !surface.is_empty() && faces.arities().iter().any(|&arity| arity > 3) {
        lost.push("faces of more than three corners".to_owned());
    }
    lost.extend(lost_pictures(&surface.materials).into_iter().map(str::to_owned));
    lost
}

fn check(announced: &Announced, faces: &Polygons, wanted: &Wanted) -> Result<(), Fault> {
    let Announced { points, frames, .. } = *announced;
    let targets = wanted.most().min(frames).min(3 * points);
    // Frames and targets, then weights and errors of each frame.
    let bytes = (frames + targets).saturating_mul(12 * points).saturating_add(frames.saturating_mul(32 * targets));
    let bytes = if frames > MOST_FRAMES { usize::MAX } else { bytes };
    let most = format!("takes more than {} MB or more than {MOST_FRAMES} frames", MOST_BYTES >> 20);
    check_room(announced, bytes, &format!("morph targets, which {most}"))?;
    check_faces(faces, points, "")
}

/// The latest time of a first frame that is kept, in seconds: shots often begin with frame 1.
const LATEST_BEGIN: f64 = 1.0;

/// The seconds of frames, in single precision, what is to be said of them, and the number of the
/// frame at 0 s: programs play from there, and would stand still until a late first key, so such
/// frames begin at 0.
fn times(frames: usize, options: &FrameOptions) -> Result<(Vec<f32>, Option<String>, f64), Fault> {
    let first = options.number(0);
    if frames < 2 {
        return Ok((Vec::new(), None, first));
    }
    let is_kept = (0.0..=LATEST_BEGIN).contains(&(first / options.fps));
    let begin = if is_kept { 0.0 } else { first };
    let seconds: Vec<f32> = (0..frames).map(|k| ((options.number(k) - begin) / options.fps) as f32).collect();
    if seconds.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Err(Fault::unsupported(
            "has times in single precision, which cannot tell these frames apart; give a smaller --fps, or write .npy",
        ));
    }
    let note = || format!("frame {first} is at 0 s, where programs begin to play; its number is kept in extras");
    Ok((seconds, (!is_kept).then(note), begin))
}
