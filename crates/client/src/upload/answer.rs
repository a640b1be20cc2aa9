//! Parses the NDJSON response of an upload.

use crate::error::Failure;
use crate::problem::classify;
use cager_proto::messages::{FrameResult, Problem};
use serde::Deserialize;

/// One line. Problems are tried first, since they may also have a field `frame`.
#[derive(Deserialize)]
#[serde(untagged)]
enum Line {
    Problem(Problem),
    Wrapped { problem: Problem },
    Result(FrameResult),
}

/// Reads one line; `None` for an empty one.
///
/// # Errors
/// What the line reports, or that it is none.
pub(crate) fn result(line: &[u8]) -> Result<Option<FrameResult>, Failure> {
    if line.iter().all(u8::is_ascii_whitespace) {
        return Ok(None);
    }
    match serde_json::from_slice(line) {
        Ok(Line::Result(result)) => Ok(Some(result)),
        Ok(Line::Problem(problem) | Line::Wrapped { problem }) => Err(classify(problem, None)),
        Err(_) => {
            let start = String::from_utf8_lossy(&line[..line.len().min(100)]);
            Err(Failure::protocol(format!("{start:?} is no result of a frame")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_and_problems_are_told_apart() {
        let line = br#"{"frame":7,"l2":0.5,"linf":null}"#;
        assert!(matches!(result(line), Ok(Some(FrameResult { frame: 7, l2: Some(0.5), linf: None }))));
        assert!(matches!(result(b" "), Ok(None)));
        let problem = r#"{"type":"urn:cager:problem:bad-frame","title":"t","status":422,"detail":"d","frame":7}"#;
        for line in [problem.to_owned(), format!(r#"{{"problem":{problem}}}"#)] {
            let failure = result(line.as_bytes()).expect_err("a problem");
            assert!(matches!(failure, Failure::Final(_)) && failure.status() == Some(422), "{failure:?}");
        }
        let busy = problem.replace("422", "503");
        assert!(matches!(result(busy.as_bytes()), Err(Failure::Transient { .. })));
        assert!(matches!(result(b"<html>"), Err(Failure::Final(_))));
    }
}
