//! What lies on the faces of a mesh, as its faces are read: without those of fewer than three
//! corners, and with corners in the opposite order where faces are turned around.

use std::collections::HashMap;

use cager_geometry::surface::{CornerSet, Crease, Part};

use super::bytes::damaged;
use crate::error::Fault;

/// A set in which equal values are one, as programs write the value of each corner.
pub(crate) fn merged<const N: usize>(name: String, values: &[[f32; N]], corners: Vec<u32>) -> CornerSet<N> {
    let mut set = CornerSet { name, ..CornerSet::default() };
    let mut numbers = HashMap::new();
    for corner in corners {
        // 0 and −0 too.
        let value = values[corner as usize].map(|x| x + 0.0);
        let number = *numbers.entry(value.map(f32::to_bits)).or_insert_with(|| {
            set.values.push(value);
            set.values.len() as u32 - 1
        });
        set.corners.push(number);
    }
    set
}

/// The edges of chains of so many points each, with a sharpness for each chain or for each edge, in
/// a mesh of `count` points; without those that are not sharp.
pub(crate) fn creases(
    mut chains: &[i32],
    lengths: &[i32],
    sharpnesses: &[f32],
    count: usize,
) -> Result<Vec<Crease>, Fault> {
    let (of_chains, mut creases, mut edges) = (sharpnesses.len() == lengths.len(), Vec::new(), 0);
    for (k, &length) in lengths.iter().enumerate() {
        let chain = chains.split_off(..length.max(0) as usize);
        for pair in chain.ok_or_else(|| damaged("a crease has more points than are there"))?.windows(2) {
            let sharpness = sharpnesses.get(if of_chains { k } else { edges }).copied().unwrap_or(0.0);
            edges += 1;
            let edge = [pair[0].min(pair[1]) as u32, pair[0].max(pair[1]) as u32];
            if edge[0] < edge[1] && (edge[1] as usize) < count && sharpness > 0.0 && sharpness.is_finite() {
                creases.push(Crease { edge, sharpness });
            }
        }
    }
    Ok(creases)
}

/// A part of all faces of a file, which have so many corners each, and the normals of their corners, for the faces that
/// are kept. What is not as long as these say is dropped.
pub(super) fn arranged(mut part: Part, normals: &[[f32; 3]], arities: &[u32], turned: bool) -> (Part, Vec<[f32; 3]>) {
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
    (part, arrange(normals, &corners, count))
}

fn arrange<T: Copy>(values: &[T], corners: &[usize], count: usize) -> Vec<T> {
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
            materials: vec![7, 8, 9],
            groups: vec![FaceGroup { name: "g".to_owned(), faces: vec![2, 1, 5, 0] }],
            ..Part::default()
        };
        let normals: Vec<[f32; 3]> = (10..19).map(|k| [k as f32; 3]).collect();
        let (arranged, normals) = arranged(part, &normals, &[3, 2, 4], true);
        assert_eq!(arranged.uv_sets.len(), 1);
        assert_eq!(arranged.uv_sets[0].corners, [2, 1, 0, 8, 7, 6, 5]);
        assert_eq!(normals, [12, 11, 10, 18, 17, 16, 15].map(|k| [k as f32; 3]));
        assert_eq!((arranged.materials, arranged.groups[0].faces.clone()), (vec![7, 9], vec![0, 1]));
    }

    #[test]
    fn values_of_corners_are_one_where_they_are_equal() {
        let set = merged("a".to_owned(), &[[1.0], [-0.0], [1.0], [0.0]], vec![0, 2, 3, 1]);
        assert_eq!((set.values, set.corners), (vec![[1.0], [0.0]], vec![0, 0, 1, 1]));
    }

    #[test]
    fn chains_are_edges_with_a_sharpness_of_their_own_or_of_the_chain() {
        let edges = |sharpnesses: &[f32]| {
            let found = creases(&[2, 1, 0, 3, 3, 9], &[3, 2, 1], sharpnesses, 4);
            found.unwrap().iter().map(|crease| (crease.edge, crease.sharpness)).collect::<Vec<_>>()
        };
        assert_eq!(edges(&[2.0, 1.0, 1.0]), [([1, 2], 2.0), ([0, 1], 2.0)]);
        assert_eq!(edges(&[2.0, f32::NAN]), [([1, 2], 2.0)]);
        assert!(creases(&[0, 1], &[3], &[1.0], 4).is_err());
    }
}
