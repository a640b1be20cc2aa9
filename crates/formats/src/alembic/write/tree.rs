//! Where the meshes of an archive lie: below a transform for each name of their paths.

use std::collections::HashMap;

use cager_geometry::surface::Part;

use crate::names::Names;

/// Names of a path that are kept, the last ones: readers go no deeper than 256.
const DEEPEST: usize = 100;

/// A transform.
pub(super) struct Node {
    pub(super) name: String,
    /// Index of the transform above it, which comes before it; none for those at the top.
    pub(super) parent: Option<usize>,
    /// The parts whose meshes lie below it, and the names of these.
    pub(super) meshes: Vec<(usize, String)>,
    /// Whether other transforms lie below it.
    pub(super) has_others: bool,
}

/// The transforms of parts: the last name of a path is that of the mesh. One without others, or
/// `name` where there is none, is that of a transform, and the mesh has `Shape` behind it.
pub(super) fn transforms(parts: &[Part], name: &str) -> Vec<Node> {
    let (mut nodes, mut groups) = (Vec::<Node>::new(), HashMap::<(Option<usize>, &str), usize>::new());
    // Those that are taken, at the top and below each transform.
    let mut names: HashMap<Option<usize>, Names> = HashMap::new();
    for (k, part) in parts.iter().enumerate() {
        let mut path: Vec<&str> = part.path.split('/').filter(|name| !name.is_empty()).collect();
        if path.is_empty() {
            path.push(name);
        }
        let shape = match path.as_slice() {
            [only] => format!("{only}Shape"),
            _ => path.pop().unwrap_or_default().to_owned(),
        };
        let mut above = None;
        for &name in &path[path.len().saturating_sub(DEEPEST)..] {
            above = Some(*groups.entry((above, name)).or_insert_with(|| {
                let name = names.entry(above).or_default().add(name);
                above.into_iter().for_each(|parent| nodes[parent].has_others = true);
                nodes.push(Node { name, parent: above, meshes: Vec::new(), has_others: false });
                nodes.len() - 1
            }));
        }
        let shape = names.entry(above).or_default().add(&shape);
        above.into_iter().for_each(|node| nodes[node].meshes.push((k, shape.clone())));
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_transforms_and_no_two_siblings_share_a_name() {
        let part = |path: &str| Part { path: path.to_owned(), ..Part::default() };
        let paths = ["/robin/rig/body", "/robin/rig", "/robin/rig/body", "", "/hat", "robin/rig/body/eye", "/hat"];
        let nodes = transforms(&paths.map(part), "walk");
        let above = |node: usize| std::iter::successors(Some(node), |&k| nodes[k].parent);
        let path = |node: usize| above(node).map(|k| nodes[k].name.as_str()).collect::<Vec<_>>().join(" < ");
        let meshes = (0..nodes.len()).flat_map(|k| nodes[k].meshes.iter().map(move |mesh| (k, mesh)));
        let mut found: Vec<_> = meshes.map(|(k, (part, shape))| format!("{part}: {shape} < {}", path(k))).collect();
        found.sort();
        let expected = [
            "0: body < rig < robin",
            "1: rig_1 < robin",
            "2: body_1 < rig < robin",
            "3: walkShape < walk",
            "4: hatShape < hat",
            "5: eye < body_2 < rig < robin",
            "6: hatShape_1 < hat",
        ];
        assert_eq!(found, expected);
        // A path deeper than readers go.
        let nodes = transforms(&[part(&"/b".repeat(1000))], "walk");
        assert_eq!((nodes.len(), nodes[98].has_others, nodes[99].meshes.len()), (100, true, 1));
    }
}
