//! Encodes a folder of frames: `cargo run --example encode_folder -- rest.obj cage.obj frames walk.cager`.

use cager_capture::{Capture, encode};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [rest, cage, frames, output] = &args[..] else { return Err("give REST CAGE FRAMES OUTPUT".into()) };
    let capture = Capture::open(rest, cage, frames)?;
    let report = encode(&capture).max_error(1e-3).write(output)?;
    eprintln!("{} frames, {} bytes, largest error {:.1e}", report.frames, report.bytes.output, report.error.linf_max);
    Ok(())
}
