//! Decodes containers that play one after the other to one sequence.

use super::{Chosen, DecodeError, Decoding, units as meaning};
use crate::timing::Timing;
use cager_formats::{FrameOptions, FrameRange, Target, create_frames};
use cager_geometry::mesh::Model;
use std::path::PathBuf;

/// Decodes ranges of frames of containers, at least one, into one `output`, whose files have the
/// mesh of their container each. Formats of one mesh are refused before anything is decoded, unless
/// all have the same. `progress` is told the number of frames done, which is returned with what the
/// user should know of the output. `shift` is added to the numbers of all frames; model, cages,
/// range and first frame of `what` are not for several files.
///
/// # Errors
/// See [`DecodeError`].
pub fn decode_joined(
    inputs: &[(PathBuf, FrameRange)],
    output: impl Into<Target>,
    (what, shift): (&Decoding<'_>, f64),
    progress: &mut dyn FnMut(usize),
) -> Result<(usize, Vec<String>), DecodeError> {
    let Decoding { dry_run, memory, layer, morphs, units, .. } = *what;
    let timing = Timing { start: None, ..what.timing };
    let mut all = Vec::with_capacity(inputs.len());
    for (path, range) in inputs {
        let what = Decoding { range: Some(*range), timing, dry_run, memory, layer, units, ..Decoding::default() };
        let mut chosen = Chosen::open(path, what)?;
        let rest = chosen.container.rest().map_err(|cause| DecodeError::container(path, cause))?;
        all.push((chosen, rest));
    }
    let numbers = all.iter().flat_map(|(chosen, _)| &chosen.options.numbers).map(|number| number + shift).collect();
    let frames = all.iter().map(|(chosen, _)| chosen.wanted.len()).sum();
    // One file takes no more than the guaranteed error of each leaves.
    let of_each = all.iter_mut().map(|(chosen, rest)| chosen.morphs(morphs, rest)).collect::<Result<Vec<_>, _>>()?;
    let guaranteed = of_each.iter().filter(|morphs| morphs.is_guarantee);
    let morphs = guaranteed.min_by(|a, b| a.max_error.unwrap_or(0.0).total_cmp(&b.max_error.unwrap_or(0.0)));
    let morphs = *morphs.unwrap_or(&of_each[0]);
    let placed = all.iter().map(|(chosen, _)| &chosen.options).filter(|options| options.origin.is_some());
    let rounding = placed.map(|options| options.rounding).reduce(f64::min).unwrap_or(0.0);
    let (first, rest) = &all[0];
    let options = FrameOptions { numbers, morphs, rounding, ..first.options.clone() };
    let output = output.into();
    let path = output.path().to_owned();
    let mut writer = create_frames(output, rest.points.len(), frames, &rest.faces, &options)?;
    let same = |a: &(Chosen<'_>, Model), b: &(Chosen<'_>, Model)| {
        (a.1.points.len(), &a.1.faces, a.0.options.origin) == (b.1.points.len(), &b.1.faces, b.0.options.origin)
    };
    let changes: Vec<bool> = (0..all.len()).map(|k| !same(&all[k.saturating_sub(1)], &all[k])).collect();
    // Each mesh is tried before the work.
    for k in (0..all.len()).filter(|&k| changes[k]).chain(changes.contains(&true).then_some(0)) {
        let (chosen, rest) = &all[k];
        writer.change_mesh(rest.points.len(), &rest.faces, &chosen.options)?;
    }
    let mut done = 0;
    for ((chosen, rest), changes) in all.iter_mut().zip(changes) {
        if changes {
            writer.change_mesh(rest.points.len(), &rest.faces, &chosen.options)?;
        }
        let bound = chosen.bind()?;
        chosen.write(&bound, &mut writer, &mut |count| progress(done + count))?;
        done += chosen.wanted.len();
    }
    let mut notes = writer.notes();
    notes.extend(meaning::notes(&path, options.units, units));
    if !dry_run {
        writer.finish()?;
    }
    Ok((frames, notes))
}
