//! Opening a capture's files: checks for gaps and for frames that depart from those before, and
//! adapts axes, welded points, frame rate and frame numbers.

use crate::belonging::{Belonging, Pass};
use crate::origin::{move_to, own_origin};
use crate::timing::Timing;
use cager_cages::diagnosis::weld;
use cager_formats::{Error, FrameReader, FrameSelection, PictureSequence, missing_frames, open_selected_frames};
use cager_geometry::mesh::Model;
use cager_geometry::units::{Change, Units, Up};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// The files of a capture, and how to adapt them.
#[derive(Clone, Debug, Default)]
pub struct CaptureFiles {
    /// A folder or pattern of mesh files, or a point cache: see [`open_selected_frames`].
    pub path: PathBuf,
    /// Points of the rest pose.
    pub points: usize,
    /// Which files and frames there are taken.
    pub selection: FrameSelection,
    /// Whether gaps in the numbers of the files are allowed.
    pub allow_gaps: bool,
    /// The up axis of the frames, if it differs from that of the rest pose and files do not say it.
    pub up: Option<Up>,
    /// What the file of the rest pose says of its positions: frames that say something else are
    /// changed to it.
    pub rest_units: Units,
    /// Metres of one unit, for those of both that do not say it.
    pub metres_per_unit: Option<f64>,
    /// If the rest pose was welded: for each original point, its index after welding.
    pub weld: Option<Vec<u32>>,
    /// Frame rate and number of the first frame, where they are given.
    pub timing: Timing,
    /// Frames in which each part is shown, once the frames were compared with the rest pose: see
    /// [`FrameReader::shown`].
    pub shown: Vec<Option<Vec<Range<u32>>>>,
    /// Pictures of materials that are not the same in all frames, likewise: see
    /// [`FrameReader::pictures`].
    pub pictures: Vec<PictureSequence>,
    /// What is subtracted from all positions, where the rest pose lies far away.
    pub origin: Option<[f64; 3]>,
    /// What every frame is compared with as it is read, if anything.
    pub belonging: Option<Arc<Belonging>>,
    /// What messages add for the user of a program.
    pub hints: Hints,
}

/// Ends of messages that say in the words of a program how its user goes on all the same, such as
/// ", or pass --force to go on".
#[derive(Clone, Copy, Debug, Default)]
pub struct Hints {
    /// Where a frame does not look like those before.
    pub mismatch: &'static str,
    /// Where numbers are missing from the names of the files.
    pub gaps: &'static str,
}

impl CaptureFiles {
    /// The files as they are.
    pub fn new(path: impl Into<PathBuf>, points: usize) -> Self {
        Self { path: path.into(), points, ..Self::default() }
    }

    /// Takes the rest pose and the frames to an origin of their own where the rest pose lies far
    /// away.
    pub fn take_origin(&mut self, rest: &mut Model) {
        self.origin = own_origin(&rest.points);
        move_to(self.origin, &mut rest.points);
    }

    /// Merges the points of the rest pose that seams split, and those of frames that have them
    /// split too.
    pub fn weld(&mut self, rest: &mut Model) {
        if let Some(welded) = weld(rest) {
            *rest = welded.model;
            self.points = rest.points.len();
            self.weld = Some(welded.target);
        }
    }

    /// What positions of the rest pose mean, as its file says or else [`Self::metres_per_unit`].
    pub fn meaning(&self) -> Units {
        self.rest_units.or(Units { metres_per_unit: self.metres_per_unit, up: None })
    }

    /// Opens the frames from the first.
    ///
    /// # Errors
    /// Those of [`open_selected_frames`]; numbers that are missing.
    pub fn open(&self) -> Result<Box<dyn FrameReader>, Error> {
        let (inner, first_of) = self.open_welded()?;
        let found: Vec<f64> = (0..inner.frames()).map(|frame| inner.number(frame)).collect();
        if let Some(missing) = missing_frames(&found).filter(|_| !self.allow_gaps && !inner.numbers_are_times()) {
            let many = missing.contains([',', ' ']);
            let (frames, are) = if many { ("frames", "are") } else { ("frame", "is") };
            let what = format!("{frames} {missing} {are} missing; add the files{}", self.hints.gaps);
            return Err(Error::Invalid { path: self.path.clone(), what });
        }
        let numbers = self.timing.numbers(found);
        let frame_rate = self.timing.fps.or(inner.frame_rate());
        let (change, units) = self.placed(inner.units());
        Ok(Box::new(Adapted {
            inner,
            files: self.clone(),
            first_of,
            numbers,
            frame_rate,
            change,
            units,
            frame: 0,
            values: Vec::new(),
            pass: self.belonging.clone().map(Pass::new),
        }))
    }

    /// What makes positions of frames that say this those of the rest pose, and what both mean
    /// then.
    fn placed(&self, said: Units) -> (Change, Units) {
        let unit = Units { metres_per_unit: self.metres_per_unit, up: None };
        let (frames, rest) = (said.or(unit), self.meaning());
        // Whoever tells the axis knows better than files that contradict it.
        let told = self.up.map(Up::other);
        let mut change = frames.change_to(rest);
        change.turn_to = told.or(change.turn_to);
        let units = rest.or(Units { up: told, metres_per_unit: None }).or(frames);
        (change, units)
    }

    /// The reader; and if the frames have unwelded points, for each welded point its first original
    /// point.
    fn open_welded(&self) -> Result<Welded, Error> {
        let Some(weld) = &self.weld else { return Ok((self.open_with(self.points)?, None)) };
        // The number of points in a file sequence is known only after reading a file.
        let reads = |points| self.open_with(points).and_then(|mut reader| reader.read_next(&mut Vec::new()));
        let merged = match reads(weld.len()) {
            Ok(_) => false,
            Err(Error::PointCount { .. }) => true,
            // Of arrays, which one is read depends on the points.
            Err(_) => reads(self.points).is_ok(),
        };
        if merged {
            return Ok((self.open_with(self.points)?, None));
        }
        let mut first_of = vec![u32::MAX; self.points];
        for (point, &welded) in weld.iter().enumerate().rev() {
            first_of[welded as usize] = point as u32;
        }
        Ok((self.open_with(weld.len())?, Some(first_of)))
    }

    fn open_with(&self, points: usize) -> Result<Box<dyn FrameReader>, Error> {
        open_selected_frames(&self.path, points, &self.selection)
    }
}

/// As returned by `open_welded`.
type Welded = (Box<dyn FrameReader>, Option<Vec<u32>>);

/// Converts frames to the points and axes of the rest pose, and checks that they fit single
/// precision.
struct Adapted {
    inner: Box<dyn FrameReader>,
    files: CaptureFiles,
    first_of: Option<Vec<u32>>,
    numbers: Vec<f64>,
    frame_rate: Option<f64>,
    /// To the unit and the axes of the rest pose.
    change: Change,
    /// What positions mean then.
    units: Units,
    frame: usize,
    /// A frame before it is welded.
    values: Vec<f64>,
    /// How the comparison of the frames goes on.
    pass: Option<Pass>,
}

impl FrameReader for Adapted {
    fn points(&self) -> usize {
        self.files.points
    }

    fn frames(&self) -> usize {
        self.inner.frames()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    fn number(&self, frame: usize) -> f64 {
        self.numbers.get(frame).copied().unwrap_or(frame as f64)
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.inner.notes();
        notes.extend(self.brought_together());
        notes
    }

    fn units(&self) -> Units {
        self.units
    }

    fn shown(&self) -> Vec<Option<Vec<Range<u32>>>> {
        self.inner.shown()
    }

    fn pictures(&self) -> Vec<PictureSequence> {
        self.inner.pictures()
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        if !self.inner.read_next(out)? {
            return Ok(false);
        }
        if let Some(first_of) = &self.first_of {
            std::mem::swap(out, &mut self.values);
            let points: &[[f64; 3]] = self.values.as_chunks().0;
            out.clear();
            out.extend(first_of.iter().flat_map(|&point| points[point as usize]));
        }
        self.change.apply_to(out.as_chunks_mut().0);
        if let Some(at) = out.iter().position(|x| x.abs() > f64::from(f32::MAX)) {
            let what = format!(
                "frame {}: point {} has the coordinate {:e}, too large for single precision; repair the frame or scale the capture down",
                self.frame,
                at / 3,
                out[at]
            );
            return Err(Error::Invalid { path: self.files.path.clone(), what });
        }
        move_to(self.files.origin, out.as_chunks_mut().0);
        self.frame += 1;
        self.compare(out)?;
        Ok(true)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.inner.skip()?;
        self.frame += usize::from(more);
        if let Some(pass) = &mut self.pass {
            pass.skipped();
        }
        Ok(more)
    }
}

impl Adapted {
    /// What is to be said where the files say other units or axes than the rest pose, and positions
    /// are changed for it.
    fn brought_together(&self) -> Option<String> {
        let own = Change { turn_to: self.change.turn_to.filter(|_| self.files.up.is_none()), ..self.change };
        let path = self.files.path.display();
        (!own.is_none())
            .then(|| format!("{path}: its frames are {own}, as its unit and axes are not those of the rest pose"))
    }

    /// Compares the frame that was just read with those before.
    fn compare(&mut self, frame: &[f64]) -> Result<(), Error> {
        let Some(pass) = &mut self.pass else { return Ok(()) };
        let mesh = self.inner.mesh();
        let welded = mesh.zip(self.first_of.as_ref().and(self.files.weld.as_deref()));
        let welded = welded.map(|((_, faces), weld)| faces.renamed(weld));
        let faces = welded.as_ref().or(mesh.map(|(_, faces)| faces));
        let path = mesh.map_or(self.files.path.as_path(), |(path, _)| path);
        let number = self.inner.number(self.frame - 1);
        if !pass.compare(frame.as_chunks().0, faces, path, number)? {
            return Ok(());
        }
        // What was skipped is read now, so that the first frame is named that departs; or growth
        // turns out to be one.
        self.pass = None;
        let mut all = self.files.open()?;
        while all.read_next(&mut self.values)? {}
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_formats::{FrameOptions, ScratchDir, create_frames};
    use cager_geometry::mesh::Polygons;

    const CENTIMETRES: Units = Units::new(Up::Z, 0.01);
    const INCHES: Units = Units { up: None, metres_per_unit: Some(0.0254) };

    /// The first point of a capture whose only one is (100, 200, 300), what it means, and what is
    /// said of it.
    fn read(name: &str, adapt: impl FnOnce(&mut CaptureFiles)) -> ([f64; 3], Units, Vec<String>) {
        let folder = ScratchDir::create(std::env::temp_dir()).expect("a folder");
        let path = folder.path().join(name);
        let options = FrameOptions { units: CENTIMETRES, ..FrameOptions::default() };
        let mut writer = create_frames(&path, 1, 1, &Polygons::new(), &options).expect("a file");
        writer.write_frame(&[100.0, 200.0, 300.0]).expect("a frame");
        writer.finish().expect("a file");
        let mut files = CaptureFiles::new(&path, 1);
        adapt(&mut files);
        let mut reader = files.open().expect("a capture");
        let mut values = Vec::new();
        assert!(reader.read_next(&mut values).expect("a frame"));
        ([values[0], values[1], values[2]], reader.units(), reader.notes())
    }

    #[test]
    fn a_capture_is_brought_to_the_units_of_its_rest_pose_once_and_told() {
        let (point, units, notes) = read("a.usdc", |files| files.rest_units = Units::METRES);
        assert_eq!((point, units), ([1.0, 3.0, -2.0], Units::METRES));
        let [note] = &notes[..] else { panic!("{notes:?}") };
        assert!(note.contains("its frames are scaled by 0.01 and turned to Y up"), "{note}");
        // The option turns it, and it is not turned again.
        let (point, units, notes) = read("a.usdc", |files| {
            (files.rest_units, files.up) = (Units::METRES, Some(Up::Z));
        });
        assert_eq!((point, units), ([1.0, 3.0, -2.0], Units::METRES));
        assert!(notes[0].contains("scaled by 0.01,"), "{notes:?}");
    }

    #[test]
    fn what_one_file_does_not_say_is_as_in_the_other_or_as_it_is_told() {
        let as_it_is = [100.0, 200.0, 300.0];
        assert_eq!(read("a.usdc", |_| ()), (as_it_is, CENTIMETRES, Vec::new()));
        assert_eq!(read("a.usdc", |files| files.rest_units = CENTIMETRES), (as_it_is, CENTIMETRES, Vec::new()));
        assert_eq!(read("a.npy", |_| ()), (as_it_is, Units::UNKNOWN, Vec::new()));
        assert_eq!(read("a.npy", |files| files.rest_units = CENTIMETRES), (as_it_is, CENTIMETRES, Vec::new()));
        assert_eq!(read("a.npy", |files| files.metres_per_unit = Some(0.0254)), (as_it_is, INCHES, Vec::new()));
        let turned = read("a.npy", |files| files.up = Some(Up::Z));
        let y_up = Units { up: Some(Up::Y), metres_per_unit: None };
        assert_eq!(turned, ([100.0, 300.0, -200.0], y_up, Vec::new()));
        let (point, units, notes) = read("a.npy", |files| {
            (files.rest_units, files.metres_per_unit) = (Units::METRES, Some(0.01));
        });
        assert_eq!((point, units, notes.len()), ([1.0, 2.0, 3.0], Units::METRES, 1));
    }
}
