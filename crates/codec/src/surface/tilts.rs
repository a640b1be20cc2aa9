//! How normals are tilted: of each whether it is, and two angles on a grid.

use crate::entropy::{BinaryModel, Coder, Decoder, Encoder, Integers, Models};
use crate::error::{Error, Result};
use cager_geometry::mesh::Polygons;
use cager_geometry::surface::numbered;

/// Steps of half a turn.
const STEPS: i32 = 360;
const STEP: f32 = std::f32::consts::PI / STEPS as f32;
/// Normals are like the last ones that began at the same place of a face; those behind these are together.
const PLACES: usize = 8;

/// Codes the angles of the normals that corners of each point have where these numbers are the same.
pub(super) fn encode(faces: &Polygons, numbers: &[u32], tilts: &[[f32; 2]]) -> Vec<u8> {
    let (corners, firsts) = numbered(faces, numbers);
    let steps = |x: f32| ((x / STEP).round() as i32).clamp(-STEPS, STEPS);
    let given: Vec<[i32; 2]> = firsts.iter().map(|&corner| tilts[corner].map(steps)).collect();
    let mut coder = Encoder::default();
    code(&mut coder, faces, &corners, Some(&given));
    coder.into_bytes()
}

/// The angles of each corner, whose normals have numbers from 0 on as they come.
pub(super) fn decode(bytes: &[u8], faces: &Polygons, corners: &[u32]) -> Result<Vec<[f32; 2]>> {
    let mut coder = Decoder::new(bytes)?;
    let found = code(&mut coder, faces, corners, None);
    coder.check()?;
    if found.as_flattened().iter().any(|steps| steps.abs() > STEPS) {
        return Err(Error::Damaged("normals are tilted by more than half a turn"));
    }
    Ok(corners.iter().map(|&number| found[number as usize].map(|steps| steps as f32 * STEP)).collect())
}

/// The steps of each normal; of those that are not tilted none.
fn code(coder: &mut impl Coder, faces: &Polygons, corners: &[u32], given: Option<&[[i32; 2]]>) -> Vec<[i32; 2]> {
    let mut found: Vec<[i32; 2]> = Vec::new();
    let (mut tilted, mut numbers) = ([BinaryModel::default(); 2], Integers::new(2));
    let (mut last, mut is_tilted) = ([[0; 2]; PLACES], false);
    let mut corners = corners.iter();
    for face in faces.iter() {
        for (place, &number) in (0..face.len()).zip(corners.by_ref()) {
            if number as usize != found.len() {
                continue;
            }
            let wanted = given.map_or([0; 2], |given| given[found.len()]);
            is_tilted = coder.bit(&mut tilted[usize::from(is_tilted)], wanted != [0; 2]);
            let mut steps = [0; 2];
            if is_tilted {
                let expected = &mut last[place.min(PLACES - 1)];
                for k in 0..2 {
                    let step = numbers.code(coder, k, wanted[k] - expected[k]).saturating_add(expected[k]);
                    (steps[k], expected[k]) = (step, step.clamp(-STEPS, STEPS));
                }
            }
            found.push(steps);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(side: u32) -> Polygons {
        let mut faces = Polygons::new();
        for (i, j) in (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| i * side + j;
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        faces
    }

    #[test]
    fn angles_come_back_within_half_a_step_and_none_where_there_are_none() {
        let faces = grid(20);
        let tilt = |&point: &u32| match point / 20 {
            0..5 => [0.0; 2],
            row => [0.05 * row as f32 - 0.4, 0.3 + (point as f32).sin() / 50.0],
        };
        let tilts: Vec<[f32; 2]> = faces.indices().iter().map(tilt).collect();
        let numbers = vec![7; faces.indices().len()];
        let bytes = encode(&faces, &numbers, &tilts);
        assert!(bytes.len() < 500, "{}", bytes.len());
        let back = decode(&bytes, &faces, &numbered(&faces, &numbers).0).unwrap();
        for (given, found) in tilts.iter().zip(&back) {
            assert!((0..2).all(|k| (given[k] - found[k]).abs() <= 0.5 * STEP + 1e-6));
            assert_eq!(given == &[0.0; 2], found == &[0.0; 2]);
        }
    }

    #[test]
    fn damage_is_an_error_or_angles_up_to_half_a_turn() {
        let faces = grid(9);
        let corners = numbered(&faces, &vec![0; faces.indices().len()]).0;
        let mut random = fastrand::Rng::with_seed(8);
        let mut failed = 0;
        for _ in 0..200 {
            let bytes: Vec<u8> = (0..4 * random.usize(..60)).map(|_| random.u8(..)).collect();
            match decode(&bytes, &faces, &corners) {
                Ok(angles) => assert!(angles.as_flattened().iter().all(|x| x.abs() < 3.15)),
                Err(_) => failed += 1,
            }
        }
        assert!(failed > 0);
        assert!(decode(&[1, 2, 3], &faces, &corners).is_err());
    }
}
