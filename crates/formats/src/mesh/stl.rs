//! Stereolithography, ASCII and binary: triangles that share vertices by position.

use std::collections::HashMap;

use cager_geometry::mesh::{Model, Point};

use super::parsed::Parsed;
use crate::error::Fault;
use crate::text::{Lines, damaged, point, quoted, words};

const HEADER: usize = 84;
const TRIANGLE: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Result<Parsed, Fault> {
    let mut shared = Shared::default();
    let mut face = Vec::new();
    scan(bytes, |corners| {
        face.clear();
        face.extend(corners.iter().map(|&point| shared.index(point)));
        shared.model.faces.push(&face);
    })?;
    let mut parsed = Parsed::from(shared.model);
    if has_colors(bytes) {
        parsed.dropped.add_on_faces("colours of triangles (attribute bytes)");
    }
    Ok(parsed)
}

/// Whether a binary file has colours in the two bytes behind each triangle.
fn has_colors(bytes: &[u8]) -> bool {
    let triangles = || promised_size(bytes).and_then(|end| bytes.get(HEADER..usize::try_from(end).ok()?));
    let mut triangles = triangles().unwrap_or_default().chunks_exact(TRIANGLE);
    triangles.any(|triangle| triangle[TRIANGLE - 2..] != [0; 2])
}

/// Calls `each` with the corners of every face.
fn scan(bytes: &[u8], each: impl FnMut(&[Point])) -> Result<(), Fault> {
    // Binary files may begin with "solid" too, but no text has the size that it promises.
    let promised = promised_size(bytes);
    if promised == Some(bytes.len() as u64) {
        return scan_binary(bytes, each);
    }
    let head = &bytes[..bytes.len().min(1024)];
    let is_text =
        bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !head.contains(&0);
    if is_text {
        return scan_ascii(bytes, each);
    }
    match promised {
        None => Err(Fault::damaged(format!(
            "has {} bytes, too few for an STL file; copy or export the file again",
            bytes.len()
        ))),
        // Some programs write colours or notes behind the triangles.
        Some(promised) if promised < bytes.len() as u64 => scan_binary(&bytes[..promised as usize], each),
        Some(promised) => Err(Fault::damaged(format!(
            "promises {} triangles in {promised} bytes but has {}; copy or export the file again",
            (promised - HEADER as u64) / TRIANGLE as u64,
            bytes.len()
        ))),
    }
}

fn promised_size(bytes: &[u8]) -> Option<u64> {
    let count = u32::from_le_bytes(*bytes.get(80..)?.first_chunk()?);
    Some(HEADER as u64 + TRIANGLE as u64 * u64::from(count))
}

fn scan_binary(bytes: &[u8], mut each: impl FnMut(&[Point])) -> Result<(), Fault> {
    for (k, triangle) in bytes[HEADER..].chunks_exact(TRIANGLE).enumerate() {
        let mut corners = [[0.0; 3]; 3];
        // After 12 bytes of normal, three corners of 12 bytes each.
        for (x, bytes) in corners.as_flattened_mut().iter_mut().zip(triangle[12..48].as_chunks::<4>().0) {
            *x = f64::from(f32::from_le_bytes(*bytes));
        }
        if !corners.as_flattened().iter().all(|x| x.is_finite()) {
            return Err(Fault::invalid(format!(
                "triangle {k}: a corner has a coordinate that is NaN or infinite; repair or remove it"
            )));
        }
        each(&corners);
    }
    Ok(())
}

fn scan_ascii(bytes: &[u8], mut each: impl FnMut(&[Point])) -> Result<(), Fault> {
    let mut face: Vec<Point> = Vec::new();
    // Some programs leave `endsolid` out, but none ends within a facet.
    let mut within_facet = false;
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        let number = lines.number();
        let mut words = words(line);
        let Some(keyword) = words.next() else {
            continue;
        };
        match keyword.to_ascii_lowercase().as_slice() {
            b"solid" | b"endsolid" => {}
            b"facet" => within_facet = true,
            b"outer" => face.clear(),
            b"endfacet" => within_facet = false,
            b"vertex" => face.push(point(&mut words, || format!("line {number}"))?),
            b"endloop" => {
                if face.len() < 3 {
                    let corners = face.len();
                    let what =
                        format!("the face has {corners} corners where at least 3 are needed; export the mesh again");
                    return Err(damaged(number, &what));
                }
                each(&face);
                face.clear();
            }
            _ => {
                let what = format!("{} is not a word of an STL file; export the mesh again", quoted(keyword));
                return Err(damaged(number, &what));
            }
        }
    }
    if within_facet || !face.is_empty() {
        return Err(Fault::damaged("ends within a facet; copy or export the file again"));
    }
    Ok(())
}

/// A model whose points are numbered in the order in which they are first met.
#[derive(Default)]
struct Shared {
    model: Model,
    indices: HashMap<[u64; 3], u32>,
}

impl Shared {
    fn index(&mut self, point: Point) -> u32 {
        // Adding zero makes −0 into 0.
        let point = point.map(|x| x + 0.0);
        let points = &mut self.model.points;
        *self.indices.entry(point.map(f64::to_bits)).or_insert_with(|| {
            points.push(point);
            (points.len() - 1) as u32
        })
    }
}
