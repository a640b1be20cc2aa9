//! A look at the raw bytes of a request's header, before the HTTP library has parsed it.
//!
//! Two facts are lost in parsing: that a request has both `Content-Length` and `Transfer-Encoding` (the library drops the length, but a
//! proxy in front may have used it: request smuggling), and when the header began.

const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
const CONTENT_LENGTH: &[u8] = b"content-length:";
const TRANSFER_ENCODING: &[u8] = b"transfer-encoding:";

/// Facts about a complete header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Head {
    /// Its size, in bytes.
    pub(super) bytes: usize,
    /// Whether it has both `Content-Length` and `Transfer-Encoding`.
    pub(super) ambiguous: bool,
}

/// Result of scanning more bytes.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Scan {
    /// The header is incomplete.
    More,
    /// This is HTTP/2.
    Http2,
    /// The header is complete.
    Done(Head),
}

/// Reads a header byte by byte, keeping only the start of the line.
#[derive(Debug, Default)]
pub(super) struct HeadScanner {
    /// Bytes of the preface seen so far; `None` once there was another byte.
    preface: Option<usize>,
    bytes: usize,
    /// Length of the current line so far.
    column: usize,
    /// Start of the current line, in lower case, as far as `TRANSFER_ENCODING` reaches.
    start: [u8; TRANSFER_ENCODING.len()],
    lines: usize,
    has_length: bool,
    has_encoding: bool,
}

impl HeadScanner {
    /// A scanner for the first bytes of a connection, which may turn out to be HTTP/2.
    pub(super) fn first() -> Self {
        Self { preface: Some(0), ..Self::default() }
    }

    /// Takes in the next bytes. Bytes after the header's end are not looked at.
    pub(super) fn feed(&mut self, bytes: &[u8]) -> Scan {
        for &byte in bytes {
            if let Some(matched) = self.preface {
                self.preface = (PREFACE[matched] == byte).then_some(matched + 1);
                if self.preface == Some(PREFACE.len()) {
                    return Scan::Http2;
                }
            }
            self.bytes += 1;
            if byte == b'\n' {
                let empty = self.column == 0 || (self.column == 1 && self.start[0] == b'\r');
                // Empty lines before the request line are allowed, as is the one in HTTP/2's preface.
                if empty && self.lines > 0 && self.preface.is_none() {
                    return Scan::Done(Head { bytes: self.bytes, ambiguous: self.has_length && self.has_encoding });
                }
                self.lines += usize::from(!empty);
                self.column = 0;
                continue;
            }
            if let Some(place) = self.start.get_mut(self.column) {
                *place = byte.to_ascii_lowercase();
                self.has_length |= self.column + 1 == CONTENT_LENGTH.len() && self.start.starts_with(CONTENT_LENGTH);
                self.has_encoding |= self.column + 1 == TRANSFER_ENCODING.len() && self.start == TRANSFER_ENCODING;
            }
            self.column += 1;
        }
        Scan::More
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan_in_pieces(text: &str, piece: usize) -> Scan {
        let mut scanner = HeadScanner::first();
        for part in text.as_bytes().chunks(piece) {
            match scanner.feed(part) {
                Scan::More => {}
                other => return other,
            }
        }
        Scan::More
    }

    #[test]
    fn lengths_are_found_whatever_the_pieces() {
        let both = "POST /a HTTP/1.1\r\nHost: x\r\nContent-LENGTH: 3\r\nX: content-length:\r\nTransfer-Encoding: chunked\r\n\r\nabc";
        let one = "POST /a HTTP/1.1\r\nHost: x\r\nX-Content-Length: 3\r\ntransfer-encoding: chunked\r\n\r\n";
        for piece in [1, 2, 3, 7, 1000] {
            assert_eq!(
                scan_in_pieces(both, piece),
                Scan::Done(Head { bytes: both.len() - 3, ambiguous: true }),
                "pieces of {piece}"
            );
            assert_eq!(scan_in_pieces(one, piece), Scan::Done(Head { bytes: one.len(), ambiguous: false }));
        }
    }

    #[test]
    fn bare_line_feeds_and_leading_empty_lines_are_understood() {
        let head = "\r\n\r\nGET / HTTP/1.1\nContent-Length: 1\nTransfer-Encoding: x\n\n";
        assert_eq!(scan_in_pieces(head, 1), Scan::Done(Head { bytes: head.len(), ambiguous: true }));
    }

    #[test]
    fn the_preface_is_http_2_and_half_of_it_is_nothing_yet() {
        let preface = std::str::from_utf8(PREFACE).unwrap();
        assert_eq!(scan_in_pieces(preface, 5), Scan::Http2);
        assert_eq!(scan_in_pieces(&preface[..20], 5), Scan::More);
        assert!(matches!(scan_in_pieces("PRI * HTTP/2.0\r\nHost: x\r\n\r\n", 5), Scan::Done(_)));
    }
}
