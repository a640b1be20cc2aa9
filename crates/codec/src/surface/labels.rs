//! One number for each face, mostly that of a face beside it.

use crate::entropy::{BinaryModel, Coder, Decoder, Encoder, Integers, Models};
use crate::error::Result;
use cager_geometry::mesh::Polygons;
use std::collections::HashMap;

/// Codes labels; none at all take no bytes.
pub(super) fn encode(faces: &Polygons, labels: &[u32]) -> Vec<u8> {
    if labels.is_empty() {
        return Vec::new();
    }
    let mut coder = Encoder::default();
    code(&mut coder, faces, Some(labels));
    coder.into_bytes()
}

/// The labels of [`encode`].
pub(super) fn decode(bytes: &[u8], faces: &Polygons) -> Result<Vec<u32>> {
    let mut coder = Decoder::new(bytes)?;
    let labels = code(&mut coder, faces, None);
    coder.check()?;
    Ok(labels)
}

fn code(coder: &mut impl Coder, faces: &Polygons, given: Option<&[u32]>) -> Vec<u32> {
    let mut labels = Vec::with_capacity(faces.len());
    // The label of the last face at each edge.
    let mut edges: HashMap<[u32; 2], u32> = HashMap::with_capacity(faces.indices().len());
    let mut same = [BinaryModel::default(); 4];
    let mut numbers = Integers::new(1);
    let mut before = 0;
    for (k, face) in faces.iter().enumerate() {
        let sides = || (0..face.len()).map(|k| [face[k], face[(k + 1) % face.len()]]);
        let mut beside = sides().filter_map(|[a, b]| edges.get(&[a.min(b), a.max(b)]).copied());
        let found = beside.next();
        let guess = found.unwrap_or(before);
        // All neighbours alike, some not, or none.
        let context = if found.is_none() { 0 } else { 1 + usize::from(beside.any(|label| label != guess)) };
        let label = given.map_or(0, |given| given[k]);
        let label =
            if coder.bit(&mut same[context], label == guess) { guess } else { numbers.natural(coder, 0, label) };
        sides().for_each(|[a, b]| _ = edges.insert([a.min(b), a.max(b)], label));
        labels.push(label);
        before = label;
    }
    labels
}
