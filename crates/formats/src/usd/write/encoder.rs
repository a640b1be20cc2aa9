//! Values of a layer, and the prims and properties that have them.

use std::io::{self, Seek, Write};
use std::sync::Arc;

use super::property::{Prim, Property, Said};
use super::sink::Sink;
use super::tables::{Field, Tables, integers};
use crate::usd::binary::{ATTRIBUTE, MAGIC, PRIM, RELATIONSHIP, kind};

const VERSION: [u8; 3] = [0, 8, 0];
/// Bits of a value: an array, one that is in place of its offset, one that is packed.
const ARRAY: u64 = 1 << 63;
const INLINED: u64 = 1 << 62;
const PACKED: u64 = 1 << 61;
/// Shorter arrays of whole numbers are not packed, nor longer ones, which LZ4 has in pieces.
const PACKED_FROM: usize = 16;
const PACKED_TO: usize = 1 << 28;
/// Prepended items of a list.
const PREPENDED: u8 = 1 << 5;

/// A layer that is being written.
pub(super) struct Encoder<W> {
    pub(super) sink: Sink<W>,
    pub(super) tables: Tables,
    bytes: Vec<u8>,
}

impl<W: Write + Seek> Encoder<W> {
    pub(super) fn new(sink: Sink<W>) -> Self {
        let mut tables = Tables::default();
        // A first name that no property has, as its negative would be no other number.
        tables.token(";-)");
        Self { sink, tables, bytes: Vec::new() }
    }

    /// Writes the tables, what a layer begins with, and the other files of its package; gives the
    /// file back.
    pub(super) fn close(mut self, files: &[(String, Arc<[u8]>)]) -> io::Result<W> {
        let contents = self.tables.write(&mut self.sink)?;
        let head = [&MAGIC[..], &VERSION, &[0; 5], &contents.to_le_bytes()].concat();
        self.sink.close(&head, files)
    }

    /// Writes a prim and what lies below it.
    pub(super) fn prim(&mut self, prim: &Prim) -> io::Result<()> {
        let properties: Vec<&str> = prim.properties.iter().map(|property| property.name.as_str()).collect();
        let children: Vec<&str> = prim.children.iter().map(|child| child.name.as_str()).collect();
        self.begin(&prim.name, (prim.type_name, prim.is_bound), &properties, &children)?;
        for property in prim.properties.iter().filter(|property| !property.is_relationship()) {
            self.tables.token(&property.type_name);
        }
        prim.properties.iter().for_each(|property| self.property(property));
        prim.children.iter().try_for_each(|child| self.prim(child))?;
        self.tables.end();
        Ok(())
    }

    /// In place of a value that a layer below says.
    pub(super) const BLOCK: u64 = INLINED | (kind::BLOCKED as u64) << 48;

    /// Begins a prim that says something of one in a layer below, and writes its properties; the
    /// prims below it follow, then the end.
    pub(super) fn over(&mut self, name: &str, properties: &[Property], children: &[&str]) -> io::Result<()> {
        let names: Vec<&str> = properties.iter().map(|property| property.name.as_str()).collect();
        let fields = self.listed(1, &names, children)?;
        self.tables.begin(PRIM, name, &fields);
        properties.iter().for_each(|property| self.property(property));
        Ok(())
    }

    /// Begins a prim of a type, with a material or not; its properties follow, then the prims below
    /// it, then the end.
    pub(super) fn begin(
        &mut self,
        name: &str,
        (type_name, is_bound): (&str, bool),
        properties: &[&str],
        children: &[&str],
    ) -> io::Result<()> {
        let mut fields = self.listed(0, properties, children)?;
        if is_bound {
            let schema = self.tables.token("MaterialBindingAPI");
            let list = [&[PREPENDED][..], &1_u64.to_le_bytes(), &schema.to_le_bytes()].concat();
            fields.push(("apiSchemas", value(kind::TOKEN_LIST, self.sink.put(&list)?)));
        }
        fields.insert(1, ("typeName", self.token(type_name)));
        self.tables.begin(PRIM, name, &fields);
        Ok(())
    }

    /// How a prim is specified, and the names of what it has.
    fn listed(&mut self, specifier: u64, properties: &[&str], children: &[&str]) -> io::Result<Vec<Field<'static>>> {
        let mut fields = vec![("specifier", INLINED | value(kind::SPECIFIER, specifier))];
        for (field, names) in [("properties", properties), ("primChildren", children)] {
            if !names.is_empty() {
                fields.push((field, self.tokens(names)?));
            }
        }
        Ok(fields)
    }

    pub(super) fn property(&mut self, property: &Property) {
        let (kind, field) = match property.is_relationship() {
            false => (ATTRIBUTE, "connectionPaths"),
            true => (RELATIONSHIP, "targetPaths"),
        };
        let mut fields = Vec::new();
        if kind == ATTRIBUTE {
            fields.push(("typeName", self.token(&property.type_name)));
        }
        if property.is_uniform {
            fields.push(("variability", INLINED | value(kind::VARIABILITY, 1)));
        }
        for (field, said) in &property.fields {
            let value = match said {
                Said::Value(value) => *value,
                Said::Token(token) => self.token(token),
            };
            fields.push((field, value));
        }
        self.tables.property(kind, &property.name, &fields, property.target.clone().map(|path| (field, path)));
    }

    pub(super) fn token(&mut self, text: &str) -> u64 {
        INLINED | value(kind::TOKEN, self.tables.token(text).into())
    }

    pub(super) fn string(&mut self, text: &str) -> u64 {
        INLINED | value(kind::STRING, self.tables.string(text).into())
    }

    /// The path of a file.
    pub(super) fn asset(&mut self, path: &str) -> u64 {
        INLINED | value(kind::ASSET, self.tables.token(path).into())
    }

    pub(super) fn float(&mut self, number: f32) -> u64 {
        INLINED | value(kind::FLOAT, number.to_bits().into())
    }

    pub(super) fn double(&mut self, number: f64) -> io::Result<u64> {
        if f64::from(number as f32) == number {
            return Ok(INLINED | value(kind::DOUBLE, (number as f32).to_bits().into()));
        }
        self.put(kind::DOUBLE, &number.to_le_bytes())
    }

    /// A value that is not in place of its offset.
    pub(super) fn put(&mut self, kind: u8, bytes: &[u8]) -> io::Result<u64> {
        self.sink.align()?;
        Ok(value(kind, self.sink.put(bytes)?))
    }

    /// Some elements behind how many they are.
    fn list(&mut self, kind: u8, count: usize, bytes: &[u8]) -> io::Result<u64> {
        let list = self.put(kind, &(count as u64).to_le_bytes())?;
        self.sink.put(bytes)?;
        Ok(list)
    }

    /// An array of elements of some numbers each.
    pub(super) fn floats<const N: usize>(&mut self, numbers: &[[f32; N]]) -> io::Result<u64> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        bytes.extend(numbers.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        let array = self.list([kind::FLOAT, kind::VEC2F, kind::VEC3F, kind::VEC4F][N - 1], numbers.len(), &bytes);
        self.bytes = bytes;
        Ok(ARRAY | array?)
    }

    pub(super) fn integers(&mut self, numbers: &[i32]) -> io::Result<u64> {
        if !(PACKED_FROM..=PACKED_TO).contains(&numbers.len()) {
            let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            return Ok(ARRAY | self.list(kind::INT, numbers.len(), &bytes)?);
        }
        let bytes = integers(numbers);
        let sized = [&(bytes.len() as u64).to_le_bytes()[..], &bytes].concat();
        Ok(ARRAY | PACKED | self.list(kind::INT, numbers.len(), &sized)?)
    }

    /// Names that a field lists.
    pub(super) fn tokens(&mut self, names: &[&str]) -> io::Result<u64> {
        let bytes: Vec<u8> = names.iter().flat_map(|name| self.tables.token(name).to_le_bytes()).collect();
        self.list(kind::TOKENS, names.len(), &bytes)
    }

    /// Texts that a field lists.
    pub(super) fn strings(&mut self, texts: &[&str]) -> io::Result<u64> {
        let bytes: Vec<u8> = texts.iter().flat_map(|text| self.tables.string(text).to_le_bytes()).collect();
        self.list(kind::STRINGS, texts.len(), &bytes)
    }

    /// The rate and the range of frames at these time codes.
    pub(super) fn timing(&mut self, fps: f64, codes: &[f64]) -> io::Result<[Field<'static>; 4]> {
        let rate = self.double(fps)?;
        let [start, end] = [codes.first(), codes.last()].map(|code| code.copied().unwrap_or_default());
        Ok([
            ("endTimeCode", self.double(end)?),
            ("framesPerSecond", rate),
            ("startTimeCode", self.double(start)?),
            ("timeCodesPerSecond", rate),
        ])
    }

    /// That the times of one layer below are as they are.
    pub(super) fn layer_offset(&mut self) -> io::Result<u64> {
        self.list(kind::OFFSETS, 1, [0.0_f64, 1.0].map(f64::to_le_bytes).as_flattened())
    }

    pub(super) fn vector(&mut self, numbers: [f64; 3]) -> io::Result<u64> {
        self.put(kind::VEC3D, numbers.map(f64::to_le_bytes).as_flattened())
    }

    /// An array of names.
    pub(super) fn token_array(&mut self, names: &[&str]) -> io::Result<u64> {
        let bytes: Vec<u8> = names.iter().flat_map(|name| self.tables.token(name).to_le_bytes()).collect();
        Ok(ARRAY | self.list(kind::TOKEN, names.len(), &bytes)?)
    }

    /// Times that samples have.
    pub(super) fn times(&mut self, codes: &[f64]) -> io::Result<u64> {
        let bytes: Vec<u8> = codes.iter().flat_map(|code| code.to_le_bytes()).collect();
        self.list(kind::DOUBLES, codes.len(), &bytes)
    }

    /// Values at times: where the value of these is, counted from there, and where the others are.
    pub(super) fn samples(&mut self, times: u64, values: &[u64]) -> io::Result<u64> {
        let samples = self.put(kind::TIME_SAMPLES, &8_u64.to_le_bytes())?;
        let head = [times, 8, values.len() as u64];
        let bytes: Vec<u8> = head.iter().chain(values).flat_map(|number| number.to_le_bytes()).collect();
        self.sink.put(&bytes)?;
        Ok(samples)
    }
}

fn value(kind: u8, payload: u64) -> u64 {
    u64::from(kind) << 48 | payload
}
