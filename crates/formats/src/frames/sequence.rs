//! A capture with each frame in a file of its own.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cager_geometry::mesh::{Model, Polygons};
use cager_geometry::surface::shown_in;
use cager_geometry::units::Units;

use super::merged::Merged;
use super::names::Sequence;
use super::vanished::Parts;
use super::{FrameReader, FrameSelection, PictureSequence, cut, npz, pictures, single};
use crate::error::{Error, Fault};
use crate::mesh::{FrameFaces, MeshFormat, read_frame_file};

/// Reads positions, and the faces to compare them.
pub(super) struct SequenceReader {
    sequence: Sequence,
    points: usize,
    notes: Vec<String>,
    /// The array or the meshes that are read of each file, where it has several.
    prims: Vec<String>,
    /// Whether that is an array of the first file, so that each has one.
    is_array_named: bool,
    /// What the first file says of all.
    frame_rate: Option<f64>,
    units: Units,
    next: usize,
    /// Whether the last line of the text read last has an end, with its frame and file.
    before: Option<(bool, usize, PathBuf)>,
    /// Of the frame that was read last; none where its file has none that can be read.
    faces: FrameFaces,
    merged: Merged,
    /// Of the rest pose, where it has several.
    parts: Option<Parts>,
    rest: Option<Arc<Model>>,
}

impl SequenceReader {
    /// `notes` are what the user should know of the choice of these files.
    pub(super) fn new(sequence: Sequence, points: usize, notes: Vec<String>, selection: &FrameSelection) -> Self {
        let (first, prim) = (sequence.files.first(), selection.prim());
        // Each file has the array that is read of the first.
        let unnamed = first.filter(|path| single::is_array(path) && !prim.is_some_and(|name| npz::holds(path, name)));
        let read_first = unnamed.and_then(|path| npz::array_read(path, points));
        let prims = read_first.map_or_else(|| selection.prims.clone(), |array| vec![array]);
        let (faces, merged) = (FrameFaces::default(), Merged::default());
        let (frame_rate, units) = (None, Units::UNKNOWN);
        let is_array_named = first.zip(prims.first()).is_some_and(|(path, name)| npz::holds(path, name));
        let (next, before) = (0, None);
        let (parts, rest) = (Parts::of(selection.rest.as_ref(), points), selection.rest.clone());
        let mut opened = Self {
            sequence,
            points,
            notes,
            prims,
            is_array_named,
            frame_rate,
            units,
            next,
            before,
            faces,
            merged,
            parts,
            rest,
        };
        let first = opened.sequence.files.first();
        // All files are of one format. What is wrong with one is said when it is read.
        match first.map(|path| (MeshFormat::guess(path), opened.open(path))) {
            Some((Some(MeshFormat::Glb), _)) => opened.units = Units::METRES,
            Some((None, Ok(reader))) => (opened.frame_rate, opened.units) = (reader.frame_rate(), reader.units()),
            _ => {}
        }
        opened
    }

    /// Opens a file that is no mesh.
    fn open(&self, path: &Path) -> Result<Box<dyn FrameReader>, Error> {
        let selection =
            FrameSelection { prims: self.prims.clone(), rest: self.rest.clone(), ..FrameSelection::default() };
        single::open_cache(path, self.points, &selection, true)
    }

    fn read_capture(&mut self, path: &Path, out: &mut Vec<f64>) -> Result<(), Error> {
        let frame = self.next;
        let named = |error: Error| match error {
            Error::PointCount { path, expected, found, .. } => {
                Error::PointCount { path, frame: Some(frame), expected, found }
            }
            Error::NonFinite { path, point, .. } => Error::NonFinite { path, frame, point },
            other => other.in_frame(frame),
        };
        if let Some(name) = self.prims.first().filter(|name| self.is_array_named && !npz::holds(path, name)) {
            let first = self.sequence.files[0].display();
            let own = npz::array_read(path, self.points);
            let own = own.map_or_else(String::new, |own| format!(" and is read there, but {own:?}"));
            let what = format!("has no array {name:?}, as {first} has{own}; leave it out, or save the array in it");
            return Err(named(Fault::invalid(what).at(path)));
        }
        let mut reader = self.open(path).map_err(named)?;
        if reader.frames() != 1 {
            let cure = if single::is_array(path) {
                "join the arrays in Python with numpy.concatenate"
            } else {
                "export one frame to each file"
            };
            let what = format!(
                "frame {frame}: has {} frames, where a folder of several files has one in each; name this file alone, \
                 or {cure}",
                reader.frames()
            );
            return Err(Fault::unsupported(what).at(path));
        }
        if reader.units() != self.units {
            let what = format!(
                "frame {frame}: says another unit or upward axis than {}; export all frames alike",
                self.sequence.files[0].display()
            );
            return Err(Fault::invalid(what).at(path));
        }
        reader.read_next(out).map_err(named)?;
        let faces = reader.mesh().map(|(_, faces)| faces.clone()).unwrap_or_default();
        self.faces = FrameFaces::default();
        self.faces.faces = faces;
        Ok(())
    }

    fn read_mesh(&mut self, path: &Path, out: &mut Vec<f64>) -> Result<(), Error> {
        let frame = self.next;
        let mut model = read_frame_file(path, &mut self.faces)
            .and_then(|model| self.merged.apply(model, path, &self.sequence.files, self.points))
            .map_err(|error| error.in_frame(frame))?;
        let whole = cut::last_line_ends(path).map_err(|cause| Error::read(path, cause))?;
        match &mut self.parts {
            Some(parts) if model.points.len() == self.points => parts.keep(&model.points),
            Some(parts) => model = parts.complete(path).unwrap_or(model),
            None => {}
        }
        let found = model.points.len();
        if found != self.points {
            if found < self.points && whole == Some(false) {
                let why = format!("after {found} of {} points, so it was cut, or is of another mesh", self.points);
                return Err(cut::in_last_line(path, frame, &why));
            }
            let (path, frame) = (path.to_owned(), Some(frame));
            return Err(Error::PointCount { path, frame, expected: self.points, found: found as u64 });
        }
        // A file with all the faces of the one before is whole, however it ends.
        let complete = !model.faces.is_empty() && model.faces == self.faces.faces;
        if let Some(whole) = whole.filter(|_| !complete) {
            let why = "where other frames end with a line break, so it was cut";
            match &self.before {
                Some((true, ..)) if !whole => return Err(cut::in_last_line(path, frame, why)),
                Some((false, frame, cut)) if whole => return Err(cut::in_last_line(cut, *frame, why)),
                _ => self.before = Some((whole, frame, path.to_owned())),
            }
        }
        out.extend_from_slice(model.points.as_flattened());
        self.faces.faces = model.faces;
        Ok(())
    }
}

impl FrameReader for SequenceReader {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.sequence.files.len()
    }

    fn number(&self, frame: usize) -> f64 {
        let told = self.sequence.numbers.as_ref().and_then(|numbers| numbers.get(frame));
        told.copied().unwrap_or(frame as f64)
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    fn units(&self) -> Units {
        self.units
    }

    fn shown(&self) -> Vec<Option<Vec<Range<u32>>>> {
        let Some(parts) = &self.parts else { return Vec::new() };
        let files = &self.sequence.files;
        if files.first().is_some_and(|path| MeshFormat::guess(path).is_some()) {
            return parts.shown(files);
        }
        let of_file = |path: &PathBuf| self.open(path).map_or_else(|_| Vec::new(), |reader| reader.shown());
        let of_files: Vec<_> = files.iter().map(of_file).collect();
        let is_shown = |shown: &Vec<Option<Vec<Range<u32>>>>, part: usize| {
            shown.get(part).is_none_or(|ranges| ranges.as_ref().is_none_or(|ranges| !ranges.is_empty()))
        };
        (0..parts.count()).map(|part| shown_in(of_files.iter().map(|shown| is_shown(shown, part)))).collect()
    }

    fn pictures(&self) -> Vec<PictureSequence> {
        pictures::of_files(&self.sequence.files)
    }

    fn mesh(&self) -> Option<(&Path, &Polygons)> {
        Some((self.sequence.files.get(self.next.checked_sub(1)?)?, &self.faces.faces))
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        out.clear();
        let Some(path) = self.sequence.files.get(self.next).cloned() else {
            return Ok(false);
        };
        if MeshFormat::guess(&path).is_some() {
            self.read_mesh(&path, out)?;
        } else {
            self.read_capture(&path, out)?;
        }
        self.next += 1;
        Ok(true)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.next < self.frames();
        self.next += usize::from(more);
        Ok(more)
    }
}
