//! What lies on the faces of a model to bytes and back: which corners share a value, the values on a grid, how normals
//! are tilted, labels of faces, and the order in which the source has its faces.

mod face_order;
mod labels;
mod sharing;
mod tilts;
mod values;

use crate::error::{Error, Result};
use cager_geometry::mesh::{Model, Polygons};
use cager_geometry::surface::{CornerSet, Part, Surface, Tilts, numbered};
use values::{decode_values, encode_values};

/// Half of it is the error of texture coordinates: a quarter of a texel of a picture of 8,192.
const UV_STEP: f64 = 1.0 / 16_384.0;
/// Colours of eight bits are kept to half of their step.
const COLOR_STEP: f64 = 1.0 / 1_020.0;
/// Most corner sets and groups of all parts together, unless there are bytes for the lengths of more.
const MAX_STREAMS: usize = 1 << 16;
/// Numbers that are decoded at the most for each face and corner, and for each byte.
const NUMBERS_OF_CORNERS: usize = 64;
const NUMBERS_OF_BYTES: usize = 16;

const CUT: Error = Error::Damaged("what lies on the faces is cut");
const TOO_MANY: Error = Error::Damaged("more lies on the faces than a file of this size holds");

/// What lies on the faces of a mesh, as bytes.
#[derive(Clone, Debug)]
pub struct CodedSurface {
    /// The parts with their sizes, and the names of all sets and groups, without numbers by corner or face.
    pub outline: Surface,
    /// The order of the faces behind its length, then a stream for each set.
    pub bytes: Vec<u8>,
}

impl CodedSurface {
    /// Of a mesh whose faces are decoded in the order of `coded`. `None` where nothing lies on its faces.
    pub fn new(mesh: &Model, coded: &Polygons) -> Option<Self> {
        if mesh.surface.is_empty() {
            return None;
        }
        let order = face_order::encode(&mesh.faces, coded)?;
        let mut bytes = (order.len() as u32).to_le_bytes().to_vec();
        bytes.extend(order);
        bytes.extend(encode_parts(&mesh.surface, &mesh.faces));
        Some(Self { outline: outline(mesh.surface.clone()), bytes })
    }

    /// The surface, and the faces in the order of the source that it is of.
    ///
    /// # Errors
    /// Bytes that the encoder did not write for these faces of so many points.
    pub fn decode(self, coded: &Polygons, points: usize) -> Result<(Surface, Polygons)> {
        let (length, rest) = self.bytes.split_first_chunk::<4>().ok_or(CUT)?;
        let (order, streams) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CUT)?;
        let parts = &self.outline.parts;
        let sum = |of: fn(&Part) -> usize| parts.iter().try_fold(0, |sum: usize, part| sum.checked_add(of(part)));
        if (sum(|part| part.points), sum(|part| part.faces)) != (Some(points), Some(coded.len())) {
            return Err(Error::Damaged("parts are not those of the mesh"));
        }
        let faces = face_order::decode(order, coded)?;
        let most = NUMBERS_OF_CORNERS * (coded.len() + coded.indices().len()) + NUMBERS_OF_BYTES * streams.len();
        let streams = Streams { bytes: streams, numbers_left: most, streams_left: MAX_STREAMS.max(streams.len() / 4) };
        let surface = decode_parts(streams, self.outline, &faces)?;
        surface.check(points, &faces).map_err(|_| Error::Damaged("what lies on the faces does not fit them"))?;
        Ok((surface, faces))
    }
}

/// Without what the streams hold.
fn outline(mut surface: Surface) -> Surface {
    for part in &mut surface.parts {
        part.uv_sets.iter_mut().for_each(|set| (set.values, set.corners) = (Vec::new(), Vec::new()));
        part.color_sets.iter_mut().for_each(|set| (set.values, set.corners) = (Vec::new(), Vec::new()));
        (part.normals, part.materials) = (Vec::new(), Vec::new());
        part.tilts.iter_mut().for_each(|tilts| tilts.corners = Vec::new());
        part.groups.iter_mut().for_each(|group| group.faces = Vec::new());
    }
    surface
}

fn encode_parts(surface: &Surface, faces: &Polygons) -> Vec<u8> {
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
        part.tilts.iter().for_each(|tilts| put(tilts::encode(&local, &part.normals, &tilts.corners)));
        put(labels::encode(&local, &part.materials.iter().map(|&k| k.wrapping_add(1)).collect::<Vec<_>>()));
        for group in &part.groups {
            let mut inside = vec![0; part.faces];
            group.faces.iter().for_each(|&face| inside[face as usize] = 1);
            put(labels::encode(&local, &inside));
        }
    }
    bytes
}

fn decode_parts(mut streams: Streams<'_>, outline: Surface, faces: &Polygons) -> Result<Surface> {
    let mut parts = Vec::with_capacity(outline.parts.len());
    for (part, range) in outline.ranges(faces) {
        let local = range.local(faces);
        if local.indices().iter().any(|&point| point as usize >= part.points) {
            return Err(Error::Damaged("a face has corners in two parts"));
        }
        let corners = local.indices().len();
        let mut filled = part.clone();
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
        if filled.tilts.is_some() {
            let tilts = streams.next(2 * corners)?;
            if filled.normals.is_empty() {
                return Err(Error::Damaged("normals are tilted that are not there"));
            }
            filled.tilts = Some(Tilts { corners: tilts::decode(tilts, &local, &filled.normals)? });
        }
        let materials = streams.next(part.faces)?;
        if !materials.is_empty() {
            filled.materials = labels::decode(materials, &local)?.into_iter().map(|k| k.wrapping_sub(1)).collect();
        }
        for group in &mut filled.groups {
            let inside = labels::decode(streams.next(part.faces)?, &local)?;
            group.faces = (0..part.faces as u32).filter(|&face| inside[face as usize] == 1).collect();
        }
        parts.push(filled);
    }
    if streams.bytes.is_empty() {
        Ok(Surface { parts, ..outline })
    } else {
        Err(Error::Damaged("more lies on the faces than is named"))
    }
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
        self.streams_left = self.streams_left.checked_sub(1).ok_or(TOO_MANY)?;
        let (length, rest) = self.bytes.split_first_chunk::<4>().ok_or(CUT)?;
        let (stream, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CUT)?;
        self.bytes = rest;
        self.numbers_left = self.numbers_left.checked_sub(numbers).ok_or(TOO_MANY)?;
        Ok(stream)
    }
}

/// A corner set: how its values are shared behind the length of that, then the values.
fn encode_set<const N: usize>(set: &CornerSet<N>, faces: &Polygons, points: usize, step: f64) -> Vec<u8> {
    let sharing = sharing::encode(faces, points, &set.corners);
    let (corners, firsts) = numbered(faces, &set.corners);
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
    use crate::connectivity::WalkedFaces;
    use cager_geometry::surface::{FaceGroup, Material, NO_MATERIAL};

    const POINTS: usize = 981;

    /// A part of `side` × `side` points whose texture is cut in the middle; the normals of a large one are tilted.
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
        let tilt = |&normal: &u32| if normal % 3 == 0 { [0.1 + normal as f32 / 9_000.0, -0.3] } else { [0.0; 2] };
        let tilts = (side > 9).then(|| Tilts { corners: normals.iter().map(tilt).collect() });
        let groups = vec![FaceGroup { name: "rim".to_owned(), faces: vec![0, 3, 4] }];
        Part {
            path: "/root/part".to_owned(),
            points: (side * side) as usize,
            faces: materials.len(),
            uv_sets: vec![uvs],
            color_sets: vec![colors],
            normals,
            tilts,
            materials,
            groups,
            ..Part::default()
        }
    }

    fn by_corner<const N: usize>(set: &CornerSet<N>) -> Vec<[f32; N]> {
        set.corners.iter().map(|&k| set.values[k as usize]).collect()
    }

    fn two_parts() -> Model {
        let mut faces = Polygons::new();
        let parts = vec![part(9, 0, &mut faces), part(30, 81, &mut faces)];
        let named = |name: &str| Material { name: name.to_owned(), ..Material::default() };
        let surface = Surface { parts, materials: vec![named("skin"), named("cloth")], ..Surface::default() };
        Model { points: vec![[0.0; 3]; POINTS], faces, surface, ..Model::default() }
    }

    #[test]
    fn everything_on_the_faces_comes_back_within_its_step() {
        let mesh = two_parts();
        mesh.surface.check(POINTS, &mesh.faces).unwrap();
        let walked = WalkedFaces::new(&mesh.faces, POINTS).faces;
        assert_ne!(walked, mesh.faces);
        let coded = CodedSurface::new(&mesh, &walked).unwrap();
        assert!(coded.bytes.len() < 1_800, "{}", coded.bytes.len());
        let (back, faces) = coded.decode(&walked, POINTS).unwrap();
        assert_eq!(faces, mesh.faces);
        for (a, b) in mesh.surface.parts.iter().zip(&back.parts) {
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
            assert_eq!(a.tilts.is_some(), b.tilts.is_some());
            let angles = |part: &Part| part.tilts.clone().unwrap_or_default().corners.into_flattened();
            assert!(angles(a).iter().zip(angles(b)).all(|(x, y)| (x - y).abs() < 0.0044));
        }
    }

    #[test]
    fn damage_is_an_error_or_a_surface_that_fits() {
        let mesh = two_parts();
        let coded = CodedSurface::new(&mesh, &mesh.faces).unwrap();
        let mut random = fastrand::Rng::with_seed(11);
        for _ in 0..300 {
            let mut damaged = coded.clone();
            for _ in 0..random.usize(1..5) {
                let at = random.usize(..damaged.bytes.len());
                damaged.bytes[at] = random.u8(..);
            }
            damaged.bytes.truncate(random.usize(..2 * coded.bytes.len()).max(1));
            if let Ok((back, faces)) = damaged.decode(&mesh.faces, POINTS) {
                back.check(POINTS, &faces).unwrap();
            }
        }
        let mut other = coded;
        other.outline.parts[0].points = usize::MAX;
        assert!(other.decode(&mesh.faces, POINTS).is_err());
    }
}
