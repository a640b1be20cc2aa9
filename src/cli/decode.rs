//! `cager decode`.

use super::args::DecodeArgs;
use super::{grouped, interrupt, progress, tell};
use crate::decode;
use anyhow::Result;
use std::time::Instant;

pub(super) fn run(args: &DecodeArgs) -> Result<()> {
    let clock = Instant::now();
    let container = decode::open(&args.input)?;
    let (frames, points) = (container.frames(), container.header().points);
    drop(container);
    interrupt::leaves_nothing()?;
    let bar = progress::frames("decoding", frames);
    let result =
        decode::decode(&args.input, &args.output, (&args.timing).into(), &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    result?;
    tell(&format!(
        "{}: {} frames of {} points in {:.3} s\n",
        args.output.display(),
        grouped(frames as u64),
        grouped(points),
        clock.elapsed().as_secs_f64()
    ))
}
