//! What the service asks of others: addresses that its operator named, over TLS unless they are on this machine.

use reqwest::{RequestBuilder, Url, redirect};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

/// Longest time for one request, its answer included.
const TIMEOUT: Duration = Duration::from_secs(10);

/// A client that goes where it is told and nowhere else: an answer cannot send it on to an address behind the firewall. What stays on this
/// machine goes through no proxy.
#[derive(Clone, Debug)]
pub(crate) struct Client {
    here: reqwest::Client,
    elsewhere: reqwest::Client,
}

impl Client {
    /// # Errors
    /// The system's certificates cannot be read.
    pub(crate) fn new() -> reqwest::Result<Self> {
        // Another one of the process keeps its place and serves as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let agent = concat!("cager/", env!("CARGO_PKG_VERSION"));
        let builder =
            || reqwest::Client::builder().timeout(TIMEOUT).redirect(redirect::Policy::none()).user_agent(agent);
        let loopback = [SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), SocketAddr::from((Ipv6Addr::LOCALHOST, 0))];
        let here = builder().no_proxy().resolve_to_addrs("localhost", &loopback).build()?;
        Ok(Self { here, elsewhere: builder().build()? })
    }

    /// Begins a request to an address that [`address`] let pass.
    pub(crate) fn get(&self, url: &Url) -> RequestBuilder {
        self.of(url).get(url.clone())
    }

    /// As [`Self::get`].
    pub(crate) fn post(&self, url: &Url) -> RequestBuilder {
        self.of(url).post(url.clone())
    }

    /// The one that an address is for.
    pub(crate) fn of(&self, url: &Url) -> &reqwest::Client {
        if url.scheme() == "http" { &self.here } else { &self.elsewhere }
    }
}

/// An address that may be asked: `https`, or `http` on this machine.
///
/// # Errors
/// What is wrong with it; only its host is named, since the rest may be a secret.
pub(crate) fn address(text: &str) -> Result<Url, String> {
    let url: Url = text.parse().map_err(|error| format!("this is no address: {error}"))?;
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    let here = host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    match url.scheme() {
        "https" => Ok(url),
        "http" if here => Ok(url),
        "http" => Err(format!("what is sent to {host} could be read on the way; use https://")),
        _ => Err("this is no address of the web; use https://".to_owned()),
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
