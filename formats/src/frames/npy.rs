//! NumPy arrays: a header that is a Python dictionary, then the array.

use super::cache::{LONGEST_HEADER, Layout, Order};
use super::widen::Scalar;
use crate::error::Fault;
use crate::text::{integer, quoted};

const MAGIC: &[u8; 6] = b"\x93NUMPY";

pub(super) fn layout(head: &[u8], expected_points: u64) -> Result<Layout, Fault> {
    let Some(rest) = head.strip_prefix(MAGIC) else {
        return Err(Fault::damaged("does not begin as a .npy file does; save the array again with numpy.save"));
    };
    let (start, length) = match *rest {
        [1, _, a, b, ..] => (10, u16::from_le_bytes([a, b]).into()),
        [2 | 3, _, a, b, c, d, ..] => (12, u32::from_le_bytes([a, b, c, d]) as usize),
        [1..=3, ..] | [] => return Err(truncated()),
        [version, ..] => {
            return Err(Fault::unsupported(format!(
                "is of .npy version {version}; save the array again with numpy.save"
            )));
        }
    };
    if length > LONGEST_HEADER - start {
        return Err(Fault::damaged(format!(
            "has a header of {length} bytes, longer than an array of floats has; save the array again with numpy.save"
        )));
    }
    let text = head.get(start..start + length).ok_or_else(truncated)?;
    let array = Parser { rest: text }.array().ok_or_else(|| {
        Fault::damaged(format!(
            "has the header {}, which is not understood; save the array again with numpy.save",
            quoted(text)
        ))
    })?;
    array.layout((start + length) as u64, expected_points)
}

fn truncated() -> Fault {
    Fault::damaged("ends within its header; copy or save the file again")
}

/// The header as it stands.
struct Array<'a> {
    /// None for the list that describes a record.
    kind: Option<&'a [u8]>,
    fortran: bool,
    shape: Vec<u64>,
}

impl Array<'_> {
    fn layout(self, start: u64, expected_points: u64) -> Result<Layout, Fault> {
        let scalar = match self.kind {
            Some(b"<f4") => Scalar::F32Little,
            Some(b">f4") => Scalar::F32Big,
            Some(b"<f8") => Scalar::F64Little,
            Some(b">f8") => Scalar::F64Big,
            kind => {
                let kind = kind.map_or("records".into(), |kind| format!("values of type {}", quoted(kind)));
                return Err(Fault::unsupported(format!(
                    "has {kind}, not 32- or 64-bit floats; convert it with numpy.save(path, numpy.load(path).astype('<f4'))"
                )));
            }
        };
        let (frames, points, order) = match *self.shape {
            [frames, points, 3] => (frames, points, Order::Points),
            [points, 3] => (1, points, Order::Points),
            [frames, points, 4] if points == expected_points => (frames, points, Order::Homogeneous),
            [frames, 3, points] => (frames, points, Order::Axes),
            [3, points] => (1, points, Order::Axes),
            [frames, points, 4] => (frames, points, Order::Homogeneous),
            _ => {
                return Err(Fault::unsupported(format!(
                    "has the shape {:?}, not (frames, points, 3); bring its axes into this order with numpy.transpose, or with reshape where each row has the coordinates x y z x y z of one frame",
                    self.shape
                )));
            }
        };
        let mut layout = Layout::new(points, frames, start, scalar);
        layout.order = order;
        layout.fortran = self.fortran.then_some(self.shape);
        Ok(layout)
    }
}

/// A header as `numpy.save` writes it.
pub(super) fn header(points: usize, frames: usize) -> Vec<u8> {
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({frames}, {points}, 3), }}");
    // The array begins at a multiple of 64 bytes.
    let length = (MAGIC.len() + 4 + text.len() + 1).next_multiple_of(64) - MAGIC.len() - 4;
    text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
    text.push('\n');
    let mut header = MAGIC.to_vec();
    header.extend([1, 0]);
    header.extend((length as u16).to_le_bytes());
    header.extend(text.bytes());
    header
}

/// As much of Python's syntax as headers need.
struct Parser<'a> {
    rest: &'a [u8],
}

impl<'a> Parser<'a> {
    fn array(mut self) -> Option<Array<'a>> {
        let (mut kind, mut fortran, mut shape) = (None, None, None);
        self.symbol(b'{')?;
        while self.symbol(b'}').is_none() {
            let key = self.string()?;
            self.symbol(b':')?;
            match key {
                b"descr" => kind = Some(self.kind()?),
                b"fortran_order" => fortran = Some(self.boolean()?),
                b"shape" => shape = Some(self.tuple()?),
                _ => return None,
            }
            if self.symbol(b',').is_none() && self.peek() != Some(b'}') {
                return None;
            }
        }
        self.peek().is_none().then_some(Array { kind: kind?, fortran: fortran?, shape: shape? })
    }

    /// A type such as `'<f4'`; none inside for a list, which is skipped.
    fn kind(&mut self) -> Option<Option<&'a [u8]>> {
        if self.peek()? != b'[' {
            return self.string().map(Some);
        }
        let mut depth = 0_usize;
        loop {
            match self.peek()? {
                b'\'' | b'"' => drop(self.string()?),
                symbol => {
                    self.rest = &self.rest[1..];
                    match symbol {
                        b'[' => depth += 1,
                        b']' => depth = depth.checked_sub(1)?,
                        _ => {}
                    }
                    if depth == 0 {
                        return Some(None);
                    }
                }
            }
        }
    }

    fn string(&mut self) -> Option<&'a [u8]> {
        let quote = self.peek().filter(|quote| b"'\"".contains(quote))?;
        let text = &self.rest[1..];
        let end = text.iter().position(|&b| b == quote)?;
        self.rest = &text[end + 1..];
        Some(&text[..end])
    }

    fn boolean(&mut self) -> Option<bool> {
        self.peek()?;
        for (word, value) in [(b"True".as_slice(), true), (b"False", false)] {
            if let Some(rest) = self.rest.strip_prefix(word) {
                self.rest = rest;
                return Some(value);
            }
        }
        None
    }

    fn tuple(&mut self) -> Option<Vec<u64>> {
        let mut numbers = Vec::new();
        self.symbol(b'(')?;
        while self.symbol(b')').is_none() {
            numbers.push(self.number()?);
            if self.symbol(b',').is_none() && self.peek() != Some(b')') {
                return None;
            }
        }
        Some(numbers)
    }

    fn number(&mut self) -> Option<u64> {
        self.peek()?;
        let end = self.rest.iter().position(|b| !b.is_ascii_digit())?;
        let (digits, rest) = self.rest.split_at(end);
        // Python 2 wrote `3L`.
        self.rest = rest.strip_prefix(b"L").unwrap_or(rest);
        integer(digits)
    }

    fn symbol(&mut self, wanted: u8) -> Option<()> {
        (self.peek()? == wanted).then(|| self.rest = &self.rest[1..])
    }

    /// The next byte that is not white space.
    fn peek(&mut self) -> Option<u8> {
        self.rest = self.rest.trim_ascii_start();
        self.rest.first().copied()
    }
}
