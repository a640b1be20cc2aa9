//! Decodes a frame to a mesh: `cargo run --example decode_frame -- walk.cager 12 frame.obj`.

use cager_capture::{Animation, write_model};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [input, frame, output] = &args[..] else { return Err("give INPUT FRAME OUTPUT".into()) };
    let mut animation = Animation::open(input)?;
    let mut model = animation.rest();
    model.points = animation.frame(frame.parse()?)?;
    write_model(Path::new(output), &model)?;
    Ok(())
}
