//! Decodes containers to positions.

mod animation;
mod bind;
pub mod joined;
pub(crate) mod opened;
pub(crate) mod units;

pub use animation::Animation;
pub use opened::{Container, DecodeError, open, open_cut};

use bind::{BoundModel, bind};

use crate::edited::EditedCages;
use crate::memory::{Memory, free_bytes};
use crate::origin::MAX_ROUNDING_ERROR;
use crate::timing::Timing;
use cager_core::inversion::BATCH;
use cager_formats::{
    CageMesh, FrameOptions, FrameRange, FrameWriter, MorphOptions, Target, chosen_parts, create_frames,
};
use cager_geometry::mesh::{Model, Polygons, diagonal};
use cager_geometry::surface::Surface;
use cager_geometry::units::{Change, Units};
use cager_proto::container;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What to decode, if not all frames of the container with its own model and cages.
#[derive(Default)]
pub struct Decoding<'a> {
    /// Another model within the rest cage, and the file that it comes from.
    pub model: Option<(&'a Path, &'a Model)>,
    /// Edited cages.
    pub cages: Option<EditedCages>,
    /// Only these frames.
    pub range: Option<FrameRange>,
    /// Frame rate and number of the first frame, where they are given.
    pub timing: Timing,
    /// Whether to read and validate only.
    pub dry_run: bool,
    /// Memory limit; by default half of the free memory.
    pub memory: Option<Memory>,
    /// How much of the file is decoded.
    pub layer: Layer,
    /// Whether damaged and missing frames are left out instead of refused.
    pub salvage: bool,
    /// How a `.glb` holds the frames.
    pub morphs: MorphOptions,
    /// Whether the cage is kept beside the model, which USD alone does.
    pub with_cage: bool,
    /// The file of USD whose meshes get the points: the output is a layer on top of it.
    pub onto: Option<PathBuf>,
    /// Parts of the model that are written, by paths, names or globs of these: all where there are
    /// none.
    pub parts: Vec<String>,
    /// Unit and upward axis that positions are brought to; else the container's.
    pub units: Units,
}

/// How much of a coded file is decoded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Layer {
    /// What the cages say alone.
    Cages,
    /// Everything that is there.
    #[default]
    All,
}

impl Decoding<'_> {
    /// Whether it is the file's own model in its own frames, which alone the residual is of.
    fn own(&self) -> bool {
        self.model.is_none() && self.has_own_frames()
    }

    /// Whether no edited cages take the place of all frames.
    fn has_own_frames(&self) -> bool {
        self.cages.as_ref().is_none_or(|cages| !cages.replaces_frames(None))
    }
}

/// Result of [`decode`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoded {
    /// Points of every frame.
    pub points: usize,
    /// Number of frames.
    pub frames: usize,
    /// Points of another model that lie outside the rest cage.
    pub outside: usize,
    /// Points of another model beside poles of the coordinates, bound to the file's own model.
    pub bound: usize,
    /// Frames of the file that were left out because they are damaged, from 0.
    pub damaged: Vec<usize>,
    /// Whether the numbers of the file's frames are damaged, so that they are counted from 0.
    pub numbers_lost: bool,
    /// What the user should know of the output, such as what it loses.
    pub notes: Vec<String>,
}

/// Frame rate and numbers of the output; `timing` overrides the container's, which are counted from
/// 0 where they are damaged and may be lost.
pub(crate) fn frame_options(
    container: &mut Container,
    there: usize,
    range: FrameRange,
    timing: Timing,
    may_be_lost: bool,
) -> Result<FrameOptions, container::Error> {
    let fps = timing.fps.or(container.header().frame_rate).unwrap_or(FrameOptions::default().fps);
    let mut found = match container.frame_numbers() {
        Err(container::Error::Corrupt { .. }) if may_be_lost => Vec::new(),
        found => found?,
    };
    if found.len() != there {
        found = (0..there).map(|frame| frame as f64).collect();
    }
    let numbers = timing.numbers(found);
    let numbers = (0..range.count()).filter_map(|place| numbers.get(range.frame(place)).copied()).collect();
    let origin = container.header().origin;
    let rounding = if origin.is_some() { may_lose(container)? } else { 0.0 };
    let units = container.header().units;
    Ok(FrameOptions { fps, numbers, origin, rounding, units, ..FrameOptions::default() })
}

/// What a format may lose where it adds the origin in single precision: what a guaranteed error
/// leaves.
fn may_lose(container: &mut Container) -> Result<f64, container::Error> {
    Ok(diagonal(&container.rest()?.points) * left_by_bound(container)?.unwrap_or(MAX_ROUNDING_ERROR))
}

/// What a guaranteed error leaves, as a share of the diagonal; `None` where none is known.
fn left_by_bound(container: &mut Container) -> Result<Option<f64>, container::Error> {
    let report = match container.report() {
        Err(container::Error::Corrupt { .. }) => return Ok(None),
        found => found?,
    };
    let Some(bound) = report.coding.and_then(|coding| coding.max_error) else { return Ok(None) };
    // Errors of flattened frames are not known.
    let known = |error: f64| if error.is_nan() { bound } else { error };
    let largest = container.errors()?.iter().fold(0.0, |largest: f64, error| largest.max(known(error.linf)));
    Ok(Some((bound - largest).max(0.0)))
}

/// How many frames of so many points are decoded at a time.
fn batch(memory: Memory, points: usize) -> usize {
    memory.frames(12 * points, BATCH)
}

/// A container with the frames that are to be decoded of it.
struct Chosen<'a> {
    container: Container,
    path: &'a Path,
    what: Decoding<'a>,
    /// Their places in the container, or among the edited cages.
    wanted: Vec<usize>,
    options: FrameOptions,
    /// What makes positions those of the output.
    change: Change,
    damaged: Vec<usize>,
    numbers_lost: bool,
    /// The points that are written, where these are not all.
    points: Option<Vec<Range<usize>>>,
    /// What the user should know of what is read.
    notes: Vec<String>,
}

impl<'a> Chosen<'a> {
    fn open(path: &'a Path, what: Decoding<'a>) -> Result<Self, DecodeError> {
        let fail = |cause| DecodeError::container(path, cause);
        let Decoding { ref cages, range, timing, salvage, .. } = what;
        let mut container = if salvage { open_cut(path) } else { open(path) }?;
        container.limit_coordinates(free_bytes());
        let there = cages.as_ref().map_or(container.frames(), EditedCages::frames);
        range.map_or(Ok(()), |range| range.check(there, |frame| frame as f64, path))?;
        let taken = range.unwrap_or(FrameRange::all(there));
        let mut wanted: Vec<usize> =
            if there == 0 { Vec::new() } else { (0..taken.count()).map(|k| taken.frame(k)).collect() };
        let mut options = frame_options(&mut container, there, taken, timing, salvage).map_err(fail)?;
        let change = units::convert(&mut options, what.units, path)?;
        options.onto.clone_from(&what.onto);
        if what.with_cage {
            let cage = container.cage().map_err(fail)?;
            let faces = Polygons::of_triangles(&cage.triangles);
            options.cage = Some(CageMesh { points: cage.vertices.len(), faces });
        }
        let numbers_lost = salvage && container.frame_numbers().is_err();
        let mut damaged = Vec::new();
        if salvage && what.has_own_frames() {
            damaged = wanted.clone();
            damaged.retain(|&frame| !container.is_intact(frame, what.own() && what.layer == Layer::All));
            let mut at = wanted.iter();
            options.numbers.retain(|_| at.next().is_none_or(|frame| !damaged.contains(frame)));
            wanted.retain(|frame| !damaged.contains(frame));
            if wanted.is_empty() {
                let what = match damaged[..] {
                    [] => "it ends before the first".to_owned(),
                    [frame] => format!("frame {frame} is damaged"),
                    [first, .., last] => format!("frames {first} to {last} are damaged"),
                };
                return Err(DecodeError::Lost { path: path.to_owned(), what });
            }
        } else {
            // Decoding does not need it, but a damaged file is refused wherever the damage is.
            container.report().map_err(fail)?;
        }
        Ok(Self {
            container,
            path,
            what,
            wanted,
            options,
            change,
            damaged,
            numbers_lost,
            points: None,
            notes: Vec::new(),
        })
    }

    /// How a `.glb` holds the frames: where nothing is asked, to what a guaranteed error leaves.
    fn morphs(&mut self, asked: MorphOptions, rest: &Model) -> Result<MorphOptions, DecodeError> {
        /// The rounding of a sum of targets, which encoders leave room for.
        const LEAST: f64 = 5e-7;
        let asked = MorphOptions { diagonal: Some(diagonal(&rest.points)), ..asked };
        if asked.targets.is_some() || asked.max_error.is_some() || !self.what.own() || self.what.layer != Layer::All {
            return Ok(asked);
        }
        let left = left_by_bound(&mut self.container).map_err(|cause| DecodeError::container(self.path, cause))?;
        Ok(match left {
            Some(left) => MorphOptions { max_error: Some(left.max(LEAST)), is_guarantee: true, floats: true, ..asked },
            None => asked,
        })
    }

    /// The faces to write, and what lies on them among the options: in the order of the source where the file says it.
    fn take_surface(&mut self, bound: &BoundModel) -> Result<Polygons, DecodeError> {
        let own = || (Surface::default(), bound.rest.faces.clone());
        let (mut surface, faces) = match self.what.model {
            Some((_, model)) => (model.surface.clone(), model.faces.clone()),
            None => match self.container.surface() {
                Err(container::Error::Corrupt { .. }) if self.what.salvage => {
                    self.notes.push("its parts, and what lies on their faces, are damaged and left out".to_owned());
                    own()
                }
                found => found.map_err(|cause| DecodeError::container(self.path, cause))?.unwrap_or_else(own),
            },
        };
        if self.what.model.is_none() && !surface.is_empty() {
            surface.pictures = match self.container.pictures() {
                Err(container::Error::Corrupt { .. }) if self.what.salvage => {
                    self.notes.push("its pictures are damaged and left out".to_owned());
                    Vec::new()
                }
                found => found.map_err(|cause| DecodeError::container(self.path, cause))?,
            };
        }
        if self.what.has_own_frames() {
            surface.take_frames(&self.wanted);
        } else {
            surface.forget_frames();
        }
        if self.what.parts.is_empty() {
            self.options.surface = surface;
            return Ok(faces);
        }
        let paths: Vec<&str> = surface.parts.iter().map(|part| part.path.as_str()).collect();
        let chosen = chosen_parts(&paths, &self.what.parts)
            .map_err(|what| DecodeError::Parts { path: self.path.to_owned(), what })?;
        let chosen = surface.choose(&faces, |k| chosen[k]);
        (self.options.surface, self.points) = (chosen.surface, Some(chosen.points));
        Ok(chosen.faces)
    }

    /// How many points are written of so many.
    fn points(&self, all: usize) -> usize {
        self.points.as_ref().map_or(all, |ranges| ranges.iter().map(ExactSizeIterator::len).sum())
    }

    fn memory(&self) -> Memory {
        self.what.memory.unwrap_or_else(Memory::half_of_free)
    }

    fn bind(&mut self) -> Result<BoundModel, DecodeError> {
        let Decoding { model, dry_run, layer, salvage, .. } = self.what;
        let (memory, frames) = (self.memory(), self.wanted.len());
        let keeps = |points, columns| memory.keeps(points, columns, frames.div_ceil(batch(memory, points)));
        let known = match self.wanted.first() {
            Some(&frame) if self.what.own() && layer == Layer::All && !dry_run && !salvage => {
                self.container.read_ahead(frame).map_err(|cause| DecodeError::container(self.path, cause))?
            }
            _ => None,
        };
        bind(&mut self.container, self.path, model, known, keeps)
    }

    /// Writes the frames; `progress` is told the number of those done. A dry run reads them only.
    fn write(
        &mut self,
        BoundModel { rest, decoder, .. }: &BoundModel,
        writer: &mut FrameWriter,
        progress: &mut dyn FnMut(usize),
    ) -> Result<(), DecodeError> {
        let fail = |cause| DecodeError::container(self.path, cause);
        let residual = self.what.own() && self.what.layer == Layer::All;
        let (frames, batch) = (self.wanted.len(), batch(self.memory(), rest.points.len()));
        // Both keep their allocations from batch to batch.
        let mut cages = vec![Vec::new(); batch];
        let mut positions = vec![Vec::new(); batch];
        let mut first = 0;
        while first < frames {
            let count = batch.min(frames - first);
            let wanted = &self.wanted[first..first + count];
            for (&frame, cage) in wanted.iter().zip(&mut cages) {
                match &mut self.what.cages {
                    Some(edited) if edited.replaces_frames(None) => edited.read_frame(frame, cage)?,
                    edited => {
                        self.container.read_frame(frame, cage).map_err(fail)?;
                        edited.as_mut().map_or(Ok(()), |edited| edited.move_frame(frame, cage))?;
                    }
                }
            }
            if !self.what.dry_run {
                let views: Vec<&[f32]> = cages[..count].iter().map(Vec::as_slice).collect();
                decoder.decode(&views, &mut positions[..count]);
                if residual {
                    self.container.add_residual(wanted, &mut positions[..count]).map_err(fail)?;
                }
                for frame in &mut positions[..count] {
                    if let Some(points) = &self.points {
                        let mut kept = 0;
                        for points in points {
                            frame.copy_within(3 * points.start..3 * points.end, kept);
                            kept += 3 * points.len();
                        }
                        frame.truncate(kept);
                    }
                    units::apply(&self.change, frame);
                    writer.write_frame(frame)?;
                }
                if let Some(mesh) = &self.options.cage {
                    for cage in &mut cages[..count] {
                        // Normals of the cage follow, where there are any.
                        let vertices = &mut cage[..3 * mesh.points];
                        units::apply(&self.change, vertices);
                        writer.write_cage(vertices)?;
                    }
                }
            }
            first += count;
            progress(first);
        }
        Ok(())
    }
}

/// Decodes frames into `output`, which appears complete or not at all; `progress` counts them.
///
/// # Errors
/// See [`DecodeError`].
pub fn decode(
    input: &Path,
    output: impl Into<Target>,
    what: Decoding<'_>,
    progress: &mut dyn FnMut(usize),
) -> Result<Decoded, DecodeError> {
    let dry_run = what.dry_run;
    let output = output.into();
    let path = output.path().to_owned();
    let mut chosen = Chosen::open(input, what)?;
    let bound = chosen.bind()?;
    chosen.options.morphs = chosen.morphs(chosen.what.morphs, &bound.rest)?;
    let faces = chosen.take_surface(&bound)?;
    let (points, frames) = (chosen.points(bound.rest.points.len()), chosen.wanted.len());
    let mut writer = create_frames(output, points, frames, &faces, &chosen.options)?;
    chosen.write(&bound, &mut writer, progress)?;
    let mut notes: Vec<String> = chosen.notes.iter().map(|note| format!("{}: {note}", input.display())).collect();
    notes.extend(writer.notes());
    notes.extend(units::notes(&path, chosen.options.units, chosen.what.units));
    if !dry_run {
        writer.finish()?;
    }
    let Chosen { damaged, numbers_lost, .. } = chosen;
    Ok(Decoded { points, frames, outside: bound.outside, bound: bound.bound, damaged, numbers_lost, notes })
}
