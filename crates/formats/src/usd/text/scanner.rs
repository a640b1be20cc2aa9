//! Text byte by byte: words, strings, what is between, and whole values that are passed over.

use std::io::{self, BufRead, BufReader, Seek};

use crate::error::Fault;
use crate::scene::{Reader, damaged};

const BLOCK: usize = 1 << 16;
/// Bytes of a word or of a string that is kept; programs write far fewer.
const LONGEST: usize = 1 << 12;
/// Brackets within brackets of one value.
const DEEPEST: usize = 64;

#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    offset: u64,
    line: u64,
}

pub(super) struct Scanner<'a> {
    source: BufReader<Reader<'a>>,
    /// The place of the next byte.
    pub(super) at: u64,
    line: u64,
    word: Vec<u8>,
}

pub(super) struct Passed {
    pub(super) place: Place,
    /// How many values it has in its outermost brackets.
    pub(super) count: usize,
    /// Whether it is `None`, which blocks an attribute.
    pub(super) is_none: bool,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(mut source: Reader<'a>) -> io::Result<Self> {
        source.rewind()?;
        let source = BufReader::with_capacity(BLOCK, source);
        Ok(Self { source, at: 0, line: 1, word: Vec::new() })
    }

    pub(super) fn place(&self) -> Place {
        Place { offset: self.at, line: self.line }
    }

    pub(super) fn go(&mut self, Place { offset, line }: Place) -> io::Result<()> {
        let distance = offset.wrapping_sub(self.at) as i64;
        (self.at, self.line) = (offset, line);
        self.source.seek_relative(distance)
    }

    /// The fault of what no text of USD has, with the line.
    pub(super) fn wrong(&self, what: &str) -> Fault {
        damaged(&format!("line {}: {what}", self.line))
    }

    fn peek(&mut self) -> io::Result<Option<u8>> {
        Ok(self.source.fill_buf()?.first().copied())
    }

    /// Passes over bytes that were peeked at.
    fn pass_byte(&mut self) {
        self.source.consume(1);
        self.at += 1;
    }

    pub(super) fn next(&mut self) -> Result<u8, Fault> {
        let byte = self.peek()?.ok_or_else(|| self.wrong("the text ends too early"))?;
        self.pass_byte();
        self.line += u64::from(byte == b'\n');
        Ok(byte)
    }

    /// The next byte that is neither white space nor in a comment, and is still to come.
    pub(super) fn solid(&mut self) -> Result<Option<u8>, Fault> {
        while let Some(byte) = self.peek()? {
            match byte {
                b'#' => self.pass_line()?,
                b'/' => {
                    self.next()?;
                    match self.peek()? {
                        Some(b'/') => self.pass_line()?,
                        Some(b'*') => self.pass_to(b"*/")?,
                        _ => return Err(self.wrong("a slash begins nothing")),
                    }
                }
                // Between entries, where a line may end as well.
                b';' => self.pass_byte(),
                byte if byte.is_ascii_whitespace() => {
                    self.next()?;
                }
                byte => return Ok(Some(byte)),
            }
        }
        Ok(None)
    }

    fn pass_line(&mut self) -> Result<(), Fault> {
        while self.peek()?.is_some_and(|byte| byte != b'\n' && byte != b'\r') {
            self.pass_byte();
        }
        Ok(())
    }

    /// Passes over what is there up to an end.
    fn pass_to(&mut self, end: &[u8]) -> Result<(), Fault> {
        let mut last = [0; 3];
        while !last.ends_with(end) {
            last = [last[1], last[2], self.next()?];
        }
        Ok(())
    }

    /// Whether this byte is next, which is then passed over.
    pub(super) fn has(&mut self, byte: u8) -> Result<bool, Fault> {
        let is_next = self.solid()? == Some(byte);
        if is_next {
            self.pass_byte();
        }
        Ok(is_next)
    }

    pub(super) fn expect(&mut self, byte: u8) -> Result<(), Fault> {
        if self.has(byte)? {
            return Ok(());
        }
        let found = self.found()?;
        Err(self.wrong(&format!("{found} stands where {:?} belongs", char::from(byte))))
    }

    /// The next byte as messages have it.
    pub(super) fn found(&mut self) -> Result<String, Fault> {
        Ok(self.solid()?.map_or_else(|| "the end".to_owned(), |byte| format!("{:?}", char::from(byte))))
    }

    /// Letters, digits and what `others` has of signs; empty where something else is next.
    pub(super) fn word(&mut self, others: &[u8]) -> Result<&str, Fault> {
        self.solid()?;
        self.word.clear();
        while let Some(byte) = self.peek()?.filter(|byte| is_letter(*byte) || others.contains(byte)) {
            self.pass_byte();
            if self.word.len() == LONGEST {
                return Err(self.wrong("a word is longer than any program writes"));
            }
            self.word.push(byte);
        }
        match std::str::from_utf8(&self.word) {
            Ok(word) => Ok(word),
            Err(_) => Err(damaged(&format!("line {}: a word is not UTF-8", self.line))),
        }
    }

    /// A number, `inf` and `nan` among them.
    pub(super) fn number(&mut self) -> Result<f64, Fault> {
        let found = self.word(b"+-.")?;
        if let Ok(number) = found.parse() {
            return Ok(number);
        }
        let found: String = found.chars().take(40).collect();
        Err(self.wrong(&format!("{found:?} stands where a number belongs")))
    }

    /// What is between quotes, of which there may be three.
    pub(super) fn string(&mut self) -> Result<String, Fault> {
        self.solid()?;
        let quote = self.next()?;
        if !matches!(quote, b'"' | b'\'') {
            return Err(self.wrong("a name has no quotes"));
        }
        let mut kept = Vec::new();
        let mut ends = 1;
        if self.peek()? == Some(quote) {
            self.pass_byte();
            if self.peek()? != Some(quote) {
                return Ok(String::new());
            }
            self.pass_byte();
            ends = 3;
        }
        let mut found = 0;
        while found < ends {
            let mut byte = self.next()?;
            found = if byte == quote { found + 1 } else { 0 };
            if byte == b'\\' {
                byte = self.next()?;
            }
            if kept.len() < LONGEST + ends {
                kept.push(byte);
            }
        }
        kept.truncate(kept.len() - ends.min(kept.len()));
        Ok(String::from_utf8_lossy(&kept).into_owned())
    }

    pub(super) fn pass(&mut self) -> Result<Passed, Fault> {
        let first = self.solid()?;
        let (place, mut count, mut open) = (self.place(), 0, Vec::new());
        loop {
            let depth = open.len();
            match self.solid()? {
                Some(b'"' | b'\'') => drop(self.string()?),
                Some(b'@') => self.pass_asset()?,
                Some(b'<') => self.pass_to(b">")?,
                Some(byte @ (b'(' | b'[' | b'{')) => {
                    self.pass_byte();
                    if depth == DEEPEST {
                        return Err(self.wrong("a value nests deeper than any program writes"));
                    }
                    open.push(if byte == b'(' { b')' } else { byte + 2 });
                }
                Some(b',' | b'=' | b':') if depth > 0 => {
                    self.pass_byte();
                    continue;
                }
                Some(byte) if open.last() == Some(&byte) => {
                    self.pass_byte();
                    open.pop();
                    if open.is_empty() {
                        break;
                    }
                    continue;
                }
                _ => {
                    if self.word(b"+-.:_")?.is_empty() {
                        let found = self.found()?;
                        return Err(self.wrong(&format!("{found} stands where a value belongs")));
                    }
                }
            }
            match depth {
                0 if open.is_empty() => break,
                1 => count += 1,
                _ => {}
            }
        }
        let is_none = first.is_some_and(is_letter) && self.word == b"None";
        Ok(Passed { place, count, is_none })
    }

    /// What is between `<` and `>`, or `@` and `@`; empty where it is longer than programs write.
    pub(super) fn enclosed(&mut self) -> Result<String, Fault> {
        self.solid()?;
        let start = self.place();
        self.pass()?;
        let length = self.at - start.offset;
        if length > LONGEST as u64 {
            return Ok(String::new());
        }
        self.go(start)?;
        let bytes = (0..length).map(|_| self.next()).collect::<Result<Vec<u8>, Fault>>()?;
        Ok(String::from_utf8_lossy(&bytes).trim_matches(['<', '>', '@']).to_owned())
    }

    fn pass_asset(&mut self) -> Result<(), Fault> {
        self.next()?;
        if self.peek()? != Some(b'@') {
            return self.pass_to(b"@");
        }
        self.pass_byte();
        if self.peek()? == Some(b'@') {
            self.pass_byte();
            self.pass_to(b"@@@")?;
        }
        Ok(())
    }
}

/// Of names: every letter beyond ASCII may be one.
pub(super) fn is_letter(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 0x80
}
