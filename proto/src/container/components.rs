//! The section `COMP`: which component of the cage carries which points of the model.

use super::reader::ContainerReader;
use super::writer::ContainerWriter;
use super::{Error, tag};
use crate::le::value_at;
use cager_core::cage::{Cage, Carrier};
use cager_core::coordinates::{CoordinateSystem as _, MeanValue};
use std::io::{Read, Seek, Write};

/// A number of points, the first vertex of the component that carries them, its number of vertices.
const CARRIER_BYTES: usize = 12;

impl<W: Write> ContainerWriter<W> {
    pub(super) fn write_carriers(&mut self, carriers: &[Carrier]) -> Result<(), Error> {
        if carriers.is_empty() {
            return Ok(());
        }
        let numbers = |Carrier { points, vertices }: &Carrier| {
            [points.end - points.start, vertices.start, vertices.end - vertices.start]
        };
        let raw: Vec<u8> = carriers.iter().flat_map(numbers).flat_map(u32::to_le_bytes).collect();
        self.section(tag::COMPONENTS, &raw)
    }
}

impl<R: Read + Seek> ContainerReader<R> {
    /// Which component of the cage carries which points, in their order; empty where the whole cage
    /// carries all of them.
    pub fn carriers(&mut self) -> Result<Vec<Carrier>, Error> {
        let Some((offset, raw)) = self.optional(tag::COMPONENTS)? else { return Ok(Vec::new()) };
        let corrupt = |what: String| Error::corrupt(offset, what);
        if self.header.coordinates != MeanValue.name() {
            return Err(corrupt(format!("coordinates {} of a cage by component", self.header.coordinates)));
        }
        let (rows, rest) = raw.as_chunks::<CARRIER_BYTES>();
        if rows.is_empty() || !rest.is_empty() {
            return Err(corrupt("the components of the cage are cut".to_owned()));
        }
        let mut carriers = Vec::with_capacity(rows.len());
        let mut next = 0_u32;
        for row in rows {
            let [points, first, vertices] = [0, 4, 8].map(|at| value_at(row, at, u32::from_le_bytes));
            let (Some(end), Some(last)) = (next.checked_add(points), first.checked_add(vertices)) else {
                return Err(corrupt("a component of the cage has impossible counts".to_owned()));
            };
            carriers.push(Carrier { points: next..end, vertices: first..last });
            next = end;
        }
        if u64::from(next) != self.header.points {
            return Err(corrupt(format!("the components of the cage carry {next} points")));
        }
        Ok(carriers)
    }

    /// The cage with its components, checked as a cage.
    pub fn checked_cage(&mut self) -> Result<Cage, Error> {
        let carriers = self.carriers()?;
        let cage = Cage::new(self.cage()?).and_then(|cage| cage.with_carriers(carriers));
        let offset = self.entry(tag::CAGE_FACES)?.offset;
        cage.map_err(|error| Error::corrupt(offset, error.to_string()))
    }
}
