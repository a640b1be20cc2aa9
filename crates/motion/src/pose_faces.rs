//! Whether poses have the same faces.

use cager_geometry::mesh::Polygons;
use std::fmt::Display;

/// A pose has other faces than the first one: which one, and the first of them.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct OtherFaces(String);

/// A pose without faces of its own has those of the first. Both come with their names.
///
/// # Errors
/// Other faces, or another order of them.
pub fn same_faces<N: Display>(
    (file, faces): (&N, &Polygons),
    (first_file, first): (&N, &Polygons),
) -> Result<(), OtherFaces> {
    if faces.is_empty() || faces == first {
        return Ok(());
    }
    let what = match faces.iter().zip(first.iter()).enumerate().find(|(_, (a, b))| a != b) {
        Some((face, (a, b))) => format!(
            "{file}: face {face} has the vertices {}, in {first_file} it has {} (counted from 0)",
            listed(a),
            listed(b)
        ),
        None => format!(
            "{file}: has {} faces, {first_file} has {}, so face {} is missing in one of them",
            faces.len(),
            first.len(),
            faces.len().min(first.len())
        ),
    };
    Err(OtherFaces(format!("{what}; poses have the same faces in the same order")))
}

fn listed(face: &[u32]) -> String {
    face.iter().map(u32::to_string).collect::<Vec<_>>().join(" ")
}
