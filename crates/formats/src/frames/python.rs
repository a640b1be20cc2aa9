//! As much of Python's syntax as the headers of `.npy` files need.

use crate::text::integer;

/// The header of an array as it stands.
pub(super) struct Header<'a> {
    pub(super) kind: Kind<'a>,
    pub(super) fortran: bool,
    pub(super) shape: Vec<u64>,
}

/// The type of an array's values.
pub(super) enum Kind<'a> {
    /// Such as `<f4`.
    Plain(&'a [u8]),
    /// Records, with the names of their fields.
    Records(Vec<&'a [u8]>),
}

/// The dictionary that a `.npy` file begins with.
pub(super) fn header(text: &[u8]) -> Option<Header<'_>> {
    Parser { rest: text }.header()
}

struct Parser<'a> {
    rest: &'a [u8],
}

impl<'a> Parser<'a> {
    fn header(mut self) -> Option<Header<'a>> {
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
        self.peek().is_none().then_some(Header { kind: kind?, fortran: fortran?, shape: shape? })
    }

    /// A type such as `'<f4'`, or a list of fields, `[('x', '<f4'), …]`.
    fn kind(&mut self) -> Option<Kind<'a>> {
        if self.peek()? != b'[' {
            return self.string().map(Kind::Plain);
        }
        let (mut depth, mut fields, mut before) = (0_usize, Vec::new(), 0);
        loop {
            let symbol = self.peek()?;
            if symbol == b'\'' || symbol == b'"' {
                let text = self.string()?;
                if before == b'(' && depth == 1 {
                    fields.push(text);
                }
            } else {
                self.rest = &self.rest[1..];
                match symbol {
                    b'[' => depth += 1,
                    b']' => depth = depth.checked_sub(1)?,
                    _ => {}
                }
                if depth == 0 {
                    return Some(Kind::Records(fields));
                }
            }
            before = symbol;
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
