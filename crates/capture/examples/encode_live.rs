//! Encodes frames that arrive in memory: `cargo run --example encode_live -- rest.obj cage.obj live.cager`.

use cager_capture::{Cage, Encode, Inverter, TriMesh, read_model};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [rest, cage, output] = &args[..] else { return Err("give REST CAGE OUTPUT".into()) };
    let rest = read_model(Path::new(rest))?;
    let cage = Cage::new(TriMesh::from(&read_model(Path::new(cage))?))?;
    // The cage of a frame alone, and all frames into a file.
    let inverter = Inverter::new(&rest.points, &cage)?;
    let mut encoder = Encode::new(&rest, &cage).max_error(1e-3).start(output)?;
    for time in 0..24 {
        let sway = |&[x, y, z]: &[f64; 3]| [x + 0.02 * y * (0.3 * f64::from(time)).sin(), y, z];
        let frame: Vec<[f64; 3]> = rest.points.iter().map(sway).collect();
        eprintln!("first vertex of cage {time}: {:.3?}", inverter.cage(&frame)?[0]);
        encoder.push(&frame)?;
    }
    eprintln!("{} frames", encoder.finish()?.frames);
    Ok(())
}
