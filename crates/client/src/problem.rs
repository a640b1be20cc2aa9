//! Converts error responses into problems.

use crate::backoff::retry_after;
use crate::error::{ClientError, Failure};
use cager_proto::messages::Problem;
use reqwest::header::{CONTENT_TYPE, HeaderName, LOCATION, RETRY_AFTER};
use reqwest::{Response, StatusCode};
use std::time::{Duration, SystemTime};

/// Bytes read from the body of an error response.
const MAX_PROBLEM_BYTES: usize = 64 << 10;

/// Characters shown of a body that is not a problem.
const MAX_SHOWN_CHARS: usize = 200;

/// Longest wait for the body of an error response; after that only its status is reported.
const BODY_TIMEOUT: Duration = Duration::from_secs(5);

/// Returns a 2xx response, and converts any other into a failure.
pub(crate) async fn check(response: Response) -> Result<Response, Failure> {
    if response.status().is_success() {
        return Ok(response);
    }
    let wait = response
        .headers()
        .get(RETRY_AFTER)
        .and_then(|value| value.to_str().ok())
        .and_then(|value| retry_after(value, SystemTime::now()));
    let problem = read_problem(response).await;
    Err(classify(problem, wait))
}

/// Whether to retry after this problem.
pub(crate) fn classify(problem: Problem, retry_after: Option<Duration>) -> Failure {
    let transient = match problem.status {
        408 | 425 | 429 | 500 | 502..=504 | 520..=599 => true,
        // Conflicts that resolve by themselves.
        409 => retry_after.is_some() || matches!(problem.word(), "not-ready" | "idempotency-key-in-use"),
        _ => false,
    };
    let error = ClientError::Refused(Box::new(problem));
    if transient { Failure::Transient { error, retry_after } } else { Failure::Final(error) }
}

/// Whether a proxy, and not the service, refused the length of a body.
pub(crate) fn is_body_limit(problem: &Problem) -> bool {
    problem.status == StatusCode::PAYLOAD_TOO_LARGE.as_u16() && !problem.kind.starts_with(Problem::TYPE_PREFIX)
}

async fn read_problem(mut response: Response) -> Problem {
    let status = response.status();
    let is_json = header(&response, &CONTENT_TYPE).is_some_and(|kind| kind.to_ascii_lowercase().contains("json"));
    let place = header(&response, &LOCATION).map(str::to_owned);
    let mut body = Vec::new();
    let read = async {
        while let Ok(Some(chunk)) = response.chunk().await {
            let room = MAX_PROBLEM_BYTES - body.len();
            body.extend_from_slice(&chunk[..chunk.len().min(room)]);
            if body.len() == MAX_PROBLEM_BYTES {
                break;
            }
        }
    };
    // The head of the answer is worth reporting even if the rest never comes.
    let _ = tokio::time::timeout(BODY_TIMEOUT, read).await;
    parse(status, is_json, place.as_deref(), &body)
}

fn header<'a>(response: &'a Response, name: &HeaderName) -> Option<&'a str> {
    response.headers().get(name)?.to_str().ok()
}

/// Parses a problem, or makes one from the page of a proxy or another server.
fn parse(status: StatusCode, is_json: bool, place: Option<&str>, body: &[u8]) -> Problem {
    let parsed = if is_json { serde_json::from_slice::<Problem>(body).ok() } else { None };
    if let Some(problem) = parsed
        .filter(|problem| status != StatusCode::PAYLOAD_TOO_LARGE || problem.kind.starts_with(Problem::TYPE_PREFIX))
    {
        // The status of the answer is what counts; a problem's own is only for information (RFC 9457, 3.1.2).
        return Problem {
            status: status.as_u16(),
            title: printable(&problem.title),
            detail: printable(&problem.detail),
            ..problem
        };
    }
    let reason = status.canonical_reason().unwrap_or("an unknown status");
    let text = visible_text(&String::from_utf8_lossy(body));
    let mut detail = format!("the server answered {} ({reason})", status.as_u16());
    if status == StatusCode::PAYLOAD_TOO_LARGE {
        let said = if text.is_empty() { String::new() } else { format!(": {text}") };
        detail = format!(
            "a proxy before the service does not let a request of this size through (413{said}); raise its limit on bodies, which \
             nginx calls client_max_body_size, or give the service's own address"
        );
    } else if let Some(place) = place.filter(|_| status.is_redirection()) {
        detail.push_str(&format!(" and names {}; use that address", printable(place)));
    } else if text.is_empty() {
        detail.push_str(" without saying why; look at its log, or at a proxy's before it");
    } else {
        detail.push_str(&format!(", which is not an error of a CageR service: {text}"));
    }
    Problem {
        kind: "about:blank".to_owned(),
        title: reason.to_owned(),
        status: status.as_u16(),
        detail,
        ..Problem::default()
    }
}

/// The visible text of an HTML page, on one line and truncated.
fn visible_text(page: &str) -> String {
    let mut text = String::new();
    let mut in_tag = false;
    for c in page.chars() {
        match c {
            '<' => in_tag = true,
            '>' if in_tag => {
                in_tag = false;
                text.push(' ');
            }
            _ if in_tag => {}
            _ => text.push(c),
        }
    }
    let line = printable(&text.split_whitespace().collect::<Vec<_>>().join(" "));
    match line.char_indices().nth(MAX_SHOWN_CHARS) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}

/// Replaces control characters, which could manipulate a terminal.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_proxys_page_is_reported_as_its_words_cut_to_200_characters() {
        let page =
            format!("<html><head><title>502</title></head>\n<body>Bad\tGateway {}</body></html>", "x".repeat(1000));
        let problem = parse(StatusCode::BAD_GATEWAY, false, None, page.as_bytes());
        assert_eq!(problem.status, 502);
        assert!(problem.detail.contains("502 Bad Gateway xxx"), "{}", problem.detail);
        assert!(problem.detail.chars().count() < 300, "{}", problem.detail);
        assert!(!problem.detail.contains('<'));
    }

    #[test]
    fn a_body_of_garbage_moves_no_cursor() {
        let problem = parse(StatusCode::IM_A_TEAPOT, false, None, b"\x1b[2Jhello\xff\xfe");
        assert!(problem.detail.contains("hello"));
        assert!(!problem.detail.contains('\x1b'));
    }

    #[test]
    fn an_empty_refusal_still_says_something() {
        let problem = parse(StatusCode::SERVICE_UNAVAILABLE, true, None, b"");
        assert!(problem.detail.contains("503") && problem.detail.contains("without saying why"));
    }

    #[tokio::test]
    async fn a_redirect_names_its_target_as_it_is_written() {
        let response = http::Response::builder().status(308).header(LOCATION, "https://cager.example/Studio/A");
        let problem = read_problem(response.body("moved").expect("a response").into()).await;
        assert!(problem.detail.contains("https://cager.example/Studio/A"), "{}", problem.detail);
    }

    #[tokio::test]
    async fn the_kind_of_a_body_may_be_written_in_any_case() {
        let response = http::Response::builder().status(422).header(CONTENT_TYPE, "Application/Problem+JSON");
        let body = r#"{"type":"about:blank","title":"t","status":422,"detail":"face 3 is open"}"#;
        let problem = read_problem(response.body(body).expect("a response").into()).await;
        assert_eq!(problem.detail, "face 3 is open");
    }

    #[test]
    fn the_problem_of_the_service_is_kept_with_the_status_of_the_answer() {
        let body = br#"{"type":"urn:cager:problem:bad-cage","title":"Bad cage","status":1,"detail":"face 3 is open","request_id":"r1","missing":[[1,2]]}"#;
        let problem = parse(StatusCode::UNPROCESSABLE_ENTITY, true, None, body);
        assert_eq!((problem.status, problem.word()), (422, "bad-cage"));
        assert_eq!(ClientError::Refused(Box::new(problem)).to_string(), "face 3 is open (request r1)");
    }

    #[test]
    fn only_what_may_go_away_is_tried_again() {
        let failure = |status, word: &str| {
            let kind = format!("{}{word}", Problem::TYPE_PREFIX);
            matches!(classify(Problem { kind, status, ..Problem::default() }, None), Failure::Transient { .. })
        };
        for status in [408, 425, 429, 500, 502, 503, 504] {
            assert!(failure(status, "any"), "{status}");
        }
        for status in [301, 400, 401, 403, 404, 409, 413, 415, 422, 501, 505, 507] {
            assert!(!failure(status, "any"), "{status}");
        }
        assert!(failure(409, "not-ready"));
        assert!(!failure(409, "frame-conflict"));
    }
}
