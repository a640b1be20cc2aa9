//! The nodes of a file by the paths of its meshes.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::pieces::Piece;

/// A node for each mesh in their order, then those above them; and which of these are at the root.
pub(super) fn nodes(pieces: &[Piece], place: [f32; 3], scale: [f32; 3]) -> (Vec<Value>, Vec<usize>) {
    let of_mesh = |(mesh, piece): (usize, &Piece)| json!({ "name": piece.path.last(), "mesh": mesh, "translation": place, "scale": scale });
    let mut nodes: Vec<Value> = pieces.iter().enumerate().map(of_mesh).collect();
    let (mut groups, mut roots) = (HashMap::new(), Vec::new());
    for (mesh, piece) in pieces.iter().enumerate() {
        let mut above = None;
        let mut put = |node: usize, above: Option<usize>, nodes: &mut Vec<Value>| match above {
            None => roots.push(node),
            Some(above) => match nodes[above]["children"].as_array_mut() {
                Some(children) => children.push(node.into()),
                None => nodes[above]["children"] = json!([node]),
            },
        };
        // A mesh that has others below it stays beside the node above these, as its place is not theirs.
        for depth in 1..piece.path.len() {
            let next = nodes.len();
            let group = *groups.entry(&piece.path[..depth]).or_insert(next);
            if group == next {
                nodes.push(json!({ "name": piece.path[depth - 1] }));
                put(group, above, &mut nodes);
            }
            above = Some(group);
        }
        put(mesh, above, &mut nodes);
    }
    (nodes, roots)
}
