//! What a polygon mesh holds: its positions, and its faces, which wind clockwise.

use std::io::{Read, Seek};

use super::objects::Archive;
use super::ogawa::{Block, Container, damaged};
use super::properties::{F32, F64, I32, Kind, Property, U32, find};
use crate::error::Fault;
use crate::frames::Scalar;
use crate::scene::{Faces, Failure, most_corners};

pub(super) struct Mesh {
    pub(super) positions: Property,
    /// Corners of all faces, back to back.
    pub(super) indices: Property,
    /// Numbers of corners.
    pub(super) counts: Property,
    /// How positions are stored.
    pub(super) scalar: Scalar,
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

    /// The faces at samples of their corners and of the numbers of them, as they are stored or turned around, and where they are stored.
    pub(super) fn faces<R: Read + Seek>(
        &self,
        container: &mut Container<R>,
        [indices, counts]: [usize; 2],
        points: usize,
        as_stored: bool,
    ) -> Result<(Faces, [Block; 2]), Failure> {
        let blocks = [self.indices.sample(container, indices)?, self.counts.sample(container, counts)?];
        if blocks.iter().any(|block| block.length / 4 > most_corners(points)) {
            return Err(damaged(&format!("it has more faces than {points} points can have")).into());
        }
        let tables = [container.table(blocks[0])?, container.table(blocks[1])?];
        let [corners, counts] =
            tables.each_ref().map(|table| table.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)));
        Ok((Faces::of(counts, corners, points, !as_stored)?, blocks))
    }
}
