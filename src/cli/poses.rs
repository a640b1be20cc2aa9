//! Poses of one model: meshes, and frames of .cager files.

use super::{dropped, grouped, is_container, read_whole, warn};
use anyhow::{Context, Result, bail};
use cager_capture::decode::{self, Decoding};
use cager_capture::mismatch::{Mismatch, mismatches};
use cager_capture::origin::move_from;
use cager_core::cage::Cage;
use cager_formats::{FrameRange, ScratchDir, Units, open_frames};
use cager_geometry::mesh::{Model, Point};
use cager_geometry::units::Change;
use cager_motion::pose_faces::same_faces;
use std::fmt;
use std::path::{Path, PathBuf};

/// Where a pose is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PoseFile {
    /// In a file of its own.
    Mesh(PathBuf),
    /// A frame of a .cager file, counted from 0.
    Frame(PathBuf, usize),
}

impl PoseFile {
    /// What a word of the command line names: a file, or a frame of one as `IN.cager@12`.
    pub(super) fn named(word: &Path) -> Result<Self> {
        if !word.exists() {
            let text = word.to_str().unwrap_or_default();
            let frame = text.rsplit_once('@').and_then(|(file, frame)| Some((file, frame.parse().ok()?)));
            if let Some((file, frame)) = frame {
                return Ok(Self::Frame(file.into(), frame));
            }
        } else if is_container(word) {
            bail!("{}: holds many poses; name one by its frame, counted from 0, such as IN.cager@12", word.display());
        }
        Ok(Self::Mesh(word.to_owned()))
    }

    /// The file that is read.
    pub(super) fn path(&self) -> &PathBuf {
        match self {
            Self::Mesh(path) | Self::Frame(path, _) => path,
        }
    }

    /// The model that has this pose, of a mesh as it stands, of a .cager file at rest, and what its positions mean.
    fn model(&self, is_first: bool) -> Result<(Model, Units)> {
        let (path, frame) = match self {
            Self::Mesh(path) => {
                let read = read_whole(path, &[])?;
                // All have the faces of the first one, and what belongs to them.
                warn(dropped(path, &read).filter(|_| is_first).as_slice());
                return Ok((read.model, read.units));
            }
            Self::Frame(path, frame) => (path, *frame),
        };
        let mut container = decode::open(path)?;
        let numbers = container.frame_numbers().with_context(|| path.display().to_string())?;
        let (only, number) = (FrameRange::only(frame), |k: usize| numbers.get(k).copied().unwrap_or(k as f64));
        only.check(container.frames(), number, path)?;
        warn(only.numbered(number).map(|note| format!("{}: {note}", path.display())).as_slice());
        let mut rest = container.rest().with_context(|| path.display().to_string())?;
        move_from(container.header().origin, &mut rest.points);
        Ok((rest, container.header().units))
    }

    /// The cage that comes with the model.
    fn cage(&self) -> Result<Option<Cage>> {
        let Self::Frame(path, _) = self else { return Ok(None) };
        let named = || path.display().to_string();
        let mut container = decode::open(path)?;
        let mut cage = container.cage().with_context(named)?;
        move_from(container.header().origin, &mut cage.vertices);
        Cage::new(cage).with_context(named).map(Some)
    }
}

impl fmt::Display for PoseFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mesh(path) => write!(f, "{}", path.display()),
            Self::Frame(path, frame) => write!(f, "{}@{frame}", path.display()),
        }
    }
}

/// Poses of one mesh, checked.
pub(super) struct Poses {
    files: Vec<PoseFile>,
    /// The first one's: as it stands, or at rest.
    pub(super) model: Model,
    /// What its positions mean, and those of all poses are brought to.
    pub(super) units: Units,
    /// What brings each pose to the first one's units and axes.
    changes: Vec<Change>,
    /// Of meshes; none of frames, which are decoded later.
    read: Vec<Option<Vec<Point>>>,
}

impl Poses {
    /// Reads meshes, and what .cager files have at rest; all have the points and faces of the first.
    pub(super) fn open(files: Vec<PoseFile>) -> Result<Self> {
        let (mut model, mut units) = (Model::default(), Units::UNKNOWN);
        let (mut changes, mut read) = (Vec::new(), Vec::new());
        for (k, file) in files.iter().enumerate() {
            let (mut found, said) = file.model(k == 0)?;
            if k == 0 {
                units = said;
                if found.faces.is_empty() {
                    bail!("{file}: has no faces, and shapes are found between poses of a mesh; give one with faces");
                }
                model = found.clone();
            }
            let [count, expected] = [&found, &model].map(|model| model.points.len());
            if count != expected {
                bail!(
                    "{file}: has {} points, {} has {}; poses have the same points in the same order",
                    grouped(count),
                    files[0],
                    grouped(expected)
                );
            }
            same_faces((file, &found.faces), (&files[0], &model.faces))?;
            let change = said.change_to(units);
            if !change.is_none() {
                change.apply_to(&mut found.points);
                warn(&[format!("{file}: the pose is {change}, as its unit and axes are not those of {}", files[0])]);
            }
            refuse_other_order((file, &found.points), (&files[0], &model))?;
            changes.push(change);
            read.push(matches!(file, PoseFile::Mesh(_)).then_some(found.points));
        }
        Ok(Self { files, model, units, changes, read })
    }

    /// Number of poses.
    pub(super) fn len(&self) -> usize {
        self.files.len()
    }

    /// Where a pose is.
    pub(super) fn file(&self, pose: usize) -> &PoseFile {
        &self.files[pose]
    }

    /// The cage that comes with the first one.
    pub(super) fn cage(&self) -> Result<Option<Cage>> {
        self.files[0].cage()
    }

    /// The points of every pose; frames are decoded into files beside `folder`'s, which go again.
    pub(super) fn points(&self, folder: &Path) -> Result<Vec<Vec<Point>>> {
        let mut scratch = None;
        let mut all = Vec::with_capacity(self.len());
        for (k, (file, read)) in self.files.iter().zip(&self.read).enumerate() {
            all.push(match (read, file) {
                (Some(points), _) => points.clone(),
                (None, file) => {
                    let scratch = match &mut scratch {
                        Some(scratch) => scratch,
                        none => none.insert(ScratchDir::create(folder)?),
                    };
                    let mut points = decoded(file, &scratch.path().join(format!("{k}.npy")), self.model.points.len())?;
                    self.changes[k].apply_to(&mut points);
                    points
                }
            });
        }
        Ok(all)
    }
}

/// Points in another order, and mirrored ones, give shapes of nothing.
fn refuse_other_order((file, points): (&PoseFile, &[Point]), (first, model): (&PoseFile, &Model)) -> Result<()> {
    let found = mismatches(model, &[points.as_flattened().to_vec()]);
    if let Some(Mismatch::Mirrored(mirroring)) = found.last() {
        let how = mirroring.map_or("left is right in it".to_owned(), |found| found.to_string());
        let advice = Mismatch::Mirrored(*mirroring).advice();
        bail!("{file}: does not look like a pose of {first}: it is mirrored ({how}); {advice}");
    }
    let Some(Mismatch::Order(longer)) = found.first() else { return Ok(()) };
    bail!(
        "{file}: does not look like a pose of {first}: its points come in another order: edges of that are {longer:.0} \
         times longer in this; export both from one program with the order of the points kept"
    )
}

fn decoded(file: &PoseFile, into: &Path, points: usize) -> Result<Vec<Point>> {
    let PoseFile::Frame(path, frame) = file else { bail!("{file}: is no frame of a .cager file") };
    let what = Decoding { range: Some(FrameRange::only(*frame)), ..Decoding::default() };
    decode::decode(path, into, what, &mut |_| ())?;
    let mut values = Vec::new();
    open_frames(into, points)?.read_next(&mut values)?;
    Ok(values.as_chunks().0.to_vec())
}
