//! A file that says who changed what: one line of JSON for every request that was let in and is not only for reading, and for what expires.

use serde::Serialize;
use std::fs::OpenOptions;
use std::io::{self, Write as _};
use std::net::IpAddr;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The file, if there is one.
#[derive(Clone, Debug)]
pub(crate) struct Audit {
    path: Option<PathBuf>,
}

/// Who changed what.
#[derive(Debug, Serialize)]
pub(crate) struct Change<'a> {
    /// When it was answered, UTC.
    #[serde(serialize_with = "utc")]
    pub(crate) time: SystemTime,
    /// Whose it is; of operators without tokens none.
    pub(crate) tenant: Option<&'a str>,
    /// The token's name; of services without tokens none.
    pub(crate) token: Option<&'a str>,
    /// The address that asked; a proxy's where there is one. None for what the service does by itself.
    pub(crate) peer: Option<IpAddr>,
    /// Method of the request, or `EXPIRE`.
    pub(crate) action: &'a str,
    /// Path of the request without its query.
    pub(crate) path: &'a str,
    /// Path of what was made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) made: Option<&'a str>,
    /// The answer's status; none where nobody waited for it, and what was asked for may have been done.
    pub(crate) status: Option<u16>,
    /// The request's id, which is in the log too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) request_id: Option<&'a str>,
}

fn utc<S: serde::Serializer>(time: &SystemTime, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&humantime::format_rfc3339_millis(*time))
}

impl Audit {
    /// # Errors
    /// A file that cannot be written to.
    pub(crate) fn open(path: Option<&Path>) -> io::Result<Self> {
        let audit = Self { path: path.map(Path::to_owned) };
        audit.append(&[])?;
        Ok(audit)
    }

    /// Whether anybody wants to know.
    pub(crate) fn is_on(&self) -> bool {
        self.path.is_some()
    }

    /// Adds a line. Blocks. What cannot be written is in the log.
    pub(crate) fn note(&self, change: &Change<'_>) {
        let line = serde_json::to_vec(change).map_err(io::Error::from).map(|mut line| {
            line.push(b'\n');
            line
        });
        if let Err(error) = line.and_then(|line| self.append(&line)) {
            tracing::error!(%error, ?change, "a change could not be written to the audit file");
        }
    }

    /// Opened each time, so that it can be moved away. Lines of several requests do not mix: each is one write to the file's end.
    fn append(&self, bytes: &[u8]) -> io::Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        OpenOptions::new().append(true).create(true).mode(0o600).open(path)?.write_all(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn lines_are_json_and_go_on_in_a_new_file_where_the_old_one_was_moved() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("audit.jsonl");
        let audit = Audit::open(Some(&path)).expect("a file");
        let change = |status| Change {
            time: SystemTime::UNIX_EPOCH + Duration::from_millis(1_700_000_000_123),
            tenant: Some("studio \"a\"\n"),
            token: None,
            peer: Some("192.0.2.7".parse().expect("an address")),
            action: "DELETE",
            path: "/v1/sessions/x",
            made: None,
            status: Some(status),
            request_id: Some("r1"),
        };
        audit.note(&change(204));
        std::fs::rename(&path, folder.path().join("old")).expect("moved");
        audit.note(&change(404));
        for (file, status) in [("old", 204), ("audit.jsonl", 404)] {
            let line = std::fs::read_to_string(folder.path().join(file)).expect("a file");
            assert_eq!(line.lines().count(), 1);
            let line: serde_json::Value = serde_json::from_str(&line).expect("JSON");
            let expected = serde_json::json!({
                "time": "2023-11-14T22:13:20.123Z", "tenant": "studio \"a\"\n", "token": null, "peer": "192.0.2.7",
                "action": "DELETE", "path": "/v1/sessions/x", "status": status, "request_id": "r1",
            });
            assert_eq!(line, expected);
        }
        assert!(Audit::open(Some(&folder.path().join("none/audit"))).is_err());
        assert!(!Audit::open(None).expect("none").is_on());
    }
}
