//! Lines, words and numbers of text formats, from bytes that need not be UTF-8.

use crate::error::Fault;

/// The lines of a text with their numbers, from 1.
#[derive(Clone)]
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    separator: u8,
    number: usize,
    /// Whether the last line that was returned has an end.
    ended: bool,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        // Files from before 2001 may end their lines with a carriage return alone.
        let first = bytes.iter().position(|&b| b == b'\n' || b == b'\r');
        let separator = match first.map(|i| (bytes[i], bytes.get(i + 1))) {
            Some((b'\r', next)) if next != Some(&b'\n') => b'\r',
            _ => b'\n',
        };
        Self { rest: bytes, separator, number: 0, ended: true }
    }

    /// What follows the last line that was returned.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Whether the last line that was returned is the file's last, without an end: such a file may
    /// have been cut.
    pub(crate) fn is_cut(&self) -> bool {
        self.rest.is_empty() && !self.ended
    }

    /// Number of the last line that was returned.
    pub(crate) fn number(&self) -> usize {
        self.number
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|&b| b == self.separator);
        let line = &self.rest[..end.unwrap_or(self.rest.len())];
        self.rest = end.map_or(&[], |end| &self.rest[end + 1..]);
        self.number += 1;
        self.ended = end.is_some();
        Some(line.trim_ascii())
    }
}

/// The words of a line.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// A decimal number, as exactly as `f64` can hold it.
pub(crate) fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// An integer in decimal digits.
pub(crate) fn integer<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The next three words as a finite point; `place` says where in the file, for messages.
pub(crate) fn point<'a>(
    words: &mut impl Iterator<Item = &'a [u8]>,
    place: impl Fn() -> String,
) -> Result<[f64; 3], Fault> {
    let mut point = [0.0; 3];
    for (k, coordinate) in point.iter_mut().enumerate() {
        let Some(word) = words.next() else {
            return Err(Fault::damaged(format!(
                "{}: the vertex has {k} coordinates instead of 3; export the mesh again",
                place()
            )));
        };
        let Some(value) = number(word) else {
            return Err(Fault::damaged(format!("{}: {}", place(), no_number(word))));
        };
        if !value.is_finite() {
            return Err(Fault::invalid(format!(
                "{}: the vertex has a coordinate that is NaN or infinite; repair or remove it",
                place()
            )));
        }
        *coordinate = value;
    }
    Ok(point)
}

/// What is wrong with a line.
pub(crate) fn damaged(line: usize, what: &str) -> Fault {
    Fault::damaged(format!("line {line}: {what}"))
}

/// Why a word is no number, and what to do.
pub(crate) fn no_number(word: &[u8]) -> String {
    let with_point: Vec<u8> = word.iter().map(|&b| if b == b',' { b'.' } else { b }).collect();
    let shown = quoted(word);
    if word.contains(&b',') && number(&with_point).is_some() {
        return format!("{shown} has a decimal comma; export it with decimal points (the English number format)");
    }
    format!("{shown} is not a number; export the mesh again")
}

/// A word from a file, fit to be shown in a message.
pub(crate) fn quoted(word: &[u8]) -> String {
    const SHOWN: usize = 32;
    let shown = String::from_utf8_lossy(&word[..word.len().min(SHOWN)]);
    let more = if word.len() > SHOWN { "…" } else { "" };
    format!("{:?}{more}", &*shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_with_any_of_the_three_conventions() {
        for text in ["a b\nc\n", "a b\r\nc", "a b\rc\r", "\u{feff}a b\nc"] {
            let lines: Vec<_> = Lines::new(text.as_bytes()).collect();
            assert_eq!(lines, [b"a b".as_slice(), b"c"], "{text:?}");
        }
    }
}
