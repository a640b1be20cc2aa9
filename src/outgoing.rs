//! What the service asks of others: addresses that its operator named, over TLS unless they are on this machine.

use reqwest::{Client, Url, redirect};
use std::net::IpAddr;
use std::time::Duration;

/// Longest time for one request, its answer included.
const TIMEOUT: Duration = Duration::from_secs(10);

/// A client that goes where it is told and nowhere else: an answer cannot send it on to an address behind the firewall.
///
/// # Errors
/// The system's certificates cannot be read.
pub(crate) fn client() -> reqwest::Result<Client> {
    // Another one of the process keeps its place and serves as well.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let agent = concat!("cager/", env!("CARGO_PKG_VERSION"));
    Client::builder().timeout(TIMEOUT).redirect(redirect::Policy::none()).user_agent(agent).build()
}

/// An address that may be asked: `https`, or `http` on this machine.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn address(text: &str) -> Result<Url, String> {
    let url: Url = text.parse().map_err(|error| format!("{text:?} is no address: {error}"))?;
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    let here = host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    match url.scheme() {
        "https" => Ok(url),
        "http" if here => Ok(url),
        "http" => Err(format!("{text:?}: what is sent there could be read on the way; use https://")),
        _ => Err(format!("{text:?}: use https://")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_encrypted_or_on_this_machine() {
        for good in
            ["https://login.example/realms/farm", "http://127.0.0.1:9/x", "http://[::1]:9/", "http://localhost:80/"]
        {
            assert!(address(good).is_ok(), "{good}");
        }
        for bad in
            ["http://login.example/", "http://10.0.0.1/", "http://localhost.example/", "ftp://127.0.0.1/", "farm", ""]
        {
            assert!(address(bad).is_err(), "{bad}");
        }
    }
}
