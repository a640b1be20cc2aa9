//! The address of a service and those below it.

use crate::error::ClientError;
use reqwest::Url;
use std::net::IpAddr;

/// Where a service answers: scheme, host, port and perhaps a prefix.
#[derive(Clone, Debug)]
pub(crate) struct Address {
    base: Url,
}

impl Address {
    pub(crate) fn parse(text: &str) -> Result<Self, ClientError> {
        let bad = |what: &str| ClientError::Address { address: shown(text), what: what.to_owned() };
        let base = Url::parse(text.trim()).map_err(|error| bad(&error.to_string()))?;
        match base.scheme() {
            "http" => {}
            "https" if cfg!(feature = "tls") => {}
            "https" => return Err(bad("this program was built without https")),
            _ => return Err(bad("it does not begin with http://")),
        }
        if !base.username().is_empty() || base.password().is_some() {
            return Err(bad("it has a name or a password in it, but a service is told who asks by a token"));
        }
        if base.query().is_some() || base.fragment().is_some() {
            return Err(bad("it has a ? or # in it"));
        }
        Ok(Self { base })
    }

    pub(crate) fn is_https(&self) -> bool {
        self.base.scheme() == "https"
    }

    /// Whether it is on this very machine.
    pub(crate) fn is_loopback(&self) -> bool {
        let host = self.base.host_str().unwrap_or_default();
        let literal = host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
        host == "localhost" || literal.is_ok_and(|address| address.is_loopback())
    }

    /// The address of a resource. `id`, where there is one, was given by a caller or by the service.
    ///
    /// # Errors
    /// An `id` that is none.
    pub(crate) fn join(&self, segments: &[&str], query: &[(&str, String)]) -> Result<Url, ClientError> {
        let mut url = self.base.clone();
        if let Some(segment) = segments.iter().find(|s| matches!(**s, "" | "." | "..")) {
            return Err(ClientError::Mismatch(format!(
                "{segment:?} is not the id of a session; give one as the service named it"
            )));
        }
        if let Ok(mut path) = url.path_segments_mut() {
            path.pop_if_empty().extend(segments);
        }
        if !query.is_empty() {
            url.query_pairs_mut().extend_pairs(query);
        }
        Ok(url)
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.base.as_str().trim_end_matches('/'))
    }
}

/// An address for an error message: a password in it stays out of terminals and logs.
fn shown(text: &str) -> String {
    match (text.find("://"), text.rfind('@')) {
        (Some(start), Some(at)) if start < at => format!("{}://…{}", &text[..start], &text[at..]),
        _ => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn join(base: &str, segments: &[&str]) -> String {
        Address::parse(base).and_then(|a| a.join(segments, &[])).map_or_else(|e| e.to_string(), String::from)
    }

    #[test]
    fn resources_lie_below_the_address_with_or_without_a_prefix() {
        assert_eq!(join("http://127.0.0.1:8080", &["v1", "sessions"]), "http://127.0.0.1:8080/v1/sessions");
        assert_eq!(join("http://h/cager", &["v1"]), "http://h/cager/v1");
        assert_eq!(join(" http://h/cager/ ", &["v1"]), "http://h/cager/v1");
    }

    #[test]
    fn an_id_cannot_leave_its_place_in_the_address() {
        assert_eq!(join("http://h", &["v1", "sessions", "a/../b?c#d"]), "http://h/v1/sessions/a%2F..%2Fb%3Fc%23d");
        for id in ["", ".", ".."] {
            assert!(join("http://h", &["v1", "sessions", id]).contains("not the id"), "{id:?}");
        }
    }

    #[test]
    fn this_machine_is_known_by_its_names() {
        for (base, here) in [
            ("http://127.0.0.1:1", true),
            ("http://127.8.9.1", true),
            ("http://[::1]:1", true),
            ("http://LOCALHOST", true),
            ("http://10.0.0.1", false),
            ("http://localhost.example.org", false),
        ] {
            assert_eq!(Address::parse(base).expect("an address").is_loopback(), here, "{base}");
        }
    }

    #[test]
    fn queries_are_escaped() {
        let address = Address::parse("http://h").expect("an address");
        let url = address.join(&["v1"], &[("after", "a&b".to_owned())]).expect("a url");
        assert_eq!(url.as_str(), "http://h/v1?after=a%26b");
    }

    #[test]
    fn what_is_no_address_is_refused_without_repeating_its_password() {
        for bad in ["", "localhost:8080", "ftp://h", "http://", "http://h?x", "http://h/#x", "/tmp"] {
            assert!(matches!(Address::parse(bad), Err(ClientError::Address { .. })), "{bad}");
        }
        let error = Address::parse("http://me:secret@h").expect_err("a password").to_string();
        assert!(!error.contains("secret") && error.contains("token"), "{error}");
    }
}
