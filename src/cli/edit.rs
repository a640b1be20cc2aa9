//! `cager edit`.

use super::dry_run::{size, tell_dry_run};
use super::outputs::Outputs;
use super::transfer_args::{EditArgs, LayerChoice};
use super::{counted, grouped, plain, progress, tell, warn};
use anyhow::{Result, bail};
use cager_capture::decode::{self, Container, DecodeError};
use cager_capture::edit::{self, Editing};
use cager_capture::edited::EditedCages;
use cager_formats::{AtomicFile, Target, Units, commit_together};
use cager_proto::container::{self, EditLayer, LayerSource};
use std::path::Path;

/// Said where a container has more than cages and its frames are others.
pub(super) const DETAIL_LOST: &str = "the corrections of points that the container keeps beside its cages belong to \
                                      its own frames and are left out: errors are those of the cages alone";

pub(super) fn run(args: &EditArgs) -> Result<()> {
    // The input is read before its new version takes its name.
    let replaces_input = is_same(&args.input, &args.output);
    let inputs = args.with_cages.iter().chain((!replaces_input).then_some(&args.input));
    let output = Outputs::new(args.outputs, inputs)?.container(&args.output, "edited.cager")?;
    let mut container = decode::open(&args.input)?;
    let (mut layers, mut damaged) = (Vec::new(), Vec::new());
    for (k, layer) in container.each_layer().into_iter().enumerate() {
        layers.push(match layer {
            Ok(layer) => layer,
            Err(container::Error::Corrupt { .. }) if args.remove.is_some() => {
                damaged.push(k);
                EditLayer::default()
            }
            Err(cause) => {
                let what = DecodeError::container(&args.input, cause);
                bail!("{what}; this is layer {0} of its edits, and --remove {0} takes back just that", k + 1);
            }
        });
    }
    if args.flatten {
        return flatten(args, container, &layers, &output);
    }
    if args.with_cages.is_some() {
        return add(args, container, layers.len(), &output);
    }
    if args.units() != Units::UNKNOWN {
        let file = edit::with_units(&mut container, &args.input, args.units(), &output)?;
        let set: Vec<&str> = args.up.map(|_| "up axis").into_iter().chain(args.unit.map(|_| "unit")).collect();
        return finish(args, file, &output, &format!("{} set", set.join(" and ")));
    }
    let (kept, told) = changed(args, layers)?;
    let stays = |k: &&usize| kept.iter().any(|layer| matches!(layer, LayerSource::Kept(kept) if kept == *k));
    if let Some(k) = damaged.iter().find(stays) {
        bail!(
            "{}: layer {} is damaged, so it cannot be kept; take it back, or all (--remove all)",
            args.input.display(),
            k + 1
        );
    }
    let file = edit::with_layers(&mut container, &args.input, &kept, &output)?;
    finish(args, file, &output, &told)
}

/// The layers as they are to be, and what is done.
fn changed(args: &EditArgs, mut layers: Vec<EditLayer>) -> Result<(Vec<LayerSource>, String)> {
    let count = layers.len();
    let all = || (0..count).map(LayerSource::Kept);
    if count == 0 {
        bail!("{}: has no layer of edits; `cager edit --with-cages` adds one", args.input.display());
    }
    let place = |option: &str, number: usize| match number.checked_sub(1).filter(|&k| k < count) {
        Some(k) => Ok(k),
        None => bail!(
            "{}: {option} {number}: its layers have the numbers 1 to {count}; `cager inspect` lists them",
            args.input.display()
        ),
    };
    match args.remove {
        Some(LayerChoice::All) => return Ok((Vec::new(), format!("{} taken back", counted(count, "layer")))),
        Some(LayerChoice::Number(number)) => {
            let taken = place("--remove", number)?;
            let kept = all().enumerate().filter(|&(k, _)| k != taken).map(|(_, layer)| layer);
            return Ok((kept.collect(), format!("layer {number}{} taken back", named(&layers[taken]))));
        }
        Some(LayerChoice::Last) => {
            let told = format!("layer {count}{} taken back", named(&layers[count - 1]));
            return Ok((all().take(count - 1).collect(), told));
        }
        None => {}
    }
    let mut told = Vec::new();
    let mut out: Vec<LayerSource> = all().collect();
    for (option, state, number) in [("--on", true, args.on), ("--off", false, args.off)] {
        let Some(number) = number else { continue };
        let k = place(option, number)?;
        if layers[k].is_on == state {
            told.push(format!("layer {number}{} is {} already", named(&layers[k]), &option[2..]));
            continue;
        }
        layers[k].is_on = state;
        out[k] = LayerSource::New(layers[k].clone());
        told.push(format!("layer {number}{} is {}", named(&layers[k]), &option[2..]));
    }
    Ok((out, told.join(", ")))
}

/// Writes one more layer.
fn add(args: &EditArgs, mut container: Container, there: usize, output: &Target) -> Result<()> {
    let Some(cages) = &args.with_cages else { return Ok(()) };
    let edited = EditedCages::open(cages, &container)?.meaning(args.units(), &container, &args.input)?;
    check_range(args, &mut container)?;
    let rows = container.header().cage_vertices as usize;
    let bar = progress::frames("editing", edited.frames());
    let what = Editing { name: args.name.as_deref().unwrap_or_default(), range: args.frames_range };
    let mut watch = |done: usize| bar.set_position(done as u64);
    let result = edit::edit(container, &args.input, edited, &what, output, &mut watch);
    bar.finish_and_clear();
    let found = result?;
    if found.loses_detail {
        warn(&[DETAIL_LOST.to_owned()]);
    }
    if args.outputs.dry_run {
        return tell_dry_run(output, &size(found.frames, rows, "vertices"), &[]);
    }
    let told = match (found.vertices, found.changed) {
        (0, 0) => ", none of them with another cage".to_owned(),
        (0, changed) => format!(", {} of them with another cage; errors of these are not measured", grouped(changed)),
        (vertices, changed) => format!(
            ", {} of them with another cage; layer {} moves {} of {} vertices",
            grouped(changed),
            there + 1,
            grouped(vertices),
            grouped(rows)
        ),
    };
    finish(args, found.container, output, &format!("{}{told}", counted(found.frames, "frame")))
}

/// Writes all layers into the cages.
fn flatten(args: &EditArgs, mut container: Container, layers: &[EditLayer], output: &Target) -> Result<()> {
    let mut more = None;
    if let Some(cages) = &args.with_cages {
        let mut edited = EditedCages::open(cages, &container)?;
        if edited.replaces_frames(args.frames_range) {
            // These are written anew.
            return add(args, container, layers.len(), output);
        }
        check_range(args, &mut container)?;
        let what = Editing { name: "", range: args.frames_range };
        more = edit::layer(&mut container, &args.input, &mut edited, &what, &mut |_| ())?.0;
    }
    let off = layers.iter().filter(|layer| !layer.is_on).count();
    if off > 0 {
        warn(&[format!(
            "{}: {} switched off, and not in what is written",
            args.input.display(),
            counted(off, "layer")
        )]);
    }
    let applied = layers.len() - off + usize::from(more.is_some());
    let file = edit::flattened(container, &args.input, more, output)?;
    let told = match (applied, layers.len()) {
        (0, 0) => "it has no layer, so nothing is changed".to_owned(),
        (0, _) => "no layer was on, so the layers are gone and nothing else is changed".to_owned(),
        _ => format!("{} in its cages; errors of these frames are not measured", counted(applied, "layer")),
    };
    finish(args, file, output, &told)
}

fn finish(args: &EditArgs, file: AtomicFile, output: &Target, told: &str) -> Result<()> {
    if args.outputs.dry_run {
        return tell(&format!("{}: would be written: {}\n", output.path().display(), plain(told)));
    }
    commit_together(vec![file])?;
    tell(&format!("{}: {}\n", output.path().display(), plain(told)))
}

/// Refuses frames that are not there, and names those that have other numbers.
fn check_range(args: &EditArgs, container: &mut Container) -> Result<()> {
    let Some(range) = args.frames_range else { return Ok(()) };
    let numbers = container.frame_numbers().map_err(|cause| DecodeError::container(&args.input, cause))?;
    let number = |frame: usize| numbers.get(frame).copied().unwrap_or(frame as f64);
    range.check(container.frames(), number, &args.input)?;
    range.numbered(number).map_or(Ok(()), |note| tell(&format!("{}: {note}\n", args.input.display())))
}

fn is_same(input: &Path, output: &Path) -> bool {
    input.canonicalize().is_ok_and(|input| output.canonicalize().is_ok_and(|output| input == output))
}

fn named(layer: &EditLayer) -> String {
    if layer.name.is_empty() { String::new() } else { format!(" ({})", layer.name) }
}
