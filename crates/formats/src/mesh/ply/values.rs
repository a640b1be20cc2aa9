//! The values of the body, one after another, whatever the encoding.

use super::header::{Element, Scalar};
use crate::error::Fault;
use crate::text::{Lines, no_number, number, quoted};

/// A stream of values; all scalar types of the format fit into `f64` exactly.
pub(super) trait Values {
    fn next(&mut self, scalar: Scalar) -> Result<f64, Failure>;

    /// An upper bound on the number of values left.
    fn remaining(&self) -> usize;

    /// The length of a list, whose items are still to be found in the file.
    fn length(&mut self, scalar: Scalar) -> Result<u64, Failure> {
        let length = self.next(scalar)?;
        if length >= 0.0 && length.fract() == 0.0 { Ok(length as u64) } else { Err(Failure::Length(length)) }
    }
}

/// Why there is no next value.
pub(super) enum Failure {
    End,
    Length(f64),
    Word { line: usize, what: String },
}

impl Failure {
    pub(super) fn inside(self, element: &Element, k: u64) -> Fault {
        // The name comes from the file: any bytes, any number of them.
        let (name, count) = (quoted(element.name.as_bytes()), element.count);
        Fault::damaged(match self {
            Self::End => format!("ends after {k} of {count} items of {name}; copy or export the file again"),
            Self::Length(length) => format!("{name} {k}: a list cannot have {length} items; export the mesh again"),
            Self::Word { line, what } => format!("line {line}: {what}"),
        })
    }
}

pub(super) struct Ascii<'a> {
    lines: Lines<'a>,
    line: &'a [u8],
}

impl<'a> Ascii<'a> {
    pub(super) fn new(lines: Lines<'a>) -> Self {
        Self { lines, line: &[] }
    }
}

impl Values for Ascii<'_> {
    fn next(&mut self, _: Scalar) -> Result<f64, Failure> {
        while self.line.is_empty() {
            self.line = self.lines.next().ok_or(Failure::End)?;
        }
        let end = self.line.iter().position(u8::is_ascii_whitespace).unwrap_or(self.line.len());
        let (word, rest) = self.line.split_at(end);
        self.line = rest.trim_ascii_start();
        number(word).ok_or_else(|| Failure::Word { line: self.lines.number(), what: no_number(word) })
    }

    fn remaining(&self) -> usize {
        // A value takes a digit and a separator, but for the last.
        (self.line.len() + self.lines.rest().len()).div_ceil(2)
    }
}

pub(super) struct Binary<'a, const BIG: bool> {
    rest: &'a [u8],
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    pub(super) fn new(rest: &'a [u8]) -> Self {
        Self { rest }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Failure> {
        let (bytes, rest) = self.rest.split_first_chunk().ok_or(Failure::End)?;
        self.rest = rest;
        let mut bytes = *bytes;
        if BIG {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl<const BIG: bool> Values for Binary<'_, BIG> {
    fn next(&mut self, scalar: Scalar) -> Result<f64, Failure> {
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.take()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.take()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.take()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.take()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.take()?).into(),
            Scalar::F32 => f32::from_le_bytes(self.take()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn remaining(&self) -> usize {
        self.rest.len()
    }
}
