//! `cager decode`.

use super::args::DecodeArgs;
use super::dry_run::{size, tell_dry_run};
use super::edit::DETAIL_LOST;
use super::outputs::Outputs;
use super::stretches::StretchList;
use super::{counted, grouped, plain, progress, read_like, tell, warn};
use anyhow::{Result, bail};
use cager_capture::cage_export::write_cages;
use cager_capture::decode::joined::decode_joined;
use cager_capture::decode::{self, Container, DecodeError, Decoding};
use cager_capture::edited::EditedCages;
use cager_formats::{FrameRange, Target};
use std::path::Path;
use std::time::Instant;

pub(super) fn run(args: &DecodeArgs) -> Result<()> {
    let clock = Instant::now();
    args.morphs.check(&args.output)?;
    if let Some(list) = StretchList::read(&args.input)? {
        return joined(args, &list, clock);
    }
    let transfer = &args.transfer;
    let dry_run = args.outputs.dry_run;
    let inputs = [Some(&args.input), transfer.with_cages.as_ref(), transfer.model.as_ref(), args.onto.as_ref()];
    let output = Outputs::new(args.outputs, inputs.into_iter().flatten())?.frames(&args.output)?;
    let mut container = if args.salvage { decode::open_cut(&args.input) } else { decode::open(&args.input) }?;
    if container.lacks_end() {
        let lost = match container.frames().checked_sub(1) {
            Some(last) => format!("frames after frame {last} are lost, if it had any"),
            None => "no frame is left of it".to_owned(),
        };
        warn(&[format!("{}: was cut, or is damaged: {lost}; get the file again", args.input.display())]);
    }
    if let Some(lost) = lost_layers(&mut container) {
        warn(&[format!("{}: {lost}; get the file again", args.input.display())]);
    }
    let edited = transfer.with_cages.as_ref().map(|path| EditedCages::open(path, &container)).transpose()?;
    let model = transfer.model.as_ref().map(|path| read_like(path, container.header().units)).transpose()?;
    let there = edited.as_ref().map_or(container.frames(), EditedCages::frames);
    let replaced = edited.as_ref().is_some_and(|edited| edited.replaces_frames(None));
    let loses_detail = replaced && container.has_residual();
    // Where they are damaged, frames are counted from 0.
    let numbers = container.frame_numbers().unwrap_or_default();
    let is_colored = !transfer.cages && container.colors().is_ok_and(|colors| !colors.is_empty());
    if is_colored && model.is_none() {
        let [from, to] = [&args.input, &args.output].map(|path| path.display());
        warn(&[format!("{from}: the colours of its points are not kept in {to}")]);
    }
    drop(container);
    // Checked against the file that has the frames.
    let range = transfer.range(there, &numbers, transfer.with_cages.as_ref().unwrap_or(&args.input))?;
    let taken = range.as_ref().map_or(there, FrameRange::count);
    if transfer.cages {
        let bar = progress::frames("decoding", taken);
        let mut watch = |done: usize| bar.set_position(done as u64);
        let result = write_cages(
            &args.input,
            &output,
            (range, (&args.timing).into(), transfer.meaning.units()),
            dry_run,
            &mut watch,
        );
        bar.finish_and_clear();
        let found = result?;
        if found.normals > 0 {
            warn(&[format!("the {} normals of each cage are left out: they are no positions", found.normals)]);
        }
        if dry_run {
            let rest = found.rest.map(Target::Replacing);
            return tell_dry_run(&output, &size(found.frames, found.vertices as usize, "vertices"), &[rest]);
        }
        let rest =
            found.rest.map_or_else(String::new, |path| format!("; the rest cage with its faces is {}", path.display()));
        return tell(&format!(
            "{}: {} cages of {} vertices{rest}\n",
            output.path().display(),
            grouped(found.frames),
            grouped(found.vertices),
        ));
    }
    let what = Decoding {
        model: transfer.model.as_deref().zip(model.as_ref()),
        cages: edited,
        range,
        timing: (&args.timing).into(),
        dry_run,
        memory: args.memory,
        layer: args.layer,
        salvage: args.salvage,
        morphs: args.morphs.options(),
        with_cage: transfer.with_cage,
        onto: args.onto.clone(),
        parts: args.part.clone(),
        units: transfer.meaning.units(),
    };
    let bar = progress::PreparationBar::new("decoding", taken);
    let result = decode::decode(&args.input, &output, what, &mut |done| bar.done(done));
    bar.finish();
    let found = result?;
    if loses_detail {
        warn(&[DETAIL_LOST.to_owned()]);
    }
    // For the file's own model, encoding has warned already.
    if let (Some(path), true) = (&transfer.model, found.outside > 0) {
        warn(&[outside(path, found.outside, found.points)]);
    }
    if let (Some(path), true) = (&transfer.model, found.bound > 0) {
        warn(&[format!(
            "{}: {} of {} points lie beside poles of the cage's coordinates, where these follow nothing; they follow \
             the nearest places of the file's own model",
            path.display(),
            grouped(found.bound),
            grouped(found.points)
        )]);
    }
    if let [first, .., last] | [first @ last] = found.damaged[..] {
        let count = grouped(found.damaged.len());
        warn(&[format!(
            "{}: {count} of frames {first} to {last} are damaged and left out; get the file again",
            args.input.display()
        )]);
    }
    if found.numbers_lost {
        warn(&[format!("{}: the numbers of its frames are damaged; they are counted from 0", args.input.display())]);
    }
    if dry_run {
        return tell_dry_run(&output, &size(found.frames, found.points, "points"), &[]);
    }
    tell_notes(&found.notes)?;
    tell(&format!(
        "{}: {} of {} in {:.3} s\n",
        output.path().display(),
        counted(found.frames, "frame"),
        counted(found.points, "point"),
        clock.elapsed().as_secs_f64()
    ))
}

/// What is to be said of layers of edits that a damaged file has not, if anything.
fn lost_layers(container: &mut Container) -> Option<String> {
    let (_, lost) = (container.layers().is_ok(), container.lost_layers());
    match lost {
        0 if container.was_cut() && !container.lacks_end() => {
            Some("its end is missing or damaged: layers of edits that were there are lost".to_owned())
        }
        0 => None,
        _ => Some(format!("{} of its layers of edits are damaged and left out", grouped(lost))),
    }
}

/// Decodes the files of a list as one sequence.
fn joined(args: &DecodeArgs, list: &StretchList, clock: Instant) -> Result<()> {
    let transfer = &args.transfer;
    for (given, option, why) in [
        (transfer.cages, "--cages", "each file of a list has a cage of its own"),
        (transfer.with_cage, "--with-cage", "each file of a list has a cage of its own"),
        (transfer.with_cages.is_some(), "--with-cages", "each file of a list has a cage of its own"),
        (args.onto.is_some(), "--onto", "a layer moves the meshes of one capture"),
        (!args.part.is_empty(), "--part", "the files of a list may have parts of their own"),
        (transfer.model.is_some(), "--model", "each file of a list has a cage of its own"),
        (args.salvage, "--salvage", "what a list says holds for whole files"),
    ] {
        if given {
            bail!("{option}: {why}; decode the files of {} one by one", args.input.display());
        }
    }
    let files = list.stretches.iter().map(|stretch| args.input.with_file_name(&stretch.file)).collect::<Vec<_>>();
    let output = Outputs::new(args.outputs, files.iter().chain([&args.input]))?.frames(&args.output)?;
    let mut numbers = Vec::new();
    for (path, mut container) in list.containers(&args.input)? {
        let own = container.frame_numbers().map_err(|cause| DecodeError::container(&path, cause))?;
        numbers.extend((0..container.frames()).map(|k| own.get(k).copied().unwrap_or(k as f64)));
    }
    let there: usize = list.stretches.iter().map(|stretch| stretch.frames).sum();
    if there == 0 {
        bail!("{}: its files hold no frames; recover them again", args.input.display());
    }
    let range = transfer.range(there, &numbers, &args.input)?.unwrap_or(FrameRange::all(there));
    let mut start = 0;
    let mut parts = Vec::new();
    for (stretch, path) in list.stretches.iter().zip(files) {
        parts.extend(range.part(start, stretch.frames).map(|part| (path, part)));
        start += stretch.frames;
    }
    let shift = args.timing.start.map_or(0.0, |start| start - list.stretches[0].first_frame);
    let what = Decoding {
        timing: (&args.timing).into(),
        dry_run: args.outputs.dry_run,
        memory: args.memory,
        layer: args.layer,
        morphs: args.morphs.options(),
        units: transfer.meaning.units(),
        ..Decoding::default()
    };
    let bar = progress::PreparationBar::new("decoding", range.count());
    let result = decode_joined(&parts, &output, (&what, shift), &mut |done| bar.done(done));
    bar.finish();
    let (frames, notes) = result?;
    let told = format!("{} of {}", counted(frames, "frame"), counted(parts.len(), "file"));
    if what.dry_run {
        return tell_dry_run(&output, &told, &[]);
    }
    tell_notes(&notes)?;
    tell(&format!("{}: {told} in {:.3} s\n", output.path().display(), clock.elapsed().as_secs_f64()))
}

/// What there is to know of an output, a line each.
fn tell_notes(notes: &[String]) -> Result<()> {
    notes.iter().try_for_each(|note| tell(&format!("{}\n", plain(note))))
}

fn outside(path: &Path, outside: usize, points: usize) -> String {
    let advice = if 2 * outside > points {
        "is it in the units, axes and place of the rest pose?"
    } else {
        "they follow the cage less closely"
    };
    format!(
        "{}: {} of {} points lie outside the rest cage; {advice}",
        path.display(),
        grouped(outside),
        grouped(points)
    )
}
