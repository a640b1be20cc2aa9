//! The words of a text.

use crate::text::{Lines, words};

/// The words of a text one after the other, over the ends of lines.
pub(super) struct Words<'a> {
    pub(super) lines: Lines<'a>,
    /// What is left of the present line.
    pub(super) line: &'a [u8],
}

impl<'a> Words<'a> {
    /// Of these bytes.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { lines: Lines::new(bytes), line: &[] }
    }

    /// The next word; `None` at the end.
    pub(super) fn next(&mut self) -> Option<&'a [u8]> {
        self.next_up_to(<[u8]>::len)
    }

    /// The next word; where it begins with this label, which ends in a colon, only the label, since no blank need follow one.
    pub(super) fn next_label(&mut self, label: &[u8]) -> Option<&'a [u8]> {
        let is_label = |word: &[u8]| word.get(..label.len()).is_some_and(|word| word.eq_ignore_ascii_case(label));
        self.next_up_to(|word| if label.ends_with(b":") && is_label(word) { label.len() } else { word.len() })
    }

    fn next_up_to(&mut self, length: impl Fn(&[u8]) -> usize) -> Option<&'a [u8]> {
        loop {
            if let Some(word) = words(self.line).next() {
                let start = self.line.iter().position(|b| !b.is_ascii_whitespace())?;
                let word = &word[..length(word)];
                self.line = &self.line[start + word.len()..];
                return Some(word);
            }
            self.line = self.lines.next()?;
        }
    }

    /// What is left of the present line; nothing is left afterwards.
    pub(super) fn rest_of_line(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.line).trim_ascii()
    }

    /// Number of the present line, from 1.
    pub(super) fn number(&self) -> usize {
        self.lines.number()
    }
}
