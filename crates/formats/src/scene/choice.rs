//! Which mesh of a scene is meant.

use super::failure::Failure;
use crate::error::Fault;

/// Meshes that a message lists, and characters of the name of each.
const LISTED: usize = 6;
const SHOWN: usize = 200;

/// The tree of objects of a scene.
pub(crate) trait Objects {
    fn name(&self, object: usize) -> &[u8];

    /// The object that it lies below; none for those at the top.
    fn parent(&self, object: usize) -> Option<usize>;

    /// How many names its path has.
    fn depth(&self, object: usize) -> usize;

    /// What a message says of a mesh behind its path, such as `3 points`.
    fn told(&mut self, object: usize) -> String;

    /// The object and what it lies below, from the inside to the outside.
    fn ancestry(&self, object: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(object), |&k| self.parent(k))
    }
}

/// Of `all` meshes, at least one, that which `prim` names by its path, by its own name or by one of what it lies below; the only mesh whatever `prim` is,
/// since that is given for the rest pose and the capture alike, which may call it differently.
pub(crate) fn choose(scene: &mut impl Objects, all: &[usize], prim: Option<&str>) -> Result<usize, Failure> {
    if let &[only] = all {
        return Ok(only);
    }
    let found = prim.map_or_else(|| all.to_vec(), |prim| named(scene, all, prim));
    let what = match (found.as_slice(), prim) {
        (&[only], _) => return Ok(only),
        ([], Some(prim)) => {
            format!("holds no mesh {}, but {}; give one of these with --prim", shown(prim), list(scene, all))
        }
        (several, _) => format!(
            "holds {} meshes, {}; choose one by its path with --prim, where the command has it, or export the one mesh alone",
            several.len(),
            list(scene, several)
        ),
    };
    Err(Fault::invalid(what).into())
}

/// The meshes that a path or a name picks.
pub(crate) fn named(scene: &impl Objects, all: &[usize], prim: &str) -> Vec<usize> {
    if prim.contains('/') {
        let names = || prim.trim_matches('/').rsplit('/').map(str::as_bytes);
        let depth = names().count();
        // Name by name, as paths may be far longer than what the file holds of them.
        let begins = |k: usize| {
            let above = scene.depth(k).checked_sub(depth);
            above.is_some_and(|above| scene.ancestry(k).skip(above).map(|k| scene.name(k)).eq(names()))
        };
        let below: Vec<usize> = all.iter().copied().filter(|&k| begins(k)).collect();
        let exactly: Vec<usize> = below.iter().copied().filter(|&k| scene.depth(k) == depth).collect();
        return if exactly.is_empty() { below } else { exactly };
    }
    let is_called = |k: usize| scene.name(k) == prim.as_bytes();
    let exactly: Vec<usize> = all.iter().copied().filter(|&k| is_called(k)).collect();
    let below = || all.iter().copied().filter(|&k| scene.ancestry(k).any(is_called)).collect();
    if exactly.is_empty() { below() } else { exactly }
}

/// Meshes with their points, as far as a message has room.
pub(crate) fn list(scene: &mut impl Objects, meshes: &[usize]) -> String {
    let mut words = Vec::new();
    for &mesh in meshes.iter().take(LISTED) {
        words.push(format!("{} ({})", shown_path(scene, mesh), scene.told(mesh)));
    }
    if meshes.len() > LISTED {
        words.push(format!("{} more", meshes.len() - LISTED));
    }
    let last = words.pop().unwrap_or_default();
    if words.is_empty() { last } else { format!("{} and {last}", words.join(", ")) }
}

/// The names from the top to an object, each after a `/`, as messages have them.
pub(crate) fn shown_path(scene: &impl Objects, object: usize) -> String {
    let above: Vec<usize> = scene.ancestry(object).collect();
    let mut path = String::new();
    for &object in above.iter().rev() {
        // Of long names not more than is shown: many objects may share one.
        let name = scene.name(object);
        path.push('/');
        path.push_str(&String::from_utf8_lossy(&name[..name.len().min(4 * SHOWN + 4)]));
        if path.len() > 4 * SHOWN {
            break;
        }
    }
    shown(&path)
}

/// A name as messages have it.
pub(crate) fn shown(name: &str) -> String {
    let mut escaped = name.chars().flat_map(char::escape_debug);
    let start: String = escaped.by_ref().take(SHOWN).collect();
    if escaped.next().is_some() { start + "…" } else { start }
}
