//! Properties of an object: what their headers say, and where their samples lie.

use std::sync::Arc;

use super::objects::{Archive, INLINE};
use super::ogawa::{Container, DATA};
use crate::error::Fault;
use crate::scene::{Fields, Track, Value, check_held, damaged};

/// Types of numbers, as headers tell them.
pub(super) const BOOL: u8 = 0;
pub(super) const U8: u8 = 1;
pub(super) const I8: u8 = 2;
pub(super) const U32: u8 = 5;
pub(super) const I32: u8 = 6;
pub(super) const F32: u8 = 10;
pub(super) const F64: u8 = 11;
pub(super) const TEXT: u8 = 12;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Other properties.
    Compound = 0,
    /// One value, of one or several numbers.
    Scalar = 1,
    /// Any number of values.
    Array = 2,
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: Vec<u8>,
    pub(super) kind: Kind,
    pub(super) metadata: Arc<[u8]>,
    pub(super) number: u8,
    /// Numbers of a value.
    pub(super) extent: u8,
    pub(super) samples: usize,
    /// The first sample that differs from the one before, and the last; 0 and 0 where none does.
    first: usize,
    last: usize,
    /// Index of the times of its samples.
    pub(super) sampling: usize,
    pub(super) group: u64,
}

impl Property {
    pub(super) fn is_constant(&self) -> bool {
        self.samples < 2 || (self.first, self.last) == (0, 0)
    }

    /// Where a sample is stored: repetitions at the beginning and the end are not.
    fn place(&self, sample: usize) -> usize {
        if sample < self.first { 0 } else { (sample.min(self.last) + 1).saturating_sub(self.first) }
    }

    /// The bytes of the first sample, `most` at the most.
    pub(super) fn small(&self, container: &mut Container<'_>, most: u64) -> Result<Vec<u8>, Fault> {
        let first = self.first(container)?;
        container.small(first, most, &String::from_utf8_lossy(&self.name))
    }

    pub(super) fn first(&self, container: &mut Container<'_>) -> Result<Value, Fault> {
        let children = container.children(self.group)?;
        children.first().map(|&data| Value(data)).ok_or_else(|| damaged("a sample is missing"))
    }
}

/// The property of a name, if it is of this kind.
pub(super) fn find<'a>(properties: &'a [Property], name: &str, kind: Kind) -> Option<&'a Property> {
    properties.iter().find(|property| property.name == name.as_bytes() && property.kind == kind)
}

impl Archive<'_> {
    /// Where the samples of a property are, and when.
    pub(super) fn track(&mut self, property: &Property) -> Result<Track, Fault> {
        let &Property { samples, kind, .. } = property;
        if property.is_constant() {
            return Ok(Track { default: Some(property.first(&mut self.container)?), ..Track::default() });
        }
        // Arrays have their sizes between.
        let step = if kind == Kind::Array { 2 } else { 1 };
        let children = self.container.children(property.group)?;
        check_held(samples, samples / 2 <= children.len() / step)?;
        let times = self.samplings[property.sampling].times(samples)?;
        let value = |sample| {
            let data = children.get(property.place(sample) * step);
            data.map(|&data| Value(data)).ok_or_else(|| damaged("a sample is missing"))
        };
        Ok(Track { default: None, times, values: (0..samples).map(value).collect::<Result<_, _>>()? })
    }

    pub(super) fn top_properties(&mut self, object: usize) -> Result<Vec<Property>, Fault> {
        let children = self.container.children(self.objects[object].group)?;
        match children.first() {
            Some(&group) if group & DATA == 0 => self.properties(group),
            _ => Ok(Vec::new()),
        }
    }

    /// The properties in an object's compound `.geom` or `.xform`; none where it has no such.
    pub(super) fn schema(&mut self, object: usize, name: &str) -> Result<Vec<Property>, Fault> {
        let all = self.top_properties(object)?;
        self.within(&all, name)
    }

    /// The properties in a compound among these; none where there is no such.
    pub(super) fn within(&mut self, all: &[Property], name: &str) -> Result<Vec<Property>, Fault> {
        find(all, name, Kind::Compound).map_or(Ok(Vec::new()), |compound| self.properties(compound.group))
    }

    pub(super) fn properties(&mut self, group: u64) -> Result<Vec<Property>, Fault> {
        let children = self.container.children(group)?;
        let Some((&headers, groups)) = children.split_last() else { return Ok(Vec::new()) };
        let headers = self.container.contents(headers)?;
        let mut fields = Fields(&headers);
        groups.iter().map(|&group| self.property(&mut fields, group)).collect()
    }

    /// The next header. Its first bits: 0–1 the kind, 2–3 the width of its numbers, 4–7 the type of
    /// values, 8 whether times are told, 9 whether the first and the last change are, 11 whether
    /// there is none, 12–19 the extent, 20–27 the metadata.
    fn property(&self, fields: &mut Fields<'_>, group: u64) -> Result<Property, Fault> {
        let bits = fields.short(2)?;
        if bits >> 2 & 3 == 3 {
            return Err(damaged("a table has numbers of eight bytes"));
        }
        let (width, bit) = ((bits >> 2 & 3) as u32, |k: u32| bits >> k & 1 == 1);
        let kind = match bits & 3 {
            0 => Kind::Compound,
            1 => Kind::Scalar,
            _ => Kind::Array,
        };
        let (mut samples, mut first, mut last, mut sampling) = (0, 0, 0, 0);
        if kind != Kind::Compound {
            samples = fields.short(width)?;
            if bit(9) {
                (first, last) = (fields.short(width)?, fields.short(width)?);
            } else if !bit(11) {
                (first, last) = (1, samples.saturating_sub(1));
            }
            if bit(8) {
                sampling = fields.short(width)?;
            }
            if sampling >= self.samplings.len() {
                return Err(damaged("a property has times that are not there"));
            }
        }
        let name = fields.sized(width)?.to_vec();
        let metadata = match bits >> 20 & 0xff {
            INLINE => Arc::from(fields.sized(width)?),
            index => self.metadata.get(index).cloned().unwrap_or_default(),
        };
        let (number, extent) = ((bits >> 4 & 15) as u8, (bits >> 12 & 0xff) as u8);
        Ok(Property { name, kind, metadata, number, extent, samples, first, last, sampling, group })
    }
}
