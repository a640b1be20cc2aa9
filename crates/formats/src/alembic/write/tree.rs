//! Where the meshes of an archive lie: below a transform for each name of their paths.

use std::collections::HashMap;

use cager_geometry::surface::Part;

/// Names of a path that are kept, the last ones: readers go no deeper than 256.
const DEEPEST: usize = 100;

/// A transform.
pub(super) struct Node {
    pub(super) name: String,
    /// Index of the transform above it, which comes before it; none for those at the top.
    pub(super) parent: Option<usize>,
    /// The part whose mesh lies below it, and the name of that.
    pub(super) mesh: Option<(usize, String)>,
    /// Whether other transforms lie below it.
    pub(super) has_others: bool,
}

/// Names that are taken, by what they lie below: how often one was wanted, and the transform that has it.
#[derive(Default)]
pub(super) struct Names(HashMap<(Option<usize>, String), (u32, Option<usize>)>);

impl Names {
    /// A name like this one that no sibling has, without `/`.
    pub(super) fn unique(&mut self, parent: Option<usize>, wanted: &str) -> String {
        let wanted = wanted.replace('/', "_");
        let mut name = wanted.clone();
        while self.0.contains_key(&(parent, name.clone())) {
            let times = &mut self.0.entry((parent, wanted.clone())).or_default().0;
            *times += 1;
            name = format!("{wanted}_{times}");
        }
        self.0.insert((parent, name.clone()), (0, None));
        name
    }
}

/// The transforms of parts; `name` is that of a part without a path.
pub(super) fn transforms(parts: &[Part], name: &str) -> Vec<Node> {
    let (mut nodes, mut names) = (Vec::<Node>::new(), Names::default());
    for (k, part) in parts.iter().enumerate() {
        let mut path: Vec<&str> = part.path.split('/').filter(|name| !name.is_empty()).collect();
        if path.is_empty() {
            path.push(name);
        }
        let mut above = None;
        for (depth, name) in path.iter().enumerate().skip(path.len().saturating_sub(DEEPEST)) {
            let known = names.0.get(&(above, (*name).to_owned())).and_then(|&(_, node)| node);
            let is_last = depth + 1 == path.len();
            above = known.filter(|&node| !is_last || nodes[node].mesh.is_none()).or_else(|| {
                let name = names.unique(above, name);
                names.0.insert((above, name.clone()), (0, Some(nodes.len())));
                above.into_iter().for_each(|parent| nodes[parent].has_others = true);
                nodes.push(Node { name, parent: above, mesh: None, has_others: false });
                Some(nodes.len() - 1)
            });
        }
        if let Some(node) = above {
            let shape = names.unique(above, &format!("{}Shape", nodes[node].name));
            nodes[node].mesh = Some((k, shape));
        }
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_transforms_and_no_two_siblings_share_a_name() {
        let part = |path: &str| Part { path: path.to_owned(), ..Part::default() };
        let paths = ["/robin/rig/body", "/robin/rig", "/robin/rig/body", "", "/robin/rig/bodyShape", "robin/rig/body"];
        let nodes = transforms(&paths.map(part), "walk");
        let above = |node: usize| std::iter::successors(Some(node), |&k| nodes[k].parent);
        let path = |node: usize| above(node).map(|k| nodes[k].name.as_str()).collect::<Vec<_>>().join(" < ");
        let meshes = nodes.iter().enumerate().filter_map(|(k, node)| Some((node.mesh.as_ref()?, path(k))));
        let mut found: Vec<_> = meshes.map(|((part, shape), path)| format!("{part}: {shape} < {path}")).collect();
        found.sort();
        let expected = [
            "0: bodyShape < body < rig < robin",
            "1: rigShape < rig < robin",
            "2: body_1Shape < body_1 < rig < robin",
            "3: walkShape < walk",
            "4: bodyShapeShape < bodyShape < rig < robin",
            "5: body_2Shape < body_2 < rig < robin",
        ];
        assert_eq!(found, expected);
        // A transform that would be called as the mesh beside it; a path deeper than readers go.
        let nodes = transforms(&[part("/a"), part("/a/aShape"), part(&"/b".repeat(1000))], "walk");
        assert_eq!((nodes[0].mesh.as_ref().unwrap().1.as_str(), nodes[1].name.as_str()), ("aShape", "aShape_1"));
        assert!(nodes[0].has_others && nodes.len() == 102);
    }
}
