//! Paths of all that a layer holds, stored as a tree in depth-first order.

use crate::error::Fault;
use crate::scene::damaged;
use crate::usd::layer::{DEEPEST, too_deep};

/// What a path leads to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Path {
    /// Index of the path above it; of the top its own.
    pub(super) parent: u32,
    /// Index of its last name.
    pub(super) name: u32,
    pub(super) depth: u32,
}

/// In place of the distance to the next sibling: there is none, but a child follows; or neither.
const CHILD_ONLY: i32 = -1;
const LAST: i32 = -2;

/// Paths by their indices, of which there are `count`; `names` are negative where they are those of properties.
pub(super) fn paths(count: usize, [indices, names, jumps]: [&[i32]; 3]) -> Result<Vec<Path>, Fault> {
    let wrong = || damaged("its paths are not a tree");
    let mut paths = vec![Path::default(); count];
    let mut known = vec![false; count];
    // Places that are yet to be entered, and the paths above them.
    let mut waiting = if indices.is_empty() { Vec::new() } else { vec![(0, None)] };
    while let Some((mut place, above)) = waiting.pop() {
        loop {
            let index = indices.get(place).and_then(|&index| u32::try_from(index).ok()).ok_or_else(wrong)?;
            // Once each, so that none lies below itself.
            let is_new = known.get_mut(index as usize).filter(|known| !**known).ok_or_else(wrong)?;
            *is_new = true;
            let (parent, depth) = above.map_or((index, 0), |(parent, depth)| (parent, depth + 1));
            // A property lies below the last of so many prims.
            if depth > DEEPEST + 1 {
                return Err(too_deep());
            }
            paths[index as usize] = Path { parent, depth, name: names[place].unsigned_abs() };
            match jumps[place] {
                LAST => break,
                0 => place += 1,
                jump => {
                    if jump > 0 {
                        waiting.push((place + jump as usize, above));
                    } else if jump != CHILD_ONLY {
                        return Err(wrong());
                    }
                    waiting.push((place + 1, Some((index, depth))));
                    break;
                }
            }
        }
    }
    Ok(paths)
}
