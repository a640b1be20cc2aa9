//! Headers of properties and objects.

use std::io::{self, Seek, Write};

use super::ogawa::{Digest, Sink, digest};
use crate::alembic::properties::Kind;

/// Metadata of properties and objects, each told once.
#[derive(Default)]
pub(super) struct Metadata(Vec<&'static str>);

impl Metadata {
    /// From 1; 0 says that there are none.
    fn index(&mut self, text: &'static str) -> u8 {
        if text.is_empty() {
            return 0;
        }
        let known = self.0.iter().position(|known| *known == text);
        let index = known.unwrap_or_else(|| {
            self.0.push(text);
            self.0.len() - 1
        });
        // An archive of one mesh has a handful.
        index as u8 + 1
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
        (name, told): (&str, &'static str),
        stored: &[u64],
        values: &Values,
    ) -> io::Result<()> {
        let samples = (stored.len() / if values.kind == Kind::Array { 2 } else { 1 }) as u32;
        let width = if samples > 0xffff { 2 } else { u32::from(samples > 0xff) };
        let bits = values.kind as u32 | width << 2 | u32::from(values.number) << 4 | u32::from(values.extent) << 12;
        let bit = |k: u32, set: bool| u32::from(set) << k;
        // Scalars are of one size throughout, and so are arrays of one topology.
        let states = bit(8, values.sampling != 0) | bit(10, true) | bit(11, samples < 2);
        let start = self.headers.len();
        self.headers.extend((bits | states | u32::from(metadata.index(told)) << 20).to_le_bytes());
        let mut put = |number: u32| self.headers.extend_from_slice(&number.to_le_bytes()[..1 << width]);
        put(samples);
        if values.sampling != 0 {
            put(values.sampling);
        }
        put(name.len() as u32);
        self.finish(name, sink.group(stored)?, start);
        Ok(())
    }

    pub(super) fn add_compound(
        &mut self,
        metadata: &mut Metadata,
        (name, told): (&str, &'static str),
        inner: &Written,
    ) {
        let start = self.headers.len();
        let bits = Kind::Compound as u32 | u32::from(metadata.index(told)) << 20;
        self.headers.extend(bits.to_le_bytes());
        self.headers.push(name.len() as u8);
        self.finish(name, inner.group, start);
        self.digests.extend(inner.digest);
    }

    fn finish(&mut self, name: &str, group: u64, start: usize) {
        self.headers.extend(name.bytes());
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

/// What was written: where it is, and what tells it apart.
pub(super) struct Written {
    pub(super) group: u64,
    digest: Digest,
}

pub(super) type Title<'a> = (&'a str, &'static str);

/// Writes an object with its properties and at most one child.
pub(super) fn write_object<W: Write + Seek>(
    sink: &mut Sink<W>,
    metadata: &mut Metadata,
    properties: &Written,
    child: Option<(Title<'_>, &Written)>,
) -> io::Result<Written> {
    let (mut children, mut headers) = (vec![properties.group], Vec::new());
    let mut below = Digest::default();
    if let Some(((name, told), child)) = child {
        children.push(child.group);
        headers.extend((name.len() as u32).to_le_bytes());
        headers.extend(name.bytes());
        headers.push(metadata.index(told));
        below = digest(&[name.as_bytes(), &child.digest]);
    }
    headers.extend(properties.digest);
    headers.extend(below);
    children.push(sink.data(&[&headers])?);
    let group = sink.group(&children)?;
    Ok(Written { group, digest: digest(&[&properties.digest, &below]) })
}
