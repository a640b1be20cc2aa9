//! Opening a capture's files: checks for gaps and for frames that depart from those before, and adapts axes, welded points, frame rate and
//! frame numbers.

use crate::belonging::{Belonging, Pass};
use crate::mismatch::Up;
use crate::origin::{move_to, own_origin};
use crate::timing::Timing;
use cager_formats::{Error, FrameReader, FrameSelection, missing_frames, open_selected_frames};
use cager_geometry::mesh::Model;
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
    /// The up axis of the frames, if it differs from that of the rest pose.
    pub up: Option<Up>,
    /// If the rest pose was welded: for each original point, its index after welding.
    pub weld: Option<Vec<u32>>,
    /// Frame rate and number of the first frame, where they are given.
    pub timing: Timing,
    /// What is subtracted from all positions, where the rest pose lies far away.
    pub origin: Option<[f64; 3]>,
    /// What every frame is compared with as it is read, if anything.
    pub belonging: Option<Arc<Belonging>>,
}

impl CaptureFiles {
    /// The files as they are.
    pub fn new(path: impl Into<PathBuf>, points: usize) -> Self {
        Self { path: path.into(), points, ..Self::default() }
    }

    /// Takes the rest pose and the frames to an origin of their own where the rest pose lies far away.
    pub fn take_origin(&mut self, rest: &mut Model) {
        self.origin = own_origin(&rest.points);
        move_to(self.origin, &mut rest.points);
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
            let what =
                format!("{frames} {missing} {are} missing; add the files, or pass --allow-gaps to go on without them");
            return Err(Error::Invalid { path: self.path.clone(), what });
        }
        let numbers = self.timing.numbers(found);
        let frame_rate = self.timing.fps.or(inner.frame_rate());
        Ok(Box::new(Adapted {
            inner,
            files: self.clone(),
            first_of,
            numbers,
            frame_rate,
            frame: 0,
            values: Vec::new(),
            pass: self.belonging.clone().map(Pass::new),
        }))
    }

    /// The reader; and if the frames have unwelded points, for each welded point its first original point.
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

/// Converts frames to the points and axes of the rest pose, and checks that they fit single precision.
struct Adapted {
    inner: Box<dyn FrameReader>,
    files: CaptureFiles,
    first_of: Option<Vec<u32>>,
    numbers: Vec<f64>,
    frame_rate: Option<f64>,
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
        self.inner.notes()
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
        if let Some(at) = out.iter().position(|x| x.abs() > f64::from(f32::MAX)) {
            let what = format!(
                "frame {}: point {} has the coordinate {:e}, too large for single precision; repair the frame or scale the capture down",
                self.frame,
                at / 3,
                out[at]
            );
            return Err(Error::Invalid { path: self.files.path.clone(), what });
        }
        for point in out.as_chunks_mut::<3>().0 {
            let [x, y, z] = *point;
            match self.files.up {
                Some(Up::Z) => *point = [x, z, -y],
                Some(Up::Y) => *point = [x, -z, y],
                Some(Up::Other) | None => break,
            }
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
    /// Compares the frame that was just read with those before.
    fn compare(&mut self, frame: &[f64]) -> Result<(), Error> {
        let Some(pass) = &mut self.pass else { return Ok(()) };
        let mesh = self.inner.mesh();
        let welded = mesh.zip(self.first_of.as_ref().and(self.files.weld.as_deref()));
        let welded = welded.map(|((_, faces), weld)| faces.renamed(weld));
        let faces = welded.as_ref().or(mesh.map(|(_, faces)| faces));
        let path = mesh.map_or(self.files.path.as_path(), |(path, _)| path);
        let number = self.inner.number(self.frame - 1);
        let Some(found) = pass.compare(frame.as_chunks().0, faces, path, number) else { return Ok(()) };
        if !pass.has_skipped() {
            return found.refuse_or_note();
        }
        // What was skipped is read now, so that the first frame is named that departs; or growth turns out to be one.
        self.pass = None;
        let mut all = self.files.open()?;
        while all.read_next(&mut self.values)? {}
        Ok(())
    }
}
