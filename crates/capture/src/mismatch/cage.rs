//! Whether a cage belongs to a rest pose: one that leaves most points outside, or is far larger,
//! may have other units or axes, or be that of another model.

use cager_cages::diagnosis::alignment;
use cager_geometry::mesh::{Model, TriMesh, diagonal};
use cager_geometry::spatial::outside;

/// A cage larger than its model by this factor is checked for other units.
const ROOMY: f64 = 5.0;

/// How a cage does not look like one of this rest pose, in words that follow its name.
pub fn cage_mismatch(cage: &TriMesh, rest: &Model) -> Option<String> {
    let missed = outside(cage, &rest.points).len();
    let most_outside = 2 * missed > rest.points.len();
    let (size, of_rest) = (diagonal(&cage.vertices), diagonal(&rest.points));
    if !most_outside && size <= ROOMY * of_rest {
        return None;
    }
    let alignment = alignment(cage, rest).filter(|found| most_outside || found.shift == [0.0; 3]);
    let nearly_all = 10 * missed > 9 * rest.points.len();
    let leaves = || format!("leaves {missed} of {} points of the rest pose outside", rest.points.len());
    match alignment {
        Some(alignment) if most_outside => Some(format!("{}, and {alignment}", leaves())),
        Some(alignment) => Some(format!("is {:.0} times larger than the rest pose, and {alignment}", size / of_rest)),
        None => nearly_all.then(|| format!("{}; it looks like the cage of another model", leaves())),
    }
}
