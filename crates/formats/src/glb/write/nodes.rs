//! The nodes of a file by the paths of its meshes.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::pieces::Piece;

/// Whether each mesh has a transform of its own, which programs that write such scenes name: it is
/// then the node of the mesh, and the mesh has the last name.
fn have_own_transforms(pieces: &[Piece]) -> bool {
    let mut below: HashMap<&[String], usize> = HashMap::new();
    for piece in pieces {
        (1..piece.path.len()).for_each(|depth| *below.entry(&piece.path[..depth]).or_default() += 1);
    }
    let is_own = |piece: &Piece| piece.path.len() > 2 && below[&piece.path[..piece.path.len() - 1]] == 1;
    pieces.len() > 1 && pieces.iter().all(is_own)
}

/// A node for each mesh in their order, then those above them; and which of these are at the root.
/// A mesh that is hidden where there is but one frame is at none of them.
pub(super) fn nodes(pieces: &[Piece], place: [f32; 3], scale: [f32; 3], is_still: bool) -> (Vec<Value>, Vec<usize>) {
    let names_left = if have_own_transforms(pieces) { 2 } else { 1 };
    let depth = |piece: &Piece| piece.path.len().saturating_sub(names_left);
    let of_mesh = |(mesh, piece): (usize, &Piece)| {
        let name = piece.path.get(depth(piece));
        json!({ "name": name, "mesh": mesh, "translation": place, "scale": scale })
    };
    let mut nodes: Vec<Value> = pieces.iter().enumerate().map(of_mesh).collect();
    let (mut groups, mut roots) = (HashMap::new(), Vec::new());
    let are_shown = pieces.iter().any(|piece| !piece.is_hidden());
    for (mesh, piece) in pieces.iter().enumerate() {
        if is_still && are_shown && piece.is_hidden() {
            continue;
        }
        let mut above = None;
        let mut put = |node: usize, above: Option<usize>, nodes: &mut Vec<Value>| match above {
            None => roots.push(node),
            Some(above) => match nodes[above]["children"].as_array_mut() {
                Some(children) => children.push(node.into()),
                None => nodes[above]["children"] = json!([node]),
            },
        };
        // A mesh that has others below it stays beside the node above these, as its place is not theirs.
        for depth in 1..=depth(piece) {
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
