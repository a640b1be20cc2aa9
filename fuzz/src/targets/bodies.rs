//! What comes in requests.

use super::{byte, mend};
use crate::Target;
use crate::disk::MemoryDisk;
use bytes::Bytes;
use cager_proto::record::{self, HEADER_BYTES, Kind, RecordError};
use cager_service::config::ServeConfig;
use cager_service::http::fuzzing;
use cager_service::problem::ApiError;
use cager_service::service::Service;
use http::{HeaderMap, HeaderValue, StatusCode, header};
use std::sync::{Arc, LazyLock};
use tokio::runtime::{Builder, Runtime};
use tokio_util::sync::CancellationToken;

const RECORD_WORDS: &[&str] = &["CGRF", "\u{1}\0\u{1}\0", "\u{1}\0\u{2}\0", "\u{1}\0\u{3}\0"];

/// The first bytes say kind and rows that are expected, and whether the checksum is made right.
pub(super) const RECORD: Target = Target {
    name: "record",
    run: record,
    seeds: || {
        let one = |kind, prefix: [u8; 2]| {
            let mut bytes = prefix.to_vec();
            record::encode(kind, 7, 0.25, f32::NAN, &[1.0; 12], &mut bytes).expect("rows of three");
            bytes
        };
        vec![one(Kind::Positions, [0, 4]), one(Kind::HandleRows, [5, 4]), one(Kind::Cage, [2, 4])]
    },
    words: RECORD_WORDS,
    fixed: 4096,
    per_byte: 4,
};

fn record(mut bytes: &[u8]) {
    let mode = byte(&mut bytes);
    let kind = [Kind::Positions, Kind::HandleRows, Kind::Cage][usize::from(mode & 3) % 3];
    let rows = match byte(&mut bytes) {
        0xff => u32::MAX,
        0xfe => 1 << 31,
        few => u32::from(few),
    };
    let mut bytes = bytes.to_vec();
    if mode & 4 != 0 {
        mend(&mut bytes, HEADER_BYTES, HEADER_BYTES + 12 * rows as usize, 24);
    }
    let mut values = Vec::new();
    match record::decode(&bytes, kind, rows, &mut values) {
        Ok((header, taken)) => {
            assert_eq!((header.kind, header.rows, values.len()), (kind, rows, 3 * rows as usize));
            assert_eq!(taken, HEADER_BYTES + 12 * rows as usize);
            let again: Vec<u8> =
                header.to_bytes().into_iter().chain(values.iter().flat_map(|x| x.to_le_bytes())).collect();
            assert_eq!(again, bytes[..taken], "another record");
        }
        Err(error) => {
            assert!(values.is_empty(), "values of a bad record");
            if let RecordError::Incomplete { needed, have } = error {
                assert!(have == bytes.len() && needed > have, "{needed} bytes are needed and {have} are there");
            }
        }
    }
}

/// The first bytes say how frames come, how large they are, and how the body is cut.
pub(super) const FRAMES: Target = Target {
    name: "frames",
    run: frames,
    seeds: || {
        let mut records = vec![0, 2, 1, 9, 0];
        for (kind, frame, rows) in [(Kind::Positions, 3, 2), (Kind::HandleRows, 9, 1), (Kind::Positions, u32::MAX, 2)] {
            let values: Vec<f32> = vec![1.5; 3 * rows];
            record::encode(kind, frame, f32::NAN, f32::NAN, &values, &mut records).expect("rows of three");
        }
        let raw = |mode: u8| [&[mode, 2, 1, 5, 7][..], &[0; 60]].concat();
        vec![records, raw(1), raw(3), raw(5)]
    },
    words: RECORD_WORDS,
    // Room for one frame is taken as soon as its first byte is there.
    fixed: 8192,
    per_byte: 16,
};

fn frames(mut bytes: &[u8]) {
    let mode = byte(&mut bytes);
    let (points, handles) = (u32::from(byte(&mut bytes) % 32), u32::from(byte(&mut bytes) % 32));
    let (points, handles) = (points.max(1), handles.max(1));
    let (chunk, first) = (usize::from(byte(&mut bytes)).max(1), u32::from(byte(&mut bytes)));
    let first = if mode & 4 != 0 { u32::MAX - first % 4 } else { first };
    let how = fuzzing::Frames { first: (mode & 1 != 0).then_some(first), handle_rows: mode & 2 != 0, points, handles };
    let mut body = bytes.to_vec();
    if mode & 8 != 0 {
        mend_records(&mut body, points, handles);
    }
    let (whole, end) = how.read(std::iter::once(&body[..]));
    let (pieces, end_of_pieces) = how.read(body.chunks(chunk));
    assert_eq!(whole, pieces, "frames that depend on how the body is cut");
    let word = |end: Result<(), ApiError>| end.map_err(|error| (error.problem.kind, error.problem.detail));
    let (end, end_of_pieces) = (word(end), word(end_of_pieces));
    assert_eq!(end.is_ok(), end_of_pieces.is_ok(), "{end:?} and {end_of_pieces:?}");
    for (_, handle_rows, rows) in &whole {
        assert_eq!(rows.len(), 12 * if *handle_rows { handles } else { points } as usize);
    }
    if how.first.is_some() && end.is_ok() {
        assert_eq!(
            whole.iter().map(|(_, _, rows)| rows.len()).sum::<usize>(),
            body.len(),
            "bytes that are in no frame"
        );
    }
}

/// Makes the checksums of records that follow each other right.
fn mend_records(body: &mut [u8], points: u32, handles: u32) {
    let mut at = 0;
    while at + HEADER_BYTES <= body.len() {
        let rows = if body[at + 6] == Kind::HandleRows as u8 { handles } else { points };
        let next = at + HEADER_BYTES + 12 * rows as usize;
        mend(body, at + HEADER_BYTES, next, at + 24);
        at = next;
    }
}

/// A part of a multipart body, a file where it has a file's name.
fn part(name: &str, file: &str, content: &str) -> String {
    let file = if file.is_empty() { String::new() } else { format!("; filename=\"{file}\"") };
    format!(
        "--B\r\nContent-Disposition: form-data; name=\"{name}\"{file}\r\nContent-Type: application/json\r\n\r\n{content}\r\n"
    )
}

/// As [`NEW_SESSION`], of a cage to be designed.
pub(super) const NEW_CAGE: Target = Target {
    name: "new-cage",
    run: new_cage,
    seeds: || {
        let options =
            r#"{"name":"a","vertices":20,"coordinates":"mvc","style":"free","seed":7,"time_limit_s":2.5,"frames":3}"#;
        let rest = part("rest", "a/rest.obj", "v 0 0 0\n");
        let body =
            |cut: &str, rest: String| format!("{cut}multipart/form-data; boundary=B\n{rest}--B--\r\n").into_bytes();
        vec![
            body("\u{7}", rest.clone() + &part("options", "", options) + &part("frames", "f.f32", "0123456789ab")),
            body("\u{7f}", part("frames", "", &"x".repeat(3000)) + &rest),
            body("\u{1}", part("options", "", r#"{"mean_error":0.01,"style":"editable"}"#) + &rest),
        ]
    },
    words: &[
        "form-data; name=\"frames\"; filename=\"f.npy\"",
        "multipart/form-data; boundary=",
        "\r\n--B\r\n",
        "\r\n--B--",
        "\"vertices\":",
        "\"mean_error\":",
        "\"frames\":",
    ],
    fixed: 6 << 20,
    per_byte: 1024,
};

/// The first byte says how the body is cut; then the media type up to the end of the line, then the body.
pub(super) const NEW_SESSION: Target = Target {
    name: "new-session",
    run: new_session,
    seeds: || {
        let options = r#"{"name":"a","coordinates":"mvc","handles":"maxvol","regularizer":"laplacian","spectrum":20,"lambda":1.0,"flip_cage":true,"frame_rate":24}"#;
        let files = part("rest", "a/rest.obj", "v 0 0 0\n") + &part("cage", "cage.ply", "ply\n");
        let body =
            |cut: &str, rest: String| format!("{cut}multipart/form-data; boundary=B\n{rest}--B--\r\n").into_bytes();
        vec![
            body("\u{7}", files.clone() + &part("options", "", options)),
            body("\u{7f}", part("options", "", "{\"no_such_option\":0.1}") + &files),
            body("\u{1}", files.clone()),
            body(
                "\u{3}",
                part("regularizer_matrix", "d.mtx", "%%MatrixMarket matrix coordinate real general\n1 1 0\n")
                    + &part("options", "", r#"{"regularizer":"matrix","handles":"spread","handle_count":700}"#)
                    + &files,
            ),
        ]
    },
    words: &[
        "--B\r\n",
        "--B--",
        "\r\n\r\n",
        "Content-Disposition: form-data; name=\"",
        "; filename=\"",
        "; filename*=UTF-8''",
        "rest",
        "cage",
        "options",
        "\"name\":",
        "\"spectrum\":",
        "\"handle_count\":",
        "\"spread\"",
        "\"matrix\"",
        "regularizer_matrix",
        "\"lambda\":",
        "\"cage_vertices\":",
        "\"flip_cage\":",
        "\"frame_rate\":",
        "1e400",
        "null",
        "\"truncated-svd\"",
        "\"tikhonov\"",
        "\"global\"",
        "\"all\"",
        "multipart/form-data; boundary=",
        "\\ud800",
        "Content-Type: ",
        "[[[[[[",
        "4294967296",
    ],
    fixed: 6 << 20,
    per_byte: 1024,
};

static RUNTIME: LazyLock<Runtime> =
    LazyLock::new(|| Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("a runtime"));

/// With small limits, so that they are met.
static SERVICE: LazyLock<Arc<Service>> = LazyLock::new(|| {
    let config = ServeConfig {
        data: "/data".into(),
        workers: 1,
        max_rest_bytes: 4096,
        upload_bytes: 64 << 20,
        ..ServeConfig::default()
    };
    let _in_runtime = RUNTIME.enter();
    Service::start(config, Arc::new(MemoryDisk::default()), CancellationToken::new()).expect("a service")
});

fn new_session(bytes: &[u8]) {
    let Some((media_type, pieces, length)) = request(bytes) else { return };
    match RUNTIME.block_on(fuzzing::new_session(&SERVICE, media_type, pieces)) {
        Ok((rest, cage)) => assert!(rest + cage <= 4096 && rest + cage <= length, "{rest} and {cage} bytes"),
        Err(error) => assert!(error.status().is_client_error(), "{error:?}"),
    }
}

fn new_cage(bytes: &[u8]) {
    let Some((media_type, pieces, length)) = request(bytes) else { return };
    match RUNTIME.block_on(fuzzing::new_cage(&SERVICE, media_type, pieces)) {
        Ok((rest, frames)) => {
            assert!(rest <= 4096 && rest as u64 + frames <= length as u64, "{rest} and {frames} bytes");
        }
        Err(error) => assert!(error.status().is_client_error(), "{error:?}"),
    }
}

/// Media type, pieces of the body, and its length.
fn request(mut bytes: &[u8]) -> Option<(HeaderValue, Vec<Bytes>, usize)> {
    let chunk = usize::from(byte(&mut bytes)).max(1);
    let end = bytes.iter().position(|&b| b == b'\n').unwrap_or(bytes.len());
    let (media_type, body) = bytes.split_at(end);
    let body = body.get(1..).unwrap_or_default();
    let pieces = body.chunks(chunk).map(Bytes::copy_from_slice).collect();
    Some((HeaderValue::from_bytes(media_type).ok()?, pieces, body.len()))
}

/// The first byte says how many bytes there are; then the values of `Range`, `If-Range` and `If-None-Match`, a line each.
pub(super) const RANGE: Target = Target {
    name: "range",
    run: range,
    seeds: || {
        [
            "bytes=0-4",
            "bytes=5-",
            "bytes=-3",
            "bytes=0-1,3-4\n\"e\"",
            "bytes=2-3\n\"e\"\nW/\"e\", \"f\"",
            "bytes=9-2\n\n*",
        ]
        .iter()
        .flat_map(|lines| [10, 0].map(|length| [&[length], lines.as_bytes()].concat()))
        .collect()
    },
    words: &[
        "bytes=",
        "-",
        ",",
        "18446744073709551615",
        "9223372036854775808",
        "0",
        "\"e\"",
        "W/",
        "*",
        "\n",
        " ",
        "+",
    ],
    fixed: 1 << 20,
    per_byte: 256,
};

fn range(mut bytes: &[u8]) {
    let content: Vec<u8> = (0..byte(&mut bytes)).collect();
    let mut headers = HeaderMap::new();
    for (name, value) in
        [header::RANGE, header::IF_RANGE, header::IF_NONE_MATCH].into_iter().zip(bytes.split(|&b| b == b'\n'))
    {
        if let Ok(value) = HeaderValue::from_bytes(value) {
            headers.append(name, value);
        }
    }
    let all = Bytes::from(content.clone());
    let (status, headers, body) = match fuzzing::immutable(all, "e", &headers) {
        Err(error) => {
            assert_eq!(error.status(), StatusCode::RANGE_NOT_SATISFIABLE);
            assert_eq!(error.problem.limit, Some(content.len() as u64));
            return;
        }
        Ok(response) => {
            let (parts, body) = response.into_parts();
            let body = RUNTIME.block_on(http_body_util::BodyExt::collect(body)).expect("a body").to_bytes();
            (parts.status, parts.headers, body)
        }
    };
    let text = |name| headers.get(name).and_then(|value: &HeaderValue| value.to_str().ok()).unwrap_or_default();
    assert_eq!(text(header::ETAG), "\"e\"");
    match status {
        StatusCode::OK => assert_eq!(body, content),
        StatusCode::NOT_MODIFIED => assert!(body.is_empty()),
        StatusCode::PARTIAL_CONTENT => {
            let (span, length) =
                text(header::CONTENT_RANGE).strip_prefix("bytes ").and_then(|t| t.split_once('/')).expect("a range");
            let (first, last) = span.split_once('-').expect("a range");
            let (first, last): (usize, usize) = (first.parse().expect("a number"), last.parse().expect("a number"));
            assert_eq!(length, content.len().to_string());
            assert_eq!(body, content[first..=last]);
        }
        other => panic!("status {other}"),
    }
    if status != StatusCode::NOT_MODIFIED {
        assert_eq!(text(header::CONTENT_LENGTH), body.len().to_string());
    }
}
