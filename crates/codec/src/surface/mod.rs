//! What lies on the faces of a model to bytes and back: which corners share a value, the values on a grid, labels of
//! faces, and the order in which the source has its faces.

mod face_order;
mod labels;
mod sharing;
mod values;

use crate::error::{Error, Result};
use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{CornerSet, FaceGroup, NO_MATERIAL, Part, Surface};
use values::{decode_values, encode_values};

pub use face_order::{decode_face_order, encode_face_order};

/// Half of it is the error of texture coordinates: a quarter of a texel of a picture of 8,192.
const UV_STEP: f64 = 1.0 / 16_384.0;
/// Colours of eight bits are kept to half of their step.
const COLOR_STEP: f64 = 1.0 / 1_020.0;
/// Most corner sets and groups of all parts together.
const MAX_STREAMS: usize = 1 << 16;

const CUT: Error = Error::Damaged("what lies on the faces is cut");

/// Codes all numbers of a surface; names and what a part has are for the caller to keep.
pub fn encode_surface(surface: &Surface, faces: &Polygons) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (part, range) in surface.ranges(faces) {
        let local = range.local(faces);
        let mut put = |stream: Vec<u8>| {
            bytes.extend((stream.len() as u32).to_le_bytes());
            bytes.extend(stream);
        };
        part.uv_sets.iter().for_each(|set| put(encode_set(set, &local, part.points, UV_STEP)));
        part.color_sets.iter().for_each(|set| put(encode_set(set, &local, part.points, COLOR_STEP)));
        put(if part.normals.is_empty() { Vec::new() } else { sharing::encode(&local, part.points, &part.normals) });
        put(labels::encode(&local, &part.materials.iter().map(|&k| k.wrapping_add(1)).collect::<Vec<_>>()));
        for group in &part.groups {
            let mut inside = vec![0; part.faces];
            group.faces.iter().for_each(|&face| inside[face as usize] = 1);
            put(labels::encode(&local, &inside));
        }
    }
    bytes
}

/// Fills in the numbers of [`encode_surface`]: `outline` has the parts with their sizes, and the names of all sets and
/// groups. At most `most_numbers` are read.
///
/// # Errors
/// Bytes that the encoder did not write for this outline and these faces.
pub fn decode_surface(bytes: &[u8], outline: Surface, faces: &Polygons, most_numbers: usize) -> Result<Surface> {
    let mut surface = Surface { materials: outline.materials.clone(), parts: Vec::new() };
    let mut streams = Streams { bytes, numbers_left: most_numbers, streams_left: MAX_STREAMS };
    for (part, range) in outline.ranges(faces) {
        if range.faces.end > faces.len() {
            return Err(Error::Damaged("parts have more faces than there are"));
        }
        let local = range.local(faces);
        if local.indices().iter().any(|&point| point as usize >= part.points) {
            return Err(Error::Damaged("a face has corners in two parts"));
        }
        let corners = local.indices().len();
        let mut filled = Part { normals: Vec::new(), materials: Vec::new(), ..part.clone() };
        for set in &mut filled.uv_sets {
            decode_set(streams.next(5 * corners)?, set, &local, part.points)?;
        }
        for set in &mut filled.color_sets {
            decode_set(streams.next(7 * corners)?, set, &local, part.points)?;
        }
        let normals = streams.next(corners)?;
        if !normals.is_empty() {
            filled.normals = sharing::decode(normals, &local, part.points)?.0;
        }
        let materials = streams.next(part.faces)?;
        if !materials.is_empty() {
            let labels = labels::decode(materials, &local)?;
            filled.materials = labels.into_iter().map(|k| k.wrapping_sub(1)).collect();
            let count = outline.materials.len();
            if filled.materials.iter().any(|&k| k != NO_MATERIAL && k as usize >= count) {
                return Err(Error::Damaged("a face has a material that is not there"));
            }
        }
        for group in &mut filled.groups {
            *group = FaceGroup { name: std::mem::take(&mut group.name), faces: Vec::new() };
            let inside = labels::decode(streams.next(part.faces)?, &local)?;
            group.faces.extend((0..part.faces as u32).filter(|&face| inside[face as usize] == 1));
        }
        surface.parts.push(filled);
    }
    if streams.bytes.is_empty() { Ok(surface) } else { Err(Error::Damaged("more lies on the faces than is named")) }
}

/// Streams one after another, each behind its length.
struct Streams<'a> {
    bytes: &'a [u8],
    numbers_left: usize,
    streams_left: usize,
}

impl<'a> Streams<'a> {
    /// The next one, which decodes to so many numbers at the most.
    fn next(&mut self, numbers: usize) -> Result<&'a [u8]> {
        let too_many = Error::Damaged("more lies on the faces than a file of this size holds");
        self.streams_left = self.streams_left.checked_sub(1).ok_or(too_many)?;
        let (length, rest) = self.bytes.split_first_chunk::<4>().ok_or(CUT)?;
        let (stream, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CUT)?;
        self.bytes = rest;
        if !stream.is_empty() {
            self.numbers_left = self.numbers_left.checked_sub(numbers).ok_or(CUT)?;
        }
        Ok(stream)
    }
}

/// A corner set: how its values are shared behind the length of that, then the values.
fn encode_set<const N: usize>(set: &CornerSet<N>, faces: &Polygons, points: usize, step: f64) -> Vec<u8> {
    let sharing = sharing::encode(faces, points, &set.corners);
    let (corners, firsts) = sharing::numbered(faces, points, &set.corners);
    let values: Vec<[f32; N]> = firsts.iter().map(|&corner| set.values[set.corners[corner] as usize]).collect();
    let mut bytes = (sharing.len() as u32).to_le_bytes().to_vec();
    bytes.extend(sharing);
    bytes.extend(encode_values(&renamed(faces, &corners), &values, step));
    bytes
}

fn decode_set<const N: usize>(bytes: &[u8], set: &mut CornerSet<N>, faces: &Polygons, points: usize) -> Result<()> {
    let (length, rest) = bytes.split_first_chunk::<4>().ok_or(CUT)?;
    let (sharing, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CUT)?;
    let (corners, count) = sharing::decode(sharing, faces, points)?;
    set.values = decode_values(rest, &renamed(faces, &corners), count)?;
    set.corners = corners;
    Ok(())
}

/// Faces with the values at their corners in place of the points: a mesh of its own, torn at the seams.
fn renamed(faces: &Polygons, corners: &[u32]) -> Polygons {
    let mut torn = Polygons::new();
    let mut rest = corners;
    for &arity in faces.arities() {
        let (face, tail) = rest.split_at(arity as usize);
        torn.push(face);
        rest = tail;
    }
    torn
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::surface::Material;

    /// A part of `side` × `side` points whose texture is cut in the middle.
    fn part(side: u32, first: u32, faces: &mut Polygons) -> Part {
        let at = |i: u32, j: u32| first + i * side + j;
        let mut uvs = CornerSet { name: "UVMap".to_owned(), ..CornerSet::default() };
        let mut colors = CornerSet { name: "Col".to_owned(), ..CornerSet::default() };
        let (mut normals, mut materials) = (Vec::new(), Vec::new());
        for (i, j) in (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j))) {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            let right = j >= side / 2;
            for (di, dj) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                let (x, y) = ((i + di) as f32 / 100.0, (j + dj) as f32 / 90.0);
                uvs.values.push([x + if right { 0.3 } else { 0.0 }, y]);
                colors.values.push([x, 0.25, y, 1.0]);
                normals.push((at(i + di, j + dj) - first) * 2 + u32::from(right));
            }
            materials.push(if i == 0 { NO_MATERIAL } else { u32::from(right) });
        }
        uvs.corners = (0..uvs.values.len() as u32).collect();
        colors.corners = uvs.corners.clone();
        // Values that are equal are one.
        let mut distinct: Vec<[f32; 2]> = uvs.values.clone();
        distinct.sort_by(|a, b| a.partial_cmp(b).unwrap());
        distinct.dedup();
        uvs.corners = uvs.values.iter().map(|v| distinct.iter().position(|d| d == v).unwrap() as u32).collect();
        uvs.values = distinct;
        let groups = vec![FaceGroup { name: "rim".to_owned(), faces: vec![0, 3, 4] }];
        Part {
            path: "/root/part".to_owned(),
            points: (side * side) as usize,
            faces: materials.len(),
            uv_sets: vec![uvs],
            color_sets: vec![colors],
            normals,
            materials,
            groups,
            ..Part::default()
        }
    }

    fn by_corner<const N: usize>(set: &CornerSet<N>) -> Vec<[f32; N]> {
        set.corners.iter().map(|&k| set.values[k as usize]).collect()
    }

    fn outline(surface: &Surface) -> Surface {
        let mut outline = surface.clone();
        for part in &mut outline.parts {
            part.uv_sets.iter_mut().for_each(|set| (set.values, set.corners) = (Vec::new(), Vec::new()));
            part.color_sets.iter_mut().for_each(|set| (set.values, set.corners) = (Vec::new(), Vec::new()));
            (part.normals, part.materials) = (Vec::new(), Vec::new());
            part.groups.iter_mut().for_each(|group| group.faces = Vec::new());
        }
        outline
    }

    fn two_parts() -> (Surface, Polygons) {
        let mut faces = Polygons::new();
        let parts = vec![part(9, 0, &mut faces), part(30, 81, &mut faces)];
        let named = |name: &str| Material { name: name.to_owned(), ..Material::default() };
        (Surface { parts, materials: vec![named("skin"), named("cloth")] }, faces)
    }

    #[test]
    fn everything_on_the_faces_comes_back_within_its_step() {
        let (surface, faces) = two_parts();
        surface.check(981, &faces).unwrap();
        let bytes = encode_surface(&surface, &faces);
        assert!(bytes.len() < 1_800, "{}", bytes.len());
        let back = decode_surface(&bytes, outline(&surface), &faces, 1 << 20).unwrap();
        back.check(981, &faces).unwrap();
        for (a, b) in surface.parts.iter().zip(&back.parts) {
            for (x, y) in by_corner(&a.uv_sets[0]).iter().zip(by_corner(&b.uv_sets[0])) {
                assert!((0..2).all(|k| (x[k] - y[k]).abs() <= 1.0 / 32_768.0 + 1e-6));
            }
            for (x, y) in by_corner(&a.color_sets[0]).iter().zip(by_corner(&b.color_sets[0])) {
                assert!((0..4).all(|k| (x[k] - y[k]).abs() <= 0.5 / 1_020.0 + 1e-6));
            }
            assert_eq!((&a.materials, &a.groups), (&b.materials, &b.groups));
            // The same corners share a normal.
            for (k, j) in (0..a.normals.len()).flat_map(|k| [(k, (k + 1) % a.normals.len()), (k, k / 2)]) {
                assert_eq!(a.normals[k] == a.normals[j], b.normals[k] == b.normals[j]);
            }
        }
    }

    #[test]
    fn damage_is_an_error_or_a_surface_that_fits() {
        let (surface, faces) = two_parts();
        let bytes = encode_surface(&surface, &faces);
        let mut random = fastrand::Rng::with_seed(11);
        for _ in 0..300 {
            let mut damaged = bytes.clone();
            for _ in 0..random.usize(1..5) {
                let at = random.usize(..damaged.len());
                damaged[at] = random.u8(..);
            }
            damaged.truncate(random.usize(..2 * damaged.len()).min(bytes.len()));
            if let Ok(back) = decode_surface(&damaged, outline(&surface), &faces, 1 << 20) {
                back.check(981, &faces).unwrap();
            }
        }
        assert!(decode_surface(&bytes, outline(&surface), &faces, 1_000).is_err());
    }
}
