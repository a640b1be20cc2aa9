//! Incremental parser of server-sent events (WHATWG HTML, §9.2).

use crate::lines::{LINE_BYTES, Lines, TooLong};
use std::time::Duration;

/// One event.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct SseEvent {
    /// Its type; empty where the stream gives none.
    pub(crate) event: String,
    /// Its data, lines joined by `\n`.
    pub(crate) data: String,
}

/// Incremental parser of server-sent events.
#[derive(Debug, Default)]
pub(crate) struct SseParser {
    lines: Lines,
    fields: Fields,
    ready: Vec<SseEvent>,
}

#[derive(Debug, Default)]
struct Fields {
    begun: bool,
    event: String,
    data: Option<String>,
    id: Option<String>,
    last_id: Option<String>,
    retry: Option<Duration>,
}

impl SseParser {
    /// Takes a piece of the stream and returns the events that it completes.
    pub(crate) fn push(&mut self, piece: &[u8]) -> Result<Vec<SseEvent>, TooLong> {
        let Self { lines, fields, ready } = self;
        lines.push(piece, |line| {
            ready.extend(fields.line(line)?);
            Ok::<_, TooLong>(())
        })?;
        Ok(std::mem::take(ready))
    }

    /// The last event's identifier, for a connection that goes on after it.
    pub(crate) fn last_id(&self) -> Option<&str> {
        self.fields.last_id.as_deref()
    }

    /// The pause that the stream asks for before the next connection.
    pub(crate) fn retry(&self) -> Option<Duration> {
        self.fields.retry
    }
}

impl Fields {
    fn line(&mut self, line: &[u8]) -> Result<Option<SseEvent>, TooLong> {
        let line = if std::mem::replace(&mut self.begun, true) {
            line
        } else {
            line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line)
        };
        if line.is_empty() {
            self.last_id.clone_from(&self.id);
            let event = std::mem::take(&mut self.event);
            return Ok(self.data.take().map(|data| SseEvent { event, data }));
        }
        let line = String::from_utf8_lossy(line);
        let (field, value) = line.split_once(':').unwrap_or((&line, ""));
        let value = value.strip_prefix(' ').unwrap_or(value);
        match field {
            "event" => value.clone_into(&mut self.event),
            "data" => match &mut self.data {
                None => self.data = Some(value.to_owned()),
                Some(data) if data.len() + value.len() < LINE_BYTES => {
                    data.push('\n');
                    data.push_str(value);
                }
                Some(_) => return Err(TooLong),
            },
            "id" if !value.contains('\0') => self.id = Some(value.to_owned()),
            "retry" => self.retry = value.parse().ok().map(Duration::from_millis).or(self.retry),
            // Comments, which keep connections open, and fields of the future.
            _ => {}
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chunks::{cut, cuts};
    use proptest::prelude::*;

    const STREAM: &str = "\u{feff}: hello\nretry: 250\n\nid: 7\nevent: progress\ndata: {\"a\":\ndata:1}\n\ndata\n\nid: 8\r\ndata: x\r\n\r\ndata: cut";

    proptest! {
        #[test]
        fn events_are_found_however_the_stream_is_cut(cuts in cuts()) {
            let mut parser = SseParser::default();
            let mut found = Vec::new();
            for piece in cut(STREAM.as_bytes(), &cuts) {
                found.extend(parser.push(piece).expect("short"));
            }
            let event = |event: &str, data: &str| SseEvent { event: event.to_owned(), data: data.to_owned() };
            prop_assert_eq!(found, [event("progress", "{\"a\":\n1}"), event("", ""), event("", "x")]);
            prop_assert_eq!(parser.last_id(), Some("8"));
            prop_assert_eq!(parser.retry(), Some(Duration::from_millis(250)));
        }

        #[test]
        fn garbage_does_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..300), cuts in cuts()) {
            let mut parser = SseParser::default();
            for piece in cut(&bytes, &cuts) {
                let _ = parser.push(piece);
            }
        }
    }

    #[test]
    fn an_event_without_end_is_refused() {
        let mut parser = SseParser::default();
        let line = format!("data: {}\n", "x".repeat(1 << 16));
        assert!((0..100).any(|_| parser.push(line.as_bytes()).is_err()));
    }

    #[test]
    fn the_identifier_counts_only_once_its_event_is_whole() {
        let mut parser = SseParser::default();
        parser.push(b"id: 1\ndata: a\n\nid: 2\ndata: b\n").expect("short");
        assert_eq!(parser.last_id(), Some("1"));
    }
}
