//! `cager edit`.

use super::outputs::refuse_overwriting;
use super::transfer_args::EditArgs;
use super::{grouped, interrupt, print, progress};
use crate::edited::EditedCages;
use crate::{decode, edit};
use anyhow::Result;

pub(super) fn run(args: &EditArgs) -> Result<()> {
    refuse_overwriting(&args.output, None, [&args.input, &args.with_cages])?;
    let container = decode::open(&args.input)?;
    let edited = EditedCages::open(&args.with_cages, &container)?;
    interrupt::leaves_nothing()?;
    let bar = progress::frames("editing", edited.frames());
    let result = edit::edit(container, &args.input, edited, &args.output, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let found = result?;
    print(&format!(
        "{}: {} frames, {} of them with another cage; errors of these are not measured\n",
        args.output.display(),
        grouped(found.frames as u64),
        grouped(found.changed as u64)
    ))
}
