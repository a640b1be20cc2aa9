//! Where meshes lie in a layer: below groups of their names, all of them below one root.

use std::collections::HashMap;

use super::material::GROUP;
use crate::names::Names;

/// Names of a path that become prims; of longer ones those before the last are left out.
const DEEPEST: usize = 64;

/// Prims, of which the first is the root.
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
}

/// A group of others, or a mesh.
pub(super) struct Node {
    pub(super) name: String,
    pub(super) children: Vec<usize>,
    /// Which of the meshes it is.
    pub(super) mesh: Option<usize>,
    names: Names,
}

impl Node {
    fn new(name: String, mesh: Option<usize>) -> Self {
        Self { name, children: Vec::new(), mesh, names: Names::default() }
    }
}

impl Tree {
    /// Of meshes with these paths, below `root` where not all are below one name of their own.
    pub(super) fn new<'a>(paths: impl Iterator<Item = &'a str>, root: &str) -> Self {
        let names = |path: &'a str| -> Vec<&'a str> {
            let mut names: Vec<&str> = path.split('/').filter(|name| !name.is_empty()).collect();
            if names.len() > DEEPEST {
                names.drain(DEEPEST - 1..names.len() - 1);
            }
            names
        };
        let mut paths: Vec<Vec<&str>> = paths.map(names).collect();
        let top = paths.first().and_then(|path| path.first().copied());
        let root = match top.filter(|&top| paths.iter().all(|path| path.len() > 1 && path[0] == top)) {
            Some(top) => {
                paths.iter_mut().for_each(|path| *path = path.split_off(1));
                identifier(top)
            }
            None => root.to_owned(),
        };
        let mut tree = Self { nodes: vec![Node::new(root, None)] };
        tree.nodes[0].names.add(GROUP);
        let mut groups: HashMap<(usize, &str), usize> = HashMap::new();
        let mut above = Vec::new();
        for path in &paths {
            let mut node = 0;
            for &name in path.split_last().map_or(&[][..], |(_, above)| above) {
                node = *groups.entry((node, name)).or_insert_with(|| tree.add(node, name, None));
            }
            above.push(node);
        }
        for (mesh, (path, mut node)) in paths.iter().zip(above).enumerate() {
            let name = path.last().copied().unwrap_or("mesh");
            // A mesh has no others below it.
            node = groups.get(&(node, name)).copied().unwrap_or(node);
            tree.add(node, name, Some(mesh));
        }
        tree
    }

    /// Adds a prim below another, with a name that no other one there has.
    fn add(&mut self, above: usize, name: &str, mesh: Option<usize>) -> usize {
        let node = self.nodes.len();
        let name = self.nodes[above].names.add(&identifier(name));
        self.nodes.push(Node::new(name, mesh));
        self.nodes[above].children.push(node);
        node
    }

    /// Adds a mesh below the root, with a name that no other prim has.
    pub(super) fn add_helper(&mut self, name: &str, mesh: usize) {
        let mut name = name.to_owned();
        while self.nodes.iter().any(|node| node.name == name) {
            name.push('_');
        }
        self.add(0, &name, Some(mesh));
    }
}

/// A name as prims and properties may have it.
pub(super) fn identifier(name: &str) -> String {
    let plain = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
    let begins_with_digit = name.starts_with(|c: char| c.is_ascii_digit());
    begins_with_digit.then_some('_').into_iter().chain(plain).chain(name.is_empty().then_some('_')).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paths of the meshes, in order.
    fn paths(given: &[&str]) -> Vec<String> {
        let tree = Tree::new(given.iter().copied(), "file");
        let mut found = vec![String::new(); given.len()];
        let mut open = vec![(0, String::new())];
        while let Some((node, above)) = open.pop() {
            let Node { name, children, mesh, .. } = &tree.nodes[node];
            let path = format!("{above}/{name}");
            open.extend(children.iter().map(|&child| (child, path.clone())));
            if let Some(mesh) = mesh {
                found[*mesh] = path;
            }
        }
        found
    }

    #[test]
    fn meshes_lie_below_one_root_under_names_of_their_own() {
        assert_eq!(paths(&[""]), ["/file/mesh"]);
        assert_eq!(paths(&["/hat", "/coat"]), ["/file/hat", "/file/coat"]);
        assert_eq!(paths(&["/a/b", "/a/c/d", "/a/c"]), ["/a/b", "/a/c/d", "/a/c/c"]);
        assert_eq!(paths(&["/a/b", "/c/d"]), ["/file/a/b", "/file/c/d"]);
        // Names that differ in what identifiers cannot have, or not at all.
        assert_eq!(paths(&["r/eye.L", "r/eye_L", "r/eye.L", "r/1"]), ["/r/eye_L", "/r/eye_L_1", "/r/eye_L_2", "/r/_1"]);
        assert_eq!(paths(&["r/a", "r/a_1", "r/a"]), ["/r/a", "/r/a_1", "/r/a_2"]);
        let deep = "/x".repeat(10_000);
        assert_eq!(paths(&[&deep])[0].len(), 2 * DEEPEST);
    }
}
