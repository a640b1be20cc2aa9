//! `cager edit`.

use super::dry_run::{size, tell_dry_run};
use super::outputs::Outputs;
use super::transfer_args::EditArgs;
use super::{grouped, progress, tell, warn};
use anyhow::Result;
use cager_capture::edited::EditedCages;
use cager_capture::{decode, edit};
use cager_formats::commit_together;

/// Said where a container has more than cages.
pub(super) const DETAIL_LOST: &str = "the corrections of points that the container keeps beside its cages do not follow edits and are left out, of all frames: errors are those of the cages alone";

pub(super) fn run(args: &EditArgs) -> Result<()> {
    let output =
        Outputs::new(args.outputs, [&args.input, &args.with_cages])?.container(&args.output, "edited.cager")?;
    let container = decode::open(&args.input)?;
    let edited = EditedCages::open(&args.with_cages, &container)?;
    let rows = container.header().rows_per_frame as usize;
    let bar = progress::frames("editing", edited.frames());
    let result = edit::edit(container, &args.input, edited, &output, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let found = result?;
    if args.outputs.dry_run {
        return tell_dry_run(&output, &size(found.frames, rows, "vertices"), &[]);
    }
    commit_together(vec![found.container])?;
    if found.loses_detail {
        warn(&[DETAIL_LOST.to_owned()]);
    }
    let errors = if found.changed > 0 { "; errors of these are not measured" } else { "" };
    tell(&format!(
        "{}: {} frames, {} of them with another cage{errors}\n",
        output.path().display(),
        grouped(found.frames),
        grouped(found.changed)
    ))
}
