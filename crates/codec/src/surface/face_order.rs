//! The order of faces, and the corner that each begins with, as the source has them: [`decode_faces`](crate::decode_faces) gives them as the walk came by.

use crate::entropy::{Coder, Decoder, Encoder, Integers, Models};
use crate::error::{Error, Result};
use crate::vertex_order::{MAX_FAR_POINTS, code_order};
use cager_geometry::mesh::Polygons;
use cager_geometry::topology::Adjacency;
use std::collections::HashMap;

/// Faces of more corners share a context.
const ARITIES: usize = 8;

/// The bytes by which [`decode`] makes `source` of `coded`: none where they are the same. `None` where the
/// lists do not have the same faces.
pub(super) fn encode(source: &Polygons, coded: &Polygons) -> Option<Vec<u8>> {
    if source == coded {
        return Some(Vec::new());
    }
    let (from, to) = (sorted(coded), sorted(source));
    if from.len() != to.len() || from.iter().zip(&to).any(|(a, b)| a.0 != b.0) {
        return None;
    }
    let mut order = vec![0; to.len()];
    from.iter().zip(&to).for_each(|(a, b)| order[b.1] = a.1 as u32);
    let source: Vec<&[u32]> = source.iter().collect();
    let adjacency = beside(coded);
    let with = |is_far: bool| {
        let mut coder = Encoder::default();
        coder.bypass(is_far);
        code_order(&mut coder, &adjacency, is_far, Some(&order));
        code_turns(&mut coder, coded, &order, Some(&source));
        coder.into_bytes()
    };
    let near = with(false);
    let far = (order.len() <= MAX_FAR_POINTS).then(|| with(true));
    far.filter(|far| far.len() < near.len()).or(Some(near))
}

/// Faces in the order of the source, each beginning with its corner.
///
/// # Errors
/// Bytes that the encoder did not write.
pub(super) fn decode(bytes: &[u8], coded: &Polygons) -> Result<Polygons> {
    if bytes.is_empty() {
        return Ok(coded.clone());
    }
    let mut coder = Decoder::new(bytes)?;
    let is_far = coder.bypass(false);
    if is_far && coded.len() > MAX_FAR_POINTS {
        return Err(Error::Damaged("the order of so many faces cannot have been written"));
    }
    let order = code_order(&mut coder, &beside(coded), is_far, None);
    let order = order.ok_or(Error::Damaged("faces are not in an order"))?;
    let faces = code_turns(&mut coder, coded, &order, None);
    coder.check()?;
    Ok(faces)
}

/// Each face from its smallest rotation on, and its place in the list.
fn sorted(faces: &Polygons) -> Vec<(Vec<u32>, usize)> {
    let smallest = |face: &[u32]| (0..face.len()).map(|k| [&face[k..], &face[..k]].concat()).min().unwrap_or_default();
    let mut list: Vec<(Vec<u32>, usize)> = faces.iter().map(smallest).zip(0..).collect();
    list.sort_unstable();
    list
}

/// Faces that share an edge.
fn beside(faces: &Polygons) -> Adjacency {
    let mut last: HashMap<[u32; 2], u32> = HashMap::with_capacity(faces.indices().len());
    let mut pairs = Polygons::new();
    for (f, face) in (0..).zip(faces.iter()) {
        for (k, &a) in face.iter().enumerate() {
            let b = face[(k + 1) % face.len()];
            if let Some(other) = last.insert([a.min(b), a.max(b)], f) {
                pairs.push(&[other, f]);
            }
        }
    }
    Adjacency::new(&pairs, faces.len())
}

/// Codes where each face of the source begins, counted from its smallest point, in the context of the face before.
fn code_turns(coder: &mut impl Coder, coded: &Polygons, order: &[u32], source: Option<&[&[u32]]>) -> Polygons {
    let mut models = Integers::new(ARITIES * ARITIES);
    let list: Vec<&[u32]> = coded.iter().collect();
    let mut found = Polygons::new();
    let mut before = 0;
    let mut turned = Vec::new();
    for (number, &face) in order.iter().enumerate() {
        let face = list[face as usize];
        let count = face.len();
        let smallest = (0..count).min_by_key(|&k| face[k]).unwrap_or(0);
        let begins = |k: u32| (0..count).map(move |j| face[(smallest + k as usize + j) % count]);
        let turn = source.and_then(|source| (0..count as u32).find(|&k| begins(k).eq(source[number].iter().copied())));
        let context = ARITIES * count.min(ARITIES - 1) + before;
        let turn = models.natural(coder, context, turn.unwrap_or(0)) % count.max(1) as u32;
        before = (turn as usize).min(ARITIES - 1);
        turned.clear();
        turned.extend(begins(turn));
        found.push(&turned);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::connectivity::WalkedFaces;

    #[test]
    fn faces_come_back_in_their_order_from_their_first_corner() {
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..200 {
            let points = random.u32(1..20);
            let mut faces = Polygons::new();
            for _ in 0..random.usize(..30) {
                faces.push(&(0..random.usize(3..6)).map(|_| random.u32(..points)).collect::<Vec<_>>());
            }
            let coded = WalkedFaces::new(&faces, points as usize).faces;
            let bytes = encode(&faces, &coded).unwrap();
            assert_eq!(decode(&bytes, &coded).unwrap(), faces);
            let damaged: Vec<u8> = (0..4 * random.usize(1..9)).map(|_| random.u8(..)).collect();
            if let Ok(other) = decode(&damaged, &coded) {
                assert!(encode(&other, &coded).is_some());
            }
        }
    }

    #[test]
    fn rows_of_a_grid_take_less_than_a_bit_a_face() {
        let side = 80u32;
        let at = |i: u32, j: u32| i * side + j;
        let mut faces = Polygons::new();
        for (i, j) in (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j))) {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        let coded = WalkedFaces::new(&faces, (side * side) as usize).faces;
        let bytes = encode(&faces, &coded).unwrap();
        assert!(8 * bytes.len() < faces.len(), "{} bytes of {} faces", bytes.len(), faces.len());
    }
}
