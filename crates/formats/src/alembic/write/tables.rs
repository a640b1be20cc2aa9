//! Headers of properties and objects.

use std::io::{self, Seek, Write};

use super::ogawa::{Digest, Sink, digest};
use crate::alembic::objects::INLINE;
use crate::alembic::properties::Kind;

/// Metadata of properties and objects, each told once as long as the table has room.
#[derive(Default)]
pub(super) struct Metadata(Vec<String>);

impl Metadata {
    /// From 1, where 0 says that there are none; with [`INLINE`] the text that is told behind it.
    fn index<'a>(&mut self, text: &'a str) -> (u8, Option<&'a str>) {
        if text.is_empty() {
            return (0, None);
        }
        let known = self.0.iter().position(|known| known == text).or_else(|| {
            let has_room = self.0.len() < INLINE - 1 && text.len() <= usize::from(u8::MAX);
            has_room.then(|| {
                self.0.push(text.to_owned());
                self.0.len() - 1
            })
        });
        known.map_or((INLINE as u8, Some(text)), |known| (known as u8 + 1, None))
    }

    pub(super) fn table(&self) -> Vec<u8> {
        self.0.iter().flat_map(|text| [&[text.len() as u8], text.as_bytes()].concat()).collect()
    }
}

pub(super) struct Values {
    pub(super) kind: Kind,
    /// The type of the numbers, and how many a value has.
    pub(super) number: u8,
    pub(super) extent: u8,
    /// Index of the times of the samples.
    pub(super) sampling: u32,
}

/// A compound of properties: its children and their headers.
#[derive(Default)]
pub(super) struct Compound {
    children: Vec<u64>,
    headers: Vec<u8>,
    digests: Vec<u8>,
}

impl Compound {
    /// Appends a property with values; arrays have their sizes between.
    pub(super) fn add<W: Write + Seek>(
        &mut self,
        sink: &mut Sink<W>,
        metadata: &mut Metadata,
        (name, told): (&str, &str),
        stored: &[u64],
        values: &Values,
    ) -> io::Result<()> {
        let samples = (stored.len() / if values.kind == Kind::Array { 2 } else { 1 }) as u32;
        let (index, inline) = metadata.index(told);
        let width = width(&[samples as usize, name.len(), inline.map_or(0, str::len)]);
        let bits = values.kind as u32 | width << 2 | u32::from(values.number) << 4 | u32::from(values.extent) << 12;
        let bit = |k: u32, set: bool| u32::from(set) << k;
        // Scalars are of one size throughout, and so are arrays of one topology.
        let states = bit(8, values.sampling != 0) | bit(10, true) | bit(11, samples < 2);
        let start = self.headers.len();
        self.headers.extend((bits | states | u32::from(index) << 20).to_le_bytes());
        self.put(samples, width);
        if values.sampling != 0 {
            self.put(values.sampling, width);
        }
        self.finish((name, inline), width, sink.group(stored)?, start);
        Ok(())
    }

    pub(super) fn add_compound(&mut self, metadata: &mut Metadata, (name, told): (&str, &str), inner: &Written) {
        let start = self.headers.len();
        let (index, inline) = metadata.index(told);
        let width = width(&[name.len(), inline.map_or(0, str::len)]);
        let bits = Kind::Compound as u32 | width << 2 | u32::from(index) << 20;
        self.headers.extend(bits.to_le_bytes());
        self.finish((name, inline), width, inner.group, start);
        self.digests.extend(inner.digest);
    }

    fn put(&mut self, number: u32, width: u32) {
        self.headers.extend_from_slice(&number.to_le_bytes()[..1 << width]);
    }

    fn finish(&mut self, (name, inline): (&str, Option<&str>), width: u32, group: u64, start: usize) {
        for text in [Some(name), inline].into_iter().flatten() {
            self.put(text.len() as u32, width);
            self.headers.extend(text.bytes());
        }
        self.digests.extend(digest(&[&self.headers[start..], &group.to_le_bytes()]));
        self.children.push(group);
    }

    pub(super) fn write<W: Write + Seek>(mut self, sink: &mut Sink<W>) -> io::Result<Written> {
        if !self.headers.is_empty() {
            self.children.push(sink.data(&[&self.headers])?);
        }
        Ok(Written { group: sink.group(&self.children)?, digest: digest(&[&self.digests]) })
    }
}

/// The exponent of the number of bytes that hold each of these.
fn width(numbers: &[usize]) -> u32 {
    let most = numbers.iter().copied().max().unwrap_or(0);
    if most > 0xffff { 2 } else { u32::from(most > 0xff) }
}

/// What was written: where it is, and what tells it apart.
pub(super) struct Written {
    pub(super) group: u64,
    digest: Digest,
}

/// An object below another: its name, what it is, and where.
pub(super) type Child = (String, &'static str, Written);

/// Writes an object with its properties and what lies below it.
pub(super) fn write_object<W: Write + Seek>(
    sink: &mut Sink<W>,
    metadata: &mut Metadata,
    properties: &Written,
    below: &[Child],
) -> io::Result<Written> {
    let (mut children, mut headers, mut digests) = (vec![properties.group], Vec::new(), Vec::new());
    for (name, told, child) in below {
        children.push(child.group);
        let (index, inline) = metadata.index(told);
        headers.extend((name.len() as u32).to_le_bytes());
        headers.extend(name.bytes());
        headers.push(index);
        if let Some(told) = inline {
            headers.extend((told.len() as u32).to_le_bytes());
            headers.extend(told.bytes());
        }
        digests.extend([name.as_bytes(), &child.digest].concat());
    }
    let below = if below.is_empty() { Digest::default() } else { digest(&[&digests]) };
    headers.extend(properties.digest);
    headers.extend(below);
    children.push(sink.data(&[&headers])?);
    let group = sink.group(&children)?;
    Ok(Written { group, digest: digest(&[&properties.digest, &below]) })
}
