//! Reading the model and its cage.

use super::reader::ContainerReader;
use super::section::is_coded;
use super::{Error, tag};
use crate::le::value_at;
use cager_codec::{decode_faces, decode_positions};
use cager_geometry::mesh::{Model, Point, Polygons, TriMesh};
use std::io::{Read, Seek};

impl<R: Read + Seek> ContainerReader<R> {
    /// The model at rest about the [origin](super::Header::origin), without its colours.
    pub fn rest(&mut self) -> Result<Model, Error> {
        if let Some(rest) = &self.rest {
            return Ok(rest.clone());
        }
        let faces = self.rest_faces()?;
        let points = self.positions(tag::REST_POINTS, &faces)?;
        let rest = Model { points, faces, ..Model::default() };
        // Decoding takes several times as long as reading numbers that are there as they are.
        if is_coded(self.entry(tag::REST_POINTS)?.header.codec) {
            self.rest = Some(rest.clone());
        }
        Ok(rest)
    }

    /// Colours of the model's points; empty where the file has none. Positions decode without them.
    pub fn colors(&mut self) -> Result<Vec<[u8; 3]>, Error> {
        Ok(self.optional(tag::REST_COLORS)?.map_or_else(Vec::new, |(_, raw)| raw.as_chunks().0.to_vec()))
    }

    /// The boundary elements that the coordinates were solved on, if any, for the system to check.
    pub fn elements(&mut self) -> Result<Option<Vec<u8>>, Error> {
        Ok(self.optional(tag::ELEMENTS)?.map(|(_, raw)| raw))
    }

    fn rest_faces(&mut self) -> Result<Polygons, Error> {
        let (points, count) = (self.header.points as usize, self.header.rest_faces as usize);
        if count == 0 {
            return Ok(Polygons::new());
        }
        if let Some(coded) = self.coded(tag::REST_FACES)? {
            let corners = self.header.rest_corners as usize;
            // Faces are decoded before the positions that say how many points there can be.
            self.check_limit(self.entry(tag::REST_POINTS)?)?;
            return coded.decode(|bytes| decode_faces(bytes, points, count, corners));
        }
        let entry = self.entry(tag::REST_FACES)?;
        let numbers = self.numbers(entry, u32::from_le_bytes)?;
        let (arities, mut rest) = numbers.split_at(count);
        let wrong = |what: &str| {
            Error::corrupt(entry.offset, format!("the faces of the model have {what} corners than there are"))
        };
        let mut faces = Polygons::new();
        for &arity in arities {
            let (face, tail) = rest.split_at_checked(arity as usize).ok_or_else(|| wrong("more"))?;
            check_indices(face, points, entry.offset)?;
            faces.push(face);
            rest = tail;
        }
        if rest.is_empty() { Ok(faces) } else { Err(wrong("fewer")) }
    }

    /// The cage around the rest pose, about the [origin](super::Header::origin).
    pub fn cage(&mut self) -> Result<TriMesh, Error> {
        let (points, count) = (self.header.cage_vertices as usize, self.header.cage_faces as usize);
        if let Some(coded) = self.coded(tag::CAGE_FACES)? {
            self.check_limit(self.entry(tag::CAGE_VERTICES)?)?;
            let faces = coded.decode(|bytes| decode_faces(bytes, points, count, count.saturating_mul(3)))?;
            if faces.arities().iter().any(|&arity| arity != 3) {
                return Err(Error::corrupt(coded.entry.offset, "the cage has faces that are no triangles"));
            }
            let vertices = self.positions(tag::CAGE_VERTICES, &faces)?;
            return Ok(TriMesh { vertices, triangles: faces.triangulated() });
        }
        let vertices = self.positions(tag::CAGE_VERTICES, &Polygons::new())?;
        let entry = self.entry(tag::CAGE_FACES)?;
        let triangle = |b: [u8; 12]| [0, 4, 8].map(|at| value_at(&b, at, u32::from_le_bytes));
        let triangles = self.numbers(entry, triangle)?;
        check_indices(triangles.as_flattened(), vertices.len(), entry.offset)?;
        Ok(TriMesh { vertices, triangles })
    }

    fn positions(&mut self, tag: [u8; 4], faces: &Polygons) -> Result<Vec<Point>, Error> {
        let entry = self.entry(tag)?;
        let points = if let Some(coded) = self.coded(tag)? {
            let count = if tag == tag::REST_POINTS { self.header.points } else { self.header.cage_vertices };
            coded.decode(|bytes| decode_positions(bytes, faces, count as usize))?
        } else if entry.header.width == 4 {
            let point = |b: [u8; 12]| [0, 4, 8].map(|at| f64::from(value_at(&b, at, f32::from_le_bytes)));
            self.numbers(entry, point)?
        } else {
            let point = |b: [u8; 24]| [0, 8, 16].map(|at| value_at(&b, at, f64::from_le_bytes));
            self.numbers(entry, point)?
        };
        match points.iter().position(|p: &Point| p.iter().any(|x| !x.is_finite())) {
            Some(k) => Err(Error::corrupt(entry.offset, format!("position {k} is not finite"))),
            None => Ok(points),
        }
    }
}

fn check_indices(indices: &[u32], points: usize, offset: u64) -> Result<(), Error> {
    match indices.iter().find(|&&i| i as usize >= points) {
        Some(i) => Err(Error::corrupt(offset, format!("a face names point {i} of {points}"))),
        None => Ok(()),
    }
}
