//! Positions in another unit, or with another axis up, than those of the container.

use super::DecodeError;
use cager_formats::{CacheFormat, FrameOptions};
use cager_geometry::units::{Change, Units, Up};
use std::path::Path;

/// Lets an output be in these units where they are asked for, and returns the change of positions.
pub(crate) fn convert(options: &mut FrameOptions, asked: Units, path: &Path) -> Result<Change, DecodeError> {
    check(options.units, asked, path)?;
    let change = options.units.change_to(asked);
    options.units = asked.or(options.units);
    options.origin = options.origin.map(|origin| change.apply(origin));
    options.rounding *= change.scale;
    Ok(change)
}

/// Refuses what a container at `path` cannot be brought to, or from, as it does not know its own.
pub(crate) fn check(own: Units, asked: Units, path: &Path) -> Result<(), DecodeError> {
    let what = match (asked.up.and(own.up), asked.metres_per_unit.and(own.metres_per_unit)) {
        (None, _) if asked.up.is_some() => "which axis points up in it, so that --up cannot turn anything",
        (_, None) if asked.metres_per_unit.is_some() => "what its unit is, so that --unit cannot scale anything",
        _ => return Ok(()),
    };
    let what = format!(
        "does not say {what}; leave the option out, or say it first: cager edit IN.cager --up AXIS --unit UNIT -o OUT.cager"
    );
    Err(DecodeError::Meaning { path: path.to_owned(), what })
}

/// Changes positions x y z x y z … of an output.
pub(crate) fn apply(change: &Change, positions: &mut [f32]) {
    if !change.is_none() {
        let changed = |point: &mut [f32; 3]| *point = change.apply(point.map(f64::from)).map(|x| x as f32);
        positions.as_chunks_mut().0.iter_mut().for_each(changed);
    }
}

/// What the user should know of the axes and the unit of an output.
pub(crate) fn notes(output: &Path, written: Units, asked: Units) -> Vec<String> {
    let format = CacheFormat::from_path(output);
    let is_glb = matches!(format, Some(CacheFormat::Glb | CacheFormat::Gltf));
    let what = if is_glb && written != Units::METRES && asked != Units::UNKNOWN {
        "glTF is in metres with Y up, whatever --up and --unit say"
    } else if format == Some(CacheFormat::Abc) && written.up == Some(Up::Z) {
        "Z points up in its positions, and Alembic has no place for that: programs that take Y for it, as most do, lay the model on its back (--up y turns it)"
    } else {
        return Vec::new();
    };
    vec![format!("{}: {what}", output.display())]
}
