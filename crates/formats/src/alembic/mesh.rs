//! What a polygon mesh holds: its positions, and its faces, which wind clockwise.

use std::io::{Read, Seek};

use cager_geometry::mesh::Polygons;

use super::objects::Archive;
use super::ogawa::{Block, Container, Failure, damaged};
use super::properties::{F32, F64, I32, Kind, Property, U32, find};
use crate::error::Fault;
use crate::frames::Scalar;
use crate::mesh::check_face;

/// Bytes of corners that a point has at the most, and those that a mesh may have however few its points are.
const CORNERS_OF_POINT: u64 = 4 * 64;
const MOST_OF_FEW: u64 = 1 << 20;

pub(super) struct Mesh {
    pub(super) positions: Property,
    /// Corners of all faces, back to back.
    pub(super) indices: Property,
    /// Numbers of corners.
    pub(super) counts: Property,
    /// How positions are stored.
    pub(super) scalar: Scalar,
}

/// Faces of a mesh.
#[derive(Debug)]
pub(super) struct Faces {
    /// Those of three corners and more.
    pub(super) polygons: Polygons,
    /// How many there are beside them of fewer than three corners.
    pub(super) left_out: usize,
    /// Where they are stored.
    pub(super) blocks: [Block; 2],
}

impl Mesh {
    pub(super) fn open<R: Read + Seek>(archive: &mut Archive<R>, object: usize) -> Result<Self, Failure> {
        let properties = archive.schema(object, ".geom")?;
        let array = |name: &str| {
            let found = find(&properties, name, Kind::Array).filter(|property| property.samples > 0);
            found
                .cloned()
                .ok_or_else(|| Fault::invalid(format!("has a mesh without samples of {name}; export it again")))
        };
        let (positions, indices, counts) = (array("P")?, array(".faceIndices")?, array(".faceCounts")?);
        let scalar = match (positions.extent, positions.number) {
            (3, F32) => Scalar::F32Little,
            (3, F64) => Scalar::F64Little,
            _ => {
                let what = "has positions that are not three numbers of single or double precision; export it again";
                return Err(Fault::unsupported(what).into());
            }
        };
        if [&indices, &counts].iter().any(|faces| !matches!(faces.number, I32 | U32)) {
            return Err(damaged("its faces are not whole numbers of four bytes").into());
        }
        Ok(Self { positions, indices, counts, scalar })
    }

    /// How many points a sample has, and where they are.
    pub(super) fn points<R: Read + Seek>(
        &self,
        container: &mut Container<R>,
        sample: usize,
    ) -> Result<(u64, Block), Failure> {
        let block = self.positions.sample(container, sample)?;
        let size = 3 * self.scalar.size() as u64;
        if block.length % size != 0 {
            return Err(damaged("its positions end within a point").into());
        }
        Ok((block.length / size, block))
    }

    /// The faces at samples of their corners and of the numbers of them, as they are stored or turned around.
    pub(super) fn faces<R: Read + Seek>(
        &self,
        container: &mut Container<R>,
        [indices, counts]: [usize; 2],
        points: usize,
        as_stored: bool,
    ) -> Result<Faces, Failure> {
        let blocks = [self.indices.sample(container, indices)?, self.counts.sample(container, counts)?];
        let most = MOST_OF_FEW.max(CORNERS_OF_POINT.saturating_mul(points as u64));
        if blocks.iter().any(|block| block.length > most) {
            return Err(damaged(&format!("it has more faces than {points} points can have")).into());
        }
        let (indices, counts) = (container.table(blocks[0])?, container.table(blocks[1])?);
        let mut corners = indices.as_chunks().0;
        let mut faces = Faces { polygons: Polygons::new(), left_out: 0, blocks };
        let mut face = Vec::new();
        for (k, count) in counts.as_chunks().0.iter().enumerate() {
            let taken = corners.split_at_checked(u32::from_le_bytes(*count) as usize);
            let (taken, rest) = taken.ok_or_else(|| damaged(&format!("face {k} has more corners than are there")))?;
            corners = rest;
            face.clear();
            face.extend(taken.iter().map(|index| u32::from_le_bytes(*index)));
            if !as_stored {
                face.reverse();
            }
            check_face(&face, points, || format!("face {k}"))?;
            if face.len() < 3 {
                faces.left_out += 1;
            } else {
                faces.polygons.push(&face);
            }
        }
        Ok(faces)
    }
}
