//! Splits a chunked byte stream into lines.

/// Longest line: a problem with many missing ranges is shorter.
pub(crate) const LINE_BYTES: usize = 1 << 20;

/// A line longer than anyone may send.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct TooLong;

/// Splits at `\n`, `\r` and `\r\n`; lines come without their end.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    /// The line that is not whole yet.
    line: Vec<u8>,
    /// The last byte was `\r`, so a `\n` now belongs to it.
    after_return: bool,
}

impl Lines {
    /// Takes a piece of the stream and gives every line that it ends to `each`.
    ///
    /// # Errors
    /// [`TooLong`], and what `each` returns; the stream is of no use then.
    pub(crate) fn push<E: From<TooLong>>(
        &mut self,
        mut piece: &[u8],
        mut each: impl FnMut(&[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        while let Some(&first) = piece.first() {
            if std::mem::take(&mut self.after_return) && first == b'\n' {
                piece = &piece[1..];
                continue;
            }
            let end = piece.iter().position(|&b| b == b'\n' || b == b'\r');
            let part = &piece[..end.unwrap_or(piece.len())];
            if self.line.len() + part.len() > LINE_BYTES {
                return Err(TooLong.into());
            }
            let Some(end) = end else {
                self.line.extend_from_slice(part);
                return Ok(());
            };
            if self.line.is_empty() {
                each(part)?;
            } else {
                self.line.extend_from_slice(part);
                each(&self.line)?;
                self.line.clear();
            }
            self.after_return = piece[end] == b'\r';
            piece = &piece[end + 1..];
        }
        Ok(())
    }

    /// What came after the last end of a line.
    pub(crate) fn rest(&self) -> &[u8] {
        &self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chunks::{cut, cuts};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn lines_are_found_however_the_stream_is_cut(
            lines in prop::collection::vec(("[a-z{}\" ]{0,12}", prop_oneof![Just("\n"), Just("\r\n"), Just("\r")]), 0..8),
            rest in "[a-z]{0,5}",
            cuts in cuts(),
        ) {
            // An empty line after a bare \r would be read as the \n of that \r.
            let ends: Vec<&str> = lines.iter().map(|(_, end)| if *end == "\r" { "\r\r" } else { end }).collect();
            let mut text = String::new();
            let mut expected = Vec::new();
            for ((line, _), end) in lines.iter().zip(&ends) {
                text.push_str(line);
                text.push_str(end);
                expected.push(line.clone());
                if *end == "\r\r" {
                    expected.push(String::new());
                }
            }
            // \r\r followed by a line that is empty and ends in \n would be one \r\n.
            prop_assume!(!text.contains("\r\r\n"));
            text.push_str(&rest);
            let mut splitter = Lines::default();
            let mut found = Vec::new();
            for piece in cut(text.as_bytes(), &cuts) {
                splitter.push(piece, |line| { found.push(String::from_utf8_lossy(line).into_owned()); Ok::<_, TooLong>(()) }).expect("short");
            }
            prop_assert_eq!(found, expected);
            prop_assert_eq!(splitter.rest(), rest.as_bytes());
        }
    }

    #[test]
    fn a_line_without_end_is_refused_before_memory_runs_out() {
        let mut splitter = Lines::default();
        let piece = vec![b'x'; 1 << 16];
        let refused = (0..100).find(|_| splitter.push(&piece, |_| Ok::<_, TooLong>(())).is_err());
        assert_eq!(refused, Some(LINE_BYTES >> 16));
        assert!(splitter.rest().len() <= LINE_BYTES);
    }
}
