//! The frames of an animation: at the times of its keys, or so many a second.

use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use cager_geometry::units::Units;

use super::buffers::{Buffers, LARGEST, Source, too_long};
use super::builder::{Builder, Built};
use super::choice::{choose, listed};
use super::clip::Clip;
use super::container::split;
use super::document::document;
use super::scene::Scene;
use crate::error::{Error, Fault};
use crate::faces::Contents;
use crate::frames::{FrameReader, FrameSelection, Times};
use crate::scene::{self, Animation, MeshInfo, Timeline, check_held, whole_frames};

/// Frames per second that programs have.
const RATES: [f64; 10] =
    [24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 120.0, 24_000.0 / 1001.0, 30_000.0 / 1001.0, 60_000.0 / 1001.0];
/// Opens the frames of the mesh that is selected of several, or else of all as one.
pub(crate) fn open_frames<'a>(
    path: &Path,
    (source, length): (impl Read + Seek, u64),
    kind: &Source<'_>,
    expected_points: usize,
    selection: &FrameSelection,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let open = || {
        let bytes = read_all(source, length)?;
        MeshFrames::open(bytes, kind, expected_points, selection)
    };
    scene::open(path, open().map_err(|failure: Fault| failure.at(path))?, expected_points)
}

/// Whether a file has animations; files that cannot be read have none.
pub(crate) fn is_animated(bytes: &[u8]) -> bool {
    let document = split(bytes).and_then(|(json, _)| document(json));
    document.is_ok_and(|document| !document.root.animations.is_empty())
}

fn read_all(mut source: impl Read + Seek, length: u64) -> Result<Vec<u8>, Fault> {
    if length > LARGEST {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    source.seek(SeekFrom::Start(0))?;
    source.take(LARGEST).read_to_end(&mut bytes)?;
    Ok(bytes)
}

struct MeshFrames {
    /// The document, whose nodes are put where they are at the time of a frame.
    buffers: Buffers<'static>,
    /// Of the placements in the scene.
    chosen: Range<usize>,
    /// The points that are taken of those that are stored, where not all are.
    kept: Option<Vec<u32>>,
    stored: usize,
    clip: Option<Clip>,
    /// Seconds of each frame.
    at: Vec<f64>,
    info: MeshInfo,
}

impl MeshFrames {
    fn open(
        bytes: Vec<u8>,
        source: &Source<'_>,
        expected_points: usize,
        selection: &FrameSelection,
    ) -> Result<Self, Fault> {
        let buffers = Buffers::open(bytes, source)?;
        let scene = Scene::of(&buffers.root)?;
        let chosen = choose(&buffers.root, &scene, &selection.prims)?;
        let placements = &scene.placements[chosen.clone()];
        let build = |is_split| Builder::new(&buffers, &scene, Contents::PointsAndFaces, is_split).build(placements);
        let mut rest = build(source.is_split)?;
        // A rest pose of another file may have them as they are stored.
        if rest.model.points.len() != expected_points && rest.stored == expected_points && rest.kept.is_some() {
            rest = build(true)?;
        }
        let Built { model: rest, kept, stored, nodes } = rest;
        let points = rest.points.len();
        if points == 0 {
            return Err(Fault::invalid("has no points; export the mesh with its vertices"));
        }
        if points != expected_points && chosen.len() > 1 {
            let what = format!(
                "holds {} meshes, {}, which together have {points} points, and {expected_points} are expected; choose \
                 one by its path with --prim, where the command has it, or export the one mesh alone",
                chosen.len(),
                listed(&buffers.root, &scene)
            );
            return Err(Fault::invalid(what));
        }
        let clip = Clip::of(&buffers, &scene, chosen.clone(), selection.animation.as_deref())?;
        let keys = clip.as_ref().map_or_else(Vec::new, Clip::key_times);
        // A byte of the file stands for a few points at the most: weights, or turns of joints.
        let held = buffers.most_zeros().saturating_mul(POINTS_PER_ITEM);
        let is_held = |frames: usize| frames.saturating_mul(stored) <= held;
        let is_smooth = clip.as_ref().is_some_and(Clip::moves_between_keys);
        let Timeline { times, at } = timeline(keys, selection.rate, (buffers.frame_numbers, is_smooth), is_held)?;
        let notes = clip.as_ref().and_then(|clip| clip.note.clone()).into_iter().collect();
        let shown_at = |node: &Option<usize>| clip.as_ref().zip(*node).and_then(|(clip, node)| clip.shown(node, &at));
        let shown = nodes.iter().map(shown_at).collect();
        let (frames, faces, units) = (at.len(), rest.faces, Units::METRES);
        let info = MeshInfo { points, frames, times, faces, units, notes, shown, ..MeshInfo::default() };
        Ok(Self { buffers, chosen, kept, stored, clip, at, info })
    }
}

impl Animation for MeshFrames {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Fault> {
        if let Some(clip) = &self.clip {
            clip.apply(self.at[frame], &mut self.buffers.root);
        }
        let scene = Scene::of(&self.buffers.root)?;
        let placements = &scene.placements[self.chosen.clone()];
        let points = Builder::new(&self.buffers, &scene, Contents::Points, true).build(placements)?.model.points;
        out.clear();
        match &self.kept {
            Some(kept) if points.len() == self.stored => out.extend(kept.iter().flat_map(|&k| points[k as usize])),
            _ => out.extend_from_slice(points.as_flattened()),
        }
        Ok(out.len() == 3 * self.info.points)
    }
}

/// At the times of keys, or at whole numbers of frames of a rate. `said` is the number of the frame
/// at 0 s and the rate, where the file says them: it then has a key for every frame.
fn timeline(
    keys: Vec<f64>,
    rate: Option<f64>,
    (said, is_smooth): (Option<[f64; 2]>, bool),
    is_held: impl Fn(usize) -> bool,
) -> Result<Timeline, Fault> {
    let (Some(&first), Some(&last)) = (keys.first(), keys.last()) else {
        let times = Times { frame_rate: rate, ..Times::default() };
        return Ok(Timeline { times, at: vec![0.0] });
    };
    let Some(rate) = rate.filter(|_| keys.len() > 1) else {
        check_held(keys.len(), is_held(keys.len()))?;
        let mut times = Times::of(&keys, said.map(|[_, rate]| rate).or_else(|| usual_rate(&keys)))?;
        if let Some([first, _]) = said {
            times.begin_at(first);
        }
        let far = far_keys(&keys).filter(|_| said.is_none() && is_smooth);
        times.note = match (times.note, far) {
            (Some(uneven), None) => {
                Some(uneven + "; with --sample-rate, where the command has it, they are evenly spaced")
            }
            (Some(uneven), Some(far)) => Some(format!("{uneven}; {far}")),
            (None, far) => far,
        };
        return Ok(Timeline { times, at: keys });
    };
    let Timeline { mut times, at } = whole_frames([first, last], rate, keys.len())?;
    if let Some([first, _]) = said.filter(|[_, told]| (told - rate).abs() < 1e-9 * rate) {
        times.begin_at(first);
    }
    Ok(Timeline { times, at })
}

/// Points of frames for each number in the file: more are a bomb, not a capture.
const POINTS_PER_ITEM: usize = 1 << 12;
/// The most by which single precision may move a key from its frame, in frames.
const LARGEST_ROUNDING: f64 = 0.02;

/// What to say of keys that are farther apart than frames of films: motion between is not read.
fn far_keys(keys: &[f64]) -> Option<String> {
    const FAR: f64 = 1.05 / 24.0;
    let gap = keys.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    (gap > FAR).then(|| {
        format!(
            "its keys are up to {gap:.3} s apart, and the {} frames at them have none of the motion between; \
             --sample-rate 24, where the command has it, reads that too",
            keys.len()
        )
    })
}

/// The rate at which all keys are at whole frames, as far as single precision tells.
fn usual_rate(keys: &[f64]) -> Option<f64> {
    let first = keys.first()?;
    let is_whole = |key: f64, rate: f64| {
        // A digit of the key, and what programs lose that add up steps.
        let lost = key.abs() * f64::from(f32::EPSILON) + 1e-6 * (key - first);
        (key * rate - (key * rate).round()).abs() <= (1e-3 + lost * rate).min(LARGEST_ROUNDING)
    };
    RATES.into_iter().find(|&rate| keys.iter().all(|&key| is_whole(key, rate)))
}
