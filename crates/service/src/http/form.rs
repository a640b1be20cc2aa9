//! Multipart forms, one part after the other.

use super::multipart::{bad, broken};
use crate::problem::ApiError;
use axum::body::{Body, BodyDataStream};
use axum::extract::multipart::Field;
use axum::extract::{FromRequest, Multipart, Request};
use futures_util::{StreamExt as _, stream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

/// Most bytes before the content of a part: its boundary and its headers. The parser (multer 3.1) looks through all of them again with each piece that comes, so that
/// without a limit a small body that is unpacked would keep a processor busy for minutes.
const HEAD_BYTES: usize = 64 << 10;

/// A form whose parts are still to come.
pub(super) struct Form {
    parts: Multipart,
    head: Arc<Head>,
}

struct Head {
    /// How many more bytes are taken before the content of a part begins.
    left: AtomicUsize,
    /// That more came, and was refused.
    is_refused: AtomicBool,
}

impl Form {
    /// The form in a request's body.
    ///
    /// # Errors
    /// It is no multipart form.
    pub(super) async fn of(request: Request) -> Result<Self, ApiError> {
        let head = Arc::new(Head { left: AtomicUsize::new(HEAD_BYTES), is_refused: AtomicBool::new(false) });
        let shared = Arc::clone(&head);
        // It gets one piece at a time: the parser buffers whatever is there, which must not be a whole capture; and it looks for the first
        // boundary between two readings of the body, and takes one that comes to its end in the second for incomplete.
        let pieces = move |(mut pieces, is_first): (BodyDataStream, bool)| {
            let head = Arc::clone(&shared);
            async move {
                if !is_first {
                    tokio::task::yield_now().await;
                }
                let piece = pieces.next().await?;
                let admitted = piece.and_then(|piece| match head.left.load(Relaxed) {
                    0 => {
                        head.is_refused.store(true, Relaxed);
                        Err(axum::Error::new("no part begins"))
                    }
                    more => {
                        head.left.store(more.saturating_sub(piece.len()), Relaxed);
                        Ok(piece)
                    }
                });
                Some((admitted, (pieces, false)))
            }
        };
        let request = request.map(|body| Body::from_stream(stream::unfold((body.into_data_stream(), true), pieces)));
        let parts = Multipart::from_request(request, &())
            .await
            .map_err(|error| bad(format!("the multipart body cannot be read: {}", error.body_text())))?;
        Ok(Self { parts, head })
    }

    /// The next part; the one before was read to its end.
    ///
    /// # Errors
    /// The body broke off, or no part begins.
    pub(super) async fn next(&mut self) -> Result<Option<Field<'_>>, ApiError> {
        self.head.left.store(HEAD_BYTES, Relaxed);
        let found = self.parts.next_field().await;
        self.head.left.store(usize::MAX, Relaxed);
        found.map_err(|error| match self.head.is_refused.load(Relaxed) {
            true => bad(format!(
                "no part of the multipart body begins within {HEAD_BYTES} bytes; check its boundary, and send nothing before it"
            )),
            false => broken(&error),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use std::task::Poll;

    fn request(body: Body) -> Request {
        let request = Request::builder().header("content-type", "multipart/form-data; boundary=b");
        request.body(body).expect("a request")
    }

    #[tokio::test]
    async fn a_form_that_comes_while_it_is_looked_at_is_read() {
        let text = "--b\r\nContent-Disposition: form-data; name=\"x\"\r\n\r\n1\r\n--b--\r\n";
        let mut polls = 0;
        let body = stream::poll_fn(move |cx| {
            polls += 1;
            match polls {
                1 => {
                    cx.waker().wake_by_ref();
                    Poll::Pending
                }
                2 => Poll::Ready(Some(Ok::<_, std::io::Error>(Bytes::from_static(text.as_bytes())))),
                _ => Poll::Ready(None),
            }
        });
        let mut form = Form::of(request(Body::from_stream(body))).await.expect("a form");
        let field = form.next().await.expect("a whole form").expect("a part");
        assert_eq!(field.name(), Some("x"));
        assert_eq!(field.text().await.expect("its text"), "1");
    }

    #[tokio::test]
    async fn mistakes_in_a_large_piece_are_told_as_what_they_are() {
        let malformed = [b"--b\r\nno header\r\n\r\n".to_vec(), vec![b'x'; HEAD_BYTES]].concat();
        let broken_off = [b"--b\r\nX-A: ".to_vec(), vec![b'x'; HEAD_BYTES]].concat();
        for body in [malformed, broken_off] {
            let mut form = Form::of(request(Body::from(body))).await.expect("a form");
            let error = form.next().await.expect_err("no part");
            assert!(!error.problem.detail.contains("check its boundary"), "{}", error.problem.detail);
        }
    }

    #[tokio::test]
    async fn what_begins_no_part_is_given_up_early() {
        let large = [b"--b\r\nContent-Disposition: form-data; name=\"x\"\r\n\r\n".to_vec(), vec![7; 1 << 20]].concat();
        let endless_header = [&large[..large.len() / 2], b"\r\n--b\r\nContent-Disposition: "].concat();
        for (begin, parts) in [(Vec::new(), 0), (b"--b\r\nX-A: ".to_vec(), 0), (endless_header, 1)] {
            let taken = Arc::new(AtomicUsize::new(0));
            let counted = Arc::clone(&taken);
            let begin: Vec<Bytes> = begin.chunks(8 << 10).map(Bytes::copy_from_slice).collect();
            let pieces = stream::iter(begin).chain(stream::repeat(Bytes::from_static(&[b'x'; 8 << 10])).take(1 << 14));
            let counting = move |piece: Bytes| {
                counted.fetch_add(piece.len(), Relaxed);
                Ok::<_, std::io::Error>(piece)
            };
            let mut form = Form::of(request(Body::from_stream(pieces.map(counting)))).await.expect("a form");
            for _ in 0..parts {
                let mut part = form.next().await.expect("a whole form").expect("a part");
                while part.chunk().await.expect("its content").is_some() {}
            }
            let error = form.next().await.expect_err("no part");
            assert!(error.problem.detail.contains("check its boundary"), "{}", error.problem.detail);
            assert!(taken.load(Relaxed) < 2 << 20, "{taken:?} bytes of 128 MiB");
        }
    }
}
