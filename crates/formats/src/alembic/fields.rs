//! Fields of tables, one after another.

use super::ogawa::damaged;
use crate::error::Fault;

/// What is left of a table.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], Fault> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or_else(|| damaged("a table ends too early"))?;
        self.0 = rest;
        Ok(taken)
    }

    /// A whole number of 1 << `width` bytes: 1, 2 or 4.
    pub(super) fn number(&mut self, width: u32) -> Result<usize, Fault> {
        let bytes = match width {
            0..=2 => self.take(1 << width)?,
            _ => return Err(damaged("a table has numbers of eight bytes")),
        };
        Ok(bytes.iter().rev().fold(0, |number, &byte| number << 8 | usize::from(byte)))
    }

    pub(super) fn real(&mut self) -> Result<f64, Fault> {
        let bytes = self.take(8)?.as_chunks().0;
        Ok(bytes.first().map_or(0.0, |bytes| f64::from_le_bytes(*bytes)))
    }
}
