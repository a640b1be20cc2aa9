//! What lies on the faces of a mesh, as its faces are read: without those of fewer than three
//! corners, and with corners in the opposite order where faces are turned around.

use cager_geometry::surface::{CornerSet, Part};

/// A part of all faces of a file, which have so many corners each, for the faces that are kept.
/// What is not as long as these say is dropped.
pub(super) fn arranged(mut part: Part, arities: &[u32], turned: bool) -> Part {
    let count: usize = arities.iter().map(|&arity| arity as usize).sum();
    let is_kept = |face: usize| arities[face] >= 3;
    let (mut corners, mut first) = (Vec::with_capacity(count), 0);
    for (face, &arity) in arities.iter().enumerate() {
        let of_face = first..first + arity as usize;
        first = of_face.end;
        if is_kept(face) && turned {
            corners.extend(of_face.rev());
        } else if is_kept(face) {
            corners.extend(of_face);
        }
    }
    part.uv_sets.retain_mut(|set| arrange_set(set, &corners, count));
    part.color_sets.retain_mut(|set| arrange_set(set, &corners, count));
    part.normals = arrange(&part.normals, &corners, count);
    if part.materials.len() == arities.len() {
        let kept = part.materials.iter().enumerate().filter(|&(face, _)| is_kept(face));
        part.materials = kept.map(|(_, &material)| material).collect();
    } else {
        part.materials = Vec::new();
    }
    let mut numbers = vec![None; arities.len()];
    (0..arities.len()).filter(|&face| is_kept(face)).zip(0_u32..).for_each(|(face, k)| numbers[face] = Some(k));
    for group in &mut part.groups {
        let kept = group.faces.iter().filter_map(|&face| *numbers.get(face as usize)?);
        group.faces = kept.collect();
        group.faces.sort_unstable();
        group.faces.dedup();
    }
    part
}

fn arrange(values: &[u32], corners: &[usize], count: usize) -> Vec<u32> {
    if values.len() == count { corners.iter().map(|&corner| values[corner]).collect() } else { Vec::new() }
}

fn arrange_set<const N: usize>(set: &mut CornerSet<N>, corners: &[usize], count: usize) -> bool {
    let is_whole = set.corners.len() == count && set.corners.iter().all(|&k| (k as usize) < set.values.len());
    set.corners = arrange(&set.corners, corners, count);
    is_whole && set.values.iter().flatten().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use cager_geometry::surface::FaceGroup;

    use super::*;

    #[test]
    fn corners_follow_faces_that_are_turned_or_left_out() {
        let part = Part {
            uv_sets: vec![
                CornerSet { name: "a".to_owned(), values: vec![[0.0; 2]; 9], corners: (0..9).collect() },
                CornerSet { name: "short".to_owned(), values: vec![[0.0; 2]; 9], corners: (0..8).collect() },
            ],
            normals: (10..19).collect(),
            materials: vec![7, 8, 9],
            groups: vec![FaceGroup { name: "g".to_owned(), faces: vec![2, 1, 5, 0] }],
            ..Part::default()
        };
        let arranged = arranged(part, &[3, 2, 4], true);
        assert_eq!(arranged.uv_sets.len(), 1);
        assert_eq!(arranged.uv_sets[0].corners, [2, 1, 0, 8, 7, 6, 5]);
        assert_eq!(arranged.normals, [12, 11, 10, 18, 17, 16, 15]);
        assert_eq!((arranged.materials, arranged.groups[0].faces.clone()), (vec![7, 9], vec![0, 1]));
    }
}
