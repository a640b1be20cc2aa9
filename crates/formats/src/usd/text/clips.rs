//! What a text says of value clips.

use super::parser::Parser;
use crate::error::Fault;
use crate::usd::clips::{Clips, Entry};

impl Parser<'_, '_> {
    /// The only sequence of clips of a dictionary of these; none where there are several, or where one
    /// has what is not read.
    pub(super) fn clips(&mut self) -> Result<Option<Clips>, Fault> {
        let (mut found, mut is_plain) = (Vec::new(), true);
        self.scanner.expect(b'{')?;
        while !self.scanner.has(b'}')? {
            self.word()?;
            self.short()?;
            self.scanner.expect(b'=')?;
            let mut clips = Clips::default();
            self.scanner.expect(b'{')?;
            while !self.scanner.has(b'}')? {
                let type_name = self.word()?;
                let is_list = self.scanner.has(b'[')?;
                if is_list {
                    self.scanner.expect(b']')?;
                }
                let name = self.short()?;
                self.scanner.expect(b'=')?;
                let entry = self.clip_entry(&type_name, is_list)?;
                is_plain &= entry.is_some_and(|entry| clips.take(&name, entry));
            }
            found.push(clips);
        }
        Ok(found.pop().filter(|_| is_plain && found.is_empty()))
    }

    fn clip_entry(&mut self, type_name: &str, is_list: bool) -> Result<Option<Entry>, Fault> {
        Ok(Some(match (type_name, is_list) {
            ("asset", false) => Entry::Text(self.scanner.enclosed()?),
            ("string" | "token", false) => Entry::Text(self.scanner.string()?),
            ("double" | "float" | "int", false) => Entry::Number(self.scanner.number()?),
            ("bool", false) => {
                self.scanner.pass()?;
                Entry::Number(0.0)
            }
            ("asset", true) => Entry::Texts(self.list(|parser| parser.scanner.enclosed())?),
            ("double2", true) => Entry::Pairs(self.list(|parser| {
                parser.scanner.expect(b'(')?;
                let first = parser.scanner.number()?;
                parser.scanner.expect(b',')?;
                let pair = [first, parser.scanner.number()?];
                parser.scanner.expect(b')')?;
                Ok(pair)
            })?),
            _ => {
                self.scanner.pass()?;
                return Ok(None);
            }
        }))
    }

    /// Values between square brackets, whose last one may have a comma behind it.
    fn list<T>(&mut self, mut value: impl FnMut(&mut Self) -> Result<T, Fault>) -> Result<Vec<T>, Fault> {
        let mut values = Vec::new();
        self.scanner.expect(b'[')?;
        while !self.scanner.has(b']')? {
            values.push(value(self)?);
            self.scanner.has(b',')?;
        }
        Ok(values)
    }
}
