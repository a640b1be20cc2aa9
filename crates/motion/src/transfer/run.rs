//! Frames of a source in, frames of a target out.

use super::error::TransferFailed;
use super::job::TransferJob;
use super::method::Mover;
use super::report::TransferReport;
use crate::recover::RecoveredFrames;
use cager_formats::FrameReader;
use cager_geometry::mesh::{Point, TriMesh};
use cager_shape::quality::{MotionQuality, MotionSummary};
use cager_shape::transfer::placement::{Placement, lowest};
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Instant;

/// A motion that was moved.
pub struct Transferred {
    /// The target in every frame.
    pub frames: RecoveredFrames,
    /// How it went.
    pub report: TransferReport,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// The file of moved frames in the scratch folder, points × 3 numbers in double precision each.
pub const MOVED: &str = "moved/positions";
/// Frames that are moved at a time.
const BATCH: usize = 16;

/// Moves a motion. `progress` is told how many frames are done.
///
/// # Errors
/// See [`TransferFailed`].
pub fn transfer(mut job: TransferJob<'_>, progress: &dyn Fn(usize)) -> Result<Transferred, TransferFailed> {
    let count = job.frames.frames();
    if count == 0 {
        return Err(TransferFailed::NoFrames);
    }
    let clock = Instant::now();
    job.go_on()?;
    let mover = Mover::new(&job)?;
    let prepared = clock.elapsed().as_secs_f64();

    let clock = Instant::now();
    let numbers = (0..count).map(|frame| job.frames.number(frame)).collect();
    let scratch = Scratch { folder: job.scratch, numbers, frame_rate: job.frames.frame_rate() };
    let Moved { mut frames, source, under } = move_frames(&mut job, &mover, &scratch, progress)?;
    if let (Some(up), Some((under, floor))) = (job.up, under) {
        let rest = mover.under(0, &job.source.points)?;
        let placement = Placement::new(&job.target.points, &rest, floor, up);
        frames = placed(frames, under, placement, &scratch)?;
    }
    let moved = clock.elapsed().as_secs_f64();

    let clock = Instant::now();
    let (mut report, mut warnings) = mover.report(job.target.points.len(), count);
    let quality = MotionQuality::new(&TriMesh::from(job.target), &job.source.points);
    report.quality = measured(quality, &mut frames, source)?;
    frames.rewind()?;
    warnings.extend(torn(&report.quality));
    let seconds = &mut report.seconds;
    (seconds.prepare, seconds.frames, seconds.measure) = (prepared, moved, clock.elapsed().as_secs_f64());
    Ok(Transferred { frames, report, warnings })
}

/// What is to be said of a model that hardly keeps its shape.
fn torn(quality: &MotionSummary) -> Option<String> {
    /// Of the volume at rest, and of the area.
    const VOLUMES: RangeInclusive<f64> = 0.2..=5.0;
    const STRETCHED: f64 = 0.5;
    let volume = quality.volume.filter(|found| found.iter().any(|volume| !VOLUMES.contains(volume)));
    let stretched = quality.stretched.filter(|share| *share > STRETCHED);
    let what = match (volume, stretched) {
        (Some([least, most]), _) => format!("its volume is {least:.1} to {most:.1} times that at rest"),
        (None, Some(share)) => {
            format!("{:.0} % of its surface are twice as long as at rest or half as long", 100.0 * share)
        }
        (None, None) => return None,
    };
    Some(format!(
        "the motion does not keep the model's shape ({what}): look at the result, and take mean value coordinates or another --method"
    ))
}

/// What files of frames on their way are made of.
struct Scratch<'a> {
    folder: &'a Path,
    numbers: Vec<f64>,
    frame_rate: Option<f64>,
}

impl Scratch<'_> {
    fn create(&self, name: &str, points: usize) -> Result<RecoveredFrames, cager_formats::Error> {
        let folder = self.folder.join(name);
        std::fs::create_dir(&folder).map_err(|cause| cager_formats::Error::Io {
            path: folder.clone(),
            action: cager_formats::Action::Write,
            cause,
        })?;
        RecoveredFrames::create(&folder, points, self.numbers.clone(), self.frame_rate)
    }
}

/// Frames of the target before they are placed.
struct Moved {
    frames: RecoveredFrames,
    /// The source's, as they were read.
    source: RecoveredFrames,
    /// The source's points under the target's, and the floor; where an axis points up.
    under: Option<(RecoveredFrames, f64)>,
}

fn move_frames(
    job: &mut TransferJob<'_>,
    mover: &Mover,
    scratch: &Scratch<'_>,
    progress: &dyn Fn(usize),
) -> Result<Moved, TransferFailed> {
    let points = job.target.points.len();
    let (mut frames, mut source) =
        (scratch.create("moved", points)?, scratch.create("source", job.source.points.len())?);
    let up = job.up;
    let mut under = up.map(|_| scratch.create("under", points)).transpose()?;
    let (mut floor, mut first) = (f64::INFINITY, 0);
    loop {
        let batch = read_batch(job.frames)?;
        if batch.is_empty() {
            break;
        }
        job.go_on()?;
        let both = |(k, frame): (usize, &Vec<Point>)| {
            let shape = mover.pose(first + k, frame)?;
            let below = up.map(|_| mover.under(first + k, frame)).transpose()?;
            Ok((shape, below))
        };
        let done: Result<Vec<_>, TransferFailed> = batch.par_iter().enumerate().map(both).collect();
        for (k, (shape, below)) in done?.into_iter().enumerate() {
            frames.write(first + k, &shape)?;
            source.write(first + k, &batch[k])?;
            if let (Some(up), Some(under), Some(below)) = (up, &mut under, below) {
                floor = floor.min(lowest(&below, up));
                under.write(first + k, &below)?;
            }
        }
        first += batch.len();
        progress(first);
    }
    let announced = scratch.numbers.len();
    if first < announced {
        return Err(TransferFailed::EndsEarly { found: first, announced });
    }
    Ok(Moved { frames, source, under: under.map(|under| (under, floor)) })
}

/// The next frames, none at the end.
fn read_batch(frames: &mut dyn FrameReader) -> Result<Vec<Vec<Point>>, cager_formats::Error> {
    let (mut batch, mut values) = (Vec::with_capacity(BATCH), Vec::new());
    while batch.len() < BATCH && frames.read_next(&mut values)? {
        batch.push(values.as_chunks().0.to_vec());
    }
    Ok(batch)
}

/// Moves each frame as a whole to where the source's points under it stand.
fn placed(
    mut frames: RecoveredFrames,
    mut under: RecoveredFrames,
    mut placement: Placement,
    scratch: &Scratch<'_>,
) -> Result<RecoveredFrames, TransferFailed> {
    frames.rewind()?;
    under.rewind()?;
    let (mut shape, mut below) = (Vec::new(), Vec::new());
    while frames.read_next(&mut shape)? && under.read_next(&mut below)? {
        placement.push(shape.as_chunks().0, below.as_chunks().0);
    }
    frames.rewind()?;
    let mut standing = scratch.create("placed", frames.points())?;
    for (frame, by) in placement.offsets().into_iter().enumerate() {
        frames.read_next(&mut shape)?;
        shape.as_chunks_mut::<3>().0.iter_mut().for_each(|p| (0..3).for_each(|k| p[k] += by[k]));
        standing.write(frame, shape.as_chunks().0)?;
    }
    Ok(standing)
}

/// What the motion does to the target.
fn measured(
    mut quality: MotionQuality,
    frames: &mut RecoveredFrames,
    mut source: RecoveredFrames,
) -> Result<MotionSummary, cager_formats::Error> {
    frames.rewind()?;
    source.rewind()?;
    let (mut shape, mut pose) = (Vec::new(), Vec::new());
    while frames.read_next(&mut shape)? && source.read_next(&mut pose)? {
        quality.push(shape.as_chunks().0, pose.as_chunks().0);
    }
    Ok(quality.summary())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_loses_its_shape_is_told_of() {
        let of = |volume, stretched| torn(&MotionSummary { volume, stretched, ..MotionSummary::default() });
        assert_eq!(of(Some([0.8, 1.3]), Some(0.1)), None);
        assert_eq!(of(None, None), None);
        assert!(of(Some([-9.0, 1.0]), None).is_some_and(|said| said.contains("volume is -9.0 to 1.0 times")));
        assert!(of(None, Some(0.8)).is_some_and(|said| said.contains("80 % of its surface")));
    }
}
