//! What all outputs of frames have: their writer, their options, and what was announced of them.

use std::path::{Path, PathBuf};

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::Surface;
use cager_geometry::units::{Change, Units};

use crate::dropped::{joined, phrases_of};
use crate::error::{Error, Fault};
use crate::frames::RATES;
use crate::pictures::Beside;

/// An output of frames; dropped before [`FrameWriter::finish`] it leaves nothing.
pub struct FrameWriter {
    announced: Announced,
    output: Box<dyn Output>,
    /// What the format has no place for.
    lost: Option<String>,
    pictures: Option<Beside>,
}

impl FrameWriter {
    pub(super) fn new(
        announced: Announced,
        output: Box<dyn Output>,
        (surface, also): (&Surface, Option<String>),
        pictures: Option<Beside>,
    ) -> Self {
        let lost = lost(output.as_ref(), surface, also);
        Self { announced, output, lost, pictures }
    }

    /// Writes the next frame, 3 × points coordinates `x y z x y z …`.
    ///
    /// # Errors
    /// [`Error::PointCount`] for another number of coordinates, [`Error::NonFinite`],
    /// [`Error::FrameCount`] for more frames than announced, [`Error::Unsupported`] where morph
    /// targets lose more than they may, [`Error::Io`].
    pub fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        self.output.write(&self.announced, positions)?;
        self.announced.written += 1;
        Ok(())
    }

    /// Writes the cage of the next frame, 3 × points coordinates, where [`FrameOptions::cage`]
    /// announced one: once for each frame, before or after it.
    ///
    /// # Errors
    /// As [`Self::write_frame`]; [`Error::Unsupported`] where no cage was announced.
    pub fn write_cage(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.output.write_cage(&self.announced, positions)
    }

    /// Goes on with frames of another mesh: the number of its points, its faces, and of the options
    /// its origin and what rounding may lose.
    ///
    /// # Errors
    /// [`Error::Unsupported`] where the output is no folder of mesh files, [`Error::Invalid`] for
    /// no points and faces without their points.
    pub fn change_mesh(&mut self, points: usize, faces: &Polygons, options: &FrameOptions) -> Result<(), Error> {
        self.output.change_mesh(&mut self.announced, points, faces, options)
    }

    /// What the user should know of the output, once all frames are written.
    pub fn notes(&self) -> Vec<String> {
        self.output
            .notes()
            .iter()
            .chain(&self.lost)
            .map(|note| format!("{}: {note}", self.announced.path.display()))
            .collect()
    }

    /// Makes the frames durable and gives the output its name.
    ///
    /// # Errors
    /// [`Error::FrameCount`] for fewer frames than announced, [`Error::Target`], [`Error::Io`]; the
    /// output is then not created.
    pub fn finish(self) -> Result<(), Error> {
        self.announced.check_complete()?;
        self.pictures.map_or(Ok(()), |pictures| pictures.write())?;
        self.output.finish(&self.announced)
    }
}

/// What a format has no place for, in words; `also` is lost too.
fn lost(output: &dyn Output, surface: &Surface, also: Option<String>) -> Option<String> {
    let all = joined(&output.lost(surface).into_iter().chain(also).collect::<Vec<_>>())?;
    let way = if output.keeps_surface() { "" } else { "; write .obj files for them" };
    Some(format!("has no place for {all} of the model{way}"))
}

/// A format of frames, of which each was checked before it is written.
pub(super) trait Output: Send {
    fn write(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error>;

    fn write_cage(&mut self, announced: &Announced, _positions: &[f32]) -> Result<(), Error> {
        Err(no_cage(&announced.path))
    }

    fn change_mesh(
        &mut self,
        announced: &mut Announced,
        _points: usize,
        _faces: &Polygons,
        _options: &FrameOptions,
    ) -> Result<(), Error> {
        let folder = announced.path.with_extension("");
        let folder = if folder == Path::new("-") { Path::new("frames") } else { &folder };
        let what = format!(
            "holds one mesh in all frames, and these have several; name a folder for mesh files, such as {}, or write \
             the frames of each mesh to a file of their own",
            folder.join("").display()
        );
        Err(Fault::unsupported(what).at(&announced.path))
    }

    fn notes(&self) -> &[String] {
        &[]
    }

    /// Whether texture coordinates, materials, groups and hard edges are written.
    fn keeps_surface(&self) -> bool {
        false
    }

    /// What of it is not, in words.
    fn lost(&self, surface: &Surface) -> Vec<String> {
        phrases_of(surface, self.keeps_surface())
    }

    fn finish(self: Box<Self>, announced: &Announced) -> Result<(), Error>;
}

/// What some formats store beside the positions.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameOptions {
    /// Frames per second, for formats with times: 24 by default.
    pub fps: f64,
    /// The number of each frame, ascending; 0, 1, 2, … where empty.
    pub numbers: Vec<f64>,
    /// What is added to all positions, in double precision by the formats that have it.
    pub origin: Option<Point>,
    /// What rounding may lose where an origin is added, in formats of single precision.
    pub rounding: f64,
    /// What the positions mean: USD says it, and glTF is written in metres with Y up.
    pub units: Units,
    /// The cage that is kept beside the mesh, in USD alone.
    pub cage: Option<CageMesh>,
    /// How `.glb` and `.gltf` hold the frames.
    pub morphs: MorphOptions,
    /// What lies on the faces; what a format has no place for is left out, and a note says so.
    pub surface: Surface,
    /// The file of USD whose meshes get the frames: a layer on top of it is written, with points and
    /// normals alone.
    pub onto: Option<PathBuf>,
}

/// A cage that is written as a second mesh, which programs show as a guide and do not render.
#[derive(Clone, Debug, PartialEq)]
pub struct CageMesh {
    /// How many points it has.
    pub points: usize,
    /// Its faces.
    pub faces: Polygons,
}

/// How frames become morph targets: as their principal components, which lose something.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MorphOptions {
    /// Targets at the most, up to 255; 64 by default, or 255 with an error that is to be held.
    pub targets: Option<usize>,
    /// What may be lost, as a share of the diagonal: as few targets are taken as hold it.
    pub max_error: Option<f64>,
    /// Whether that is what a guaranteed error of the capture leaves, and nobody asked for it.
    pub is_guarantee: bool,
    /// The diagonal of the rest pose; that of the mean shape by default.
    pub diagonal: Option<f64>,
    /// Whether positions are floats instead of whole numbers of 16 bits.
    pub floats: bool,
    /// Whether normals are written, of the mean shape and of each target.
    pub normals: bool,
}

impl FrameOptions {
    /// What makes positions those of glTF.
    pub(super) fn change_to_metres(&self) -> Change {
        self.units.change_to(Units::METRES)
    }

    pub(super) fn number(&self, frame: usize) -> f64 {
        self.numbers.get(frame).copied().unwrap_or(frame as f64)
    }

    /// The distance of two frames, where it is the same throughout.
    pub(super) fn even_step(&self) -> Option<f64> {
        let mut steps = self.numbers.windows(2).map(|pair| pair[1] - pair[0]);
        let first = steps.next().unwrap_or(1.0);
        steps.all(|step| (step - first).abs() <= 1e-6 * first).then_some(first)
    }
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self {
            fps: 24.0,
            numbers: Vec::new(),
            origin: None,
            rounding: 0.0,
            units: Units::UNKNOWN,
            cage: None,
            morphs: MorphOptions::default(),
            surface: Surface::default(),
            onto: None,
        }
    }
}

/// Refuses formats of single precision where it loses too much about an origin.
pub(super) fn check_precision(options: &FrameOptions, path: &Path) -> Result<(), Error> {
    let farthest = options.origin.iter().flatten().fold(0.0, |far: f64, x| far.max(x.abs()));
    // By half a unit in the last place of each coordinate.
    let lost = 3f64.sqrt() * farthest * f64::from(f32::EPSILON) / 2.0;
    if lost <= options.rounding {
        return Ok(());
    }
    let what = format!(
        "holds single precision, which moves points by up to {lost:.1e} units so far from the origin, where {:.1e} are \
         allowed; write .npy, or .obj or .ply files, or .abc or .usdc, which place the model by a transform",
        options.rounding
    );
    Err(Fault::unsupported(what).at(path))
}

/// Why an output takes no cage.
pub(super) fn no_cage(path: &Path) -> Error {
    Fault::unsupported("has no cage that was announced; write .usdc or .usdz with one").at(path)
}

/// Announced size of an output, and the number of frames written.
pub(super) struct Announced {
    pub(super) path: PathBuf,
    pub(super) points: usize,
    pub(super) frames: usize,
    pub(super) written: usize,
}

impl Announced {
    pub(super) fn check(&self, options: &FrameOptions) -> Result<(), Fault> {
        if self.points == 0 || self.frames == 0 {
            return Err(Fault::invalid(format!(
                "cannot hold {} frames of {} points; give it at least one of each",
                self.frames, self.points
            )));
        }
        if self.points > u32::MAX as usize {
            return Err(Fault::unsupported(format!(
                "cannot hold {} points, more than {}; reduce the mesh",
                self.points,
                u32::MAX
            )));
        }
        let ascending = options.numbers.windows(2).all(|pair| pair[0] < pair[1]);
        let counted = options.numbers.is_empty() || options.numbers.len() == self.frames;
        if !(ascending && counted && options.numbers.iter().all(|x| x.is_finite())) {
            return Err(Fault::invalid("cannot have these frame numbers; give one for each frame, ascending"));
        }
        if !RATES.contains(&options.fps) {
            return Err(Fault::invalid(format!(
                "cannot have {} frames per second; give a number from 0.001 to 1,000,000",
                options.fps
            )));
        }
        Ok(())
    }

    /// Checks the next frame.
    pub(super) fn admit(&self, positions: &[f32]) -> Result<(), Error> {
        let (path, frame) = (|| self.path.clone(), self.written);
        if self.written == self.frames {
            return Err(Error::FrameCount { path: path(), announced: self.frames, written: self.written + 1 });
        }
        if positions.len() != 3 * self.points {
            let found = (positions.len() / 3) as u64;
            return Err(Error::PointCount { path: path(), frame: Some(frame), expected: self.points, found });
        }
        match positions.iter().position(|x| !x.is_finite()) {
            Some(culprit) => Err(Error::NonFinite { path: path(), frame, point: culprit / 3 }),
            None => Ok(()),
        }
    }

    pub(super) fn check_complete(&self) -> Result<(), Error> {
        if self.written == self.frames {
            return Ok(());
        }
        Err(Error::FrameCount { path: self.path.clone(), announced: self.frames, written: self.written })
    }
}
