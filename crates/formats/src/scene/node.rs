//! The tree of a scene, and which of its meshes is meant.

use std::collections::HashMap;
use std::sync::Arc;

use cager_geometry::surface::Part;

use crate::dropped::{joined, listed};
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

    /// How many points a mesh has first, where that can be read.
    fn points(&mut self, mesh: usize) -> Option<u64>;
}

/// Which meshes of a scene are read.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wanted<'a> {
    /// Their paths or names; all where there are none.
    pub(crate) prims: &'a [String],
    /// Points that they have together, where that is known.
    pub(crate) points: Option<usize>,
    /// The parts of the rest pose, in whose order meshes of the same paths are read.
    pub(crate) parts: &'a [Part],
}

/// Of `all` meshes, at least one, those that are wanted, in the order of the scene. The only mesh
/// is, whatever its name, which the rest pose and the capture share; so is the only one with the
/// points that are wanted, where none is named.
pub(crate) fn choose(scene: &mut impl Tree, all: &[usize], wanted: Wanted<'_>) -> Result<Vec<usize>, Fault> {
    if let &[only] = all {
        return Ok(vec![only]);
    }
    let mut chosen = Vec::new();
    for prim in wanted.prims {
        let found = named(scene.nodes(), all, prim);
        if found.is_empty() {
            let (prim, all) = (shown(prim), list(scene, all));
            return Err(Fault::invalid(format!("holds no mesh {prim}, but {all}; give one of these with --prim")));
        }
        chosen.extend(found);
    }
    if wanted.prims.is_empty() {
        chosen = all.to_vec();
    }
    chosen.sort_unstable();
    chosen.dedup();
    in_order_of(wanted.parts, scene.nodes(), &mut chosen);
    let Some(points) = wanted.points else { return Ok(chosen) };
    let counts: Vec<_> = chosen.iter().map(|&mesh| scene.points(mesh)).collect();
    let sum = counts.iter().copied().sum::<Option<u64>>();
    if chosen.len() < 2 || sum.is_none_or(|sum| sum == points as u64) {
        return Ok(chosen);
    }
    let mut fitting = chosen.iter().zip(&counts).filter(|(_, count)| **count == Some(points as u64));
    match (fitting.next(), fitting.next()) {
        (Some((&only, _)), None) => Ok(vec![only]),
        _ => Err(Fault::invalid(format!(
            "holds {} meshes, {}, which together have {} points, and {points} are expected; choose by paths with \
             --prim, where the command has it, or export those meshes alone",
            chosen.len(),
            list(scene, &chosen),
            sum.unwrap_or_default()
        ))),
    }
}

/// Sorts meshes as parts of the same paths are; leaves them where these are others.
fn in_order_of(parts: &[Part], nodes: &[Node], meshes: &mut [usize]) {
    let places: HashMap<&str, usize> = parts.iter().enumerate().map(|(k, part)| (part.path.as_str(), k)).collect();
    if places.len() != meshes.len() || meshes.len() < 2 {
        return;
    }
    let place = |mesh: &usize| places.get(path(nodes, *mesh).as_str()).copied();
    if meshes.iter().all(|mesh| place(mesh).is_some()) {
        meshes.sort_by_cached_key(place);
    }
}

/// The meshes that a path or a name picks, or a glob of them: `*` for some of a name, `**` for any
/// names.
pub(crate) fn named(nodes: &[Node], all: &[usize], prim: &str) -> Vec<usize> {
    let found = literally_named(nodes, all, prim);
    let is_glob = found.is_empty() && prim.contains(['*', '?', '[']);
    let pattern = if is_glob { glob::Pattern::new(prim.trim_end_matches('/')).ok() } else { None };
    let Some(pattern) = pattern else { return found };
    let options = glob::MatchOptions { require_literal_separator: true, ..Default::default() };
    let of_path = prim.contains('/');
    let picks = |&mesh: &usize| {
        ancestry(nodes, mesh).any(|node| {
            let name =
                if of_path { path(nodes, node) } else { String::from_utf8_lossy(&nodes[node].name).into_owned() };
            pattern.matches_with(&name, options)
        })
    };
    all.iter().copied().filter(picks).collect()
}

/// Which parts of a model the paths, names or globs name: those of each are at least one.
///
/// # Errors
/// A sentence without its subject that says what there is.
pub fn chosen_parts(paths: &[&str], wanted: &[String]) -> Result<Vec<bool>, String> {
    let (mut nodes, mut meshes): (Vec<Node>, Vec<usize>) = (Vec::new(), Vec::new());
    for path in paths {
        for (above, name) in path.trim_start_matches('/').split('/').enumerate() {
            let parent = (above > 0).then(|| nodes.len() - 1);
            nodes.push(Node { name: name.as_bytes().into(), parent, depth: above + 1 });
        }
        meshes.push(nodes.len() - 1);
    }
    let mut chosen = vec![wanted.is_empty(); paths.len()];
    for name in wanted {
        let found = named(&nodes, &meshes, name);
        if found.is_empty() {
            let all = meshes.iter().map(|&mesh| nodes[mesh].name.as_ref());
            return Err(format!("has no part {}, but {}; give one of these with --part", shown(name), listed(all)));
        }
        meshes.iter().zip(&mut chosen).for_each(|(mesh, chosen)| *chosen |= found.contains(mesh));
    }
    Ok(chosen)
}

/// Bytes of a path that are kept: many nodes may share a long name.
const LONGEST_PATH: usize = 4096;

/// The names from the top to a node, each after a `/`.
pub(crate) fn path(nodes: &[Node], node: usize) -> String {
    let above: Vec<usize> = ancestry(nodes, node).collect();
    let mut path = String::new();
    for &node in above.iter().rev() {
        let name = &nodes[node].name;
        path.push('/');
        path.push_str(&String::from_utf8_lossy(&name[..name.len().min(LONGEST_PATH)]).replace('/', "_"));
        if path.len() > LONGEST_PATH {
            break;
        }
    }
    path
}

fn literally_named(nodes: &[Node], all: &[usize], prim: &str) -> Vec<usize> {
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
    let describe = |&mesh: &usize| {
        let points = scene.points(mesh).map_or_else(|| "unreadable".to_owned(), |points| format!("{points} points"));
        format!("{} ({points})", shown_path(scene.nodes(), mesh))
    };
    let mut words: Vec<String> = meshes.iter().take(LISTED).map(describe).collect();
    if meshes.len() > LISTED {
        words.push(format!("{} more", meshes.len() - LISTED));
    }
    joined(&words).unwrap_or_default()
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
