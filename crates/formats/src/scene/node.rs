//! The tree of a scene, and which of its meshes is meant.

use std::sync::Arc;

use crate::error::Fault;

/// Meshes that a message lists, and characters of the name of each.
const LISTED: usize = 6;
const SHOWN: usize = 200;

/// Something with a name, at its place in the tree.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) name: Arc<[u8]>,
    /// Index of the node above; none for those at the top.
    pub(crate) parent: Option<usize>,
    /// Names in its path.
    pub(crate) depth: usize,
}

/// A node and those above it, from the inside to the outside.
pub(crate) fn ancestry(nodes: &[Node], node: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(node), |&k| nodes[k].parent)
}

/// A scene whose meshes can be told apart.
pub(crate) trait Tree {
    fn nodes(&self) -> &[Node];

    /// A mesh as a message describes it behind its path, such as `3 points`.
    fn describe(&mut self, mesh: usize) -> String;
}

/// Of `all` meshes, at least one, that which `prim` names by its path, its own name or that of a
/// node above; the only mesh whatever `prim` is, which the rest pose and the capture share.
pub(crate) fn choose(scene: &mut impl Tree, all: &[usize], prim: Option<&str>) -> Result<usize, Fault> {
    if let &[only] = all {
        return Ok(only);
    }
    let found = prim.map_or_else(|| all.to_vec(), |prim| named(scene.nodes(), all, prim));
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
    Err(Fault::invalid(what))
}

/// The meshes that a path or a name picks.
pub(crate) fn named(nodes: &[Node], all: &[usize], prim: &str) -> Vec<usize> {
    let those = |picks: &dyn Fn(usize) -> bool| -> Vec<usize> { all.iter().copied().filter(|&k| picks(k)).collect() };
    let (exactly, below) = if prim.contains('/') {
        let names = || prim.trim_matches('/').rsplit('/').map(str::as_bytes);
        let depth = names().count();
        // Name by name, as paths may be far longer than what the file holds of them.
        let begins = |k: usize| {
            let above = nodes[k].depth.checked_sub(depth);
            above.is_some_and(|above| ancestry(nodes, k).skip(above).map(|k| &*nodes[k].name).eq(names()))
        };
        (those(&|k| nodes[k].depth == depth && begins(k)), those(&begins))
    } else {
        let is_called = |k: usize| &*nodes[k].name == prim.as_bytes();
        (those(&is_called), those(&|k| ancestry(nodes, k).any(is_called)))
    };
    if exactly.is_empty() { below } else { exactly }
}

/// Meshes with their points, as far as a message has room.
pub(crate) fn list(scene: &mut impl Tree, meshes: &[usize]) -> String {
    let describe = |&mesh: &usize| format!("{} ({})", shown_path(scene.nodes(), mesh), scene.describe(mesh));
    let mut words: Vec<String> = meshes.iter().take(LISTED).map(describe).collect();
    if meshes.len() > LISTED {
        words.push(format!("{} more", meshes.len() - LISTED));
    }
    let last = words.pop().unwrap_or_default();
    if words.is_empty() { last } else { format!("{} and {last}", words.join(", ")) }
}

/// The names from the top to a node, each after a `/`, as messages have them.
pub(crate) fn shown_path(nodes: &[Node], node: usize) -> String {
    let above: Vec<usize> = ancestry(nodes, node).collect();
    let mut path = String::new();
    for &node in above.iter().rev() {
        // Of long names not more than is shown: many nodes may share one.
        let name = &nodes[node].name;
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
