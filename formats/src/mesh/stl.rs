//! Stereolithography, ASCII and binary: triangles without shared vertices, which are shared again by position.

use std::collections::HashMap;

use cager_core::mesh::{Model, Point};

use crate::error::Fault;
use crate::text::{Lines, point, quoted, words};

const HEADER: usize = 84;
const TRIANGLE: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Result<Model, Fault> {
    // Binary files may begin with "solid" too, but no text has the very size that its bytes 80 to 83 would promise.
    let promised = promised_size(bytes);
    if promised == Some(bytes.len() as u64) {
        return read_binary(bytes);
    }
    let head = &bytes[..bytes.len().min(1024)];
    let is_text =
        bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !head.contains(&0);
    if is_text {
        return read_ascii(bytes);
    }
    Err(Fault::damaged(match promised {
        None => format!("has {} bytes, too few for an STL file; copy or export the file again", bytes.len()),
        Some(promised) => format!(
            "promises {} triangles in {promised} bytes but has {}; copy or export the file again",
            (promised - HEADER as u64) / TRIANGLE as u64,
            bytes.len()
        ),
    }))
}

fn promised_size(bytes: &[u8]) -> Option<u64> {
    let count = u32::from_le_bytes(*bytes.get(80..)?.first_chunk()?);
    Some(HEADER as u64 + TRIANGLE as u64 * u64::from(count))
}

fn read_binary(bytes: &[u8]) -> Result<Model, Fault> {
    let mut shared = Shared::default();
    for (k, triangle) in bytes[HEADER..].chunks_exact(TRIANGLE).enumerate() {
        let mut face = [0; 3];
        // After 12 bytes of normal, three corners of 12 bytes each.
        for (corner, bytes) in face.iter_mut().zip(triangle[12..48].chunks_exact(12)) {
            let mut point = [0.0; 3];
            for (x, bytes) in point.iter_mut().zip(bytes.as_chunks::<4>().0) {
                *x = f64::from(f32::from_le_bytes(*bytes));
            }
            if !point.iter().all(|x| x.is_finite()) {
                return Err(Fault::invalid(format!(
                    "triangle {k}: a corner has a coordinate that is NaN or infinite; repair or remove it"
                )));
            }
            *corner = shared.index(point);
        }
        shared.model.faces.push(&face);
    }
    Ok(shared.model)
}

fn read_ascii(bytes: &[u8]) -> Result<Model, Fault> {
    let mut shared = Shared::default();
    let mut face = Vec::new();
    let mut inside = true;
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        let number = lines.number();
        let mut words = words(line);
        let Some(keyword) = words.next() else {
            continue;
        };
        match keyword.to_ascii_lowercase().as_slice() {
            b"solid" => inside = true,
            b"endsolid" => inside = false,
            b"facet" | b"outer" => face.clear(),
            b"endfacet" => {}
            b"vertex" => {
                let point = point(&mut words, || format!("line {number}"))?;
                face.push(shared.index(point));
            }
            b"endloop" => {
                super::check_face(&face, usize::MAX, || format!("line {number}"))?;
                shared.model.faces.push(&face);
                face.clear();
            }
            _ => {
                return Err(Fault::damaged(format!(
                    "line {number}: {} is not a word of an STL file; export the mesh again",
                    quoted(keyword)
                )));
            }
        }
    }
    if inside || !face.is_empty() {
        return Err(Fault::damaged("ends without `endsolid`; copy or export the file again"));
    }
    Ok(shared.model)
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
