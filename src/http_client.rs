//! HTTP client for outgoing requests to addresses that the operator configured: TLS is required except on loopback addresses.

use reqwest::{RequestBuilder, Url, redirect};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

/// Longest time for one request, its answer included.
const TIMEOUT: Duration = Duration::from_secs(10);

/// An HTTP client that follows no redirects, so that a response cannot send it to an address behind the firewall. Loopback addresses bypass
/// proxies.
#[derive(Clone, Debug)]
pub(crate) struct Client {
    direct: reqwest::Client,
    proxied: reqwest::Client,
}

impl Client {
    /// # Errors
    /// The system's certificates cannot be read.
    pub(crate) fn new() -> reqwest::Result<Self> {
        // Fails if the process has installed another provider, which serves as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let agent = concat!("cager/", env!("CARGO_PKG_VERSION"));
        let builder =
            || reqwest::Client::builder().timeout(TIMEOUT).redirect(redirect::Policy::none()).user_agent(agent);
        let loopback = [SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), SocketAddr::from((Ipv6Addr::LOCALHOST, 0))];
        let direct = builder().no_proxy().resolve_to_addrs("localhost", &loopback).build()?;
        Ok(Self { direct, proxied: builder().build()? })
    }

    /// Starts a GET request to an address validated by [`address`].
    pub(crate) fn get(&self, url: &Url) -> RequestBuilder {
        self.of(url).get(url.clone())
    }

    /// As [`Self::get`].
    pub(crate) fn post(&self, url: &Url) -> RequestBuilder {
        self.of(url).post(url.clone())
    }

    /// The client for an address.
    pub(crate) fn of(&self, url: &Url) -> &reqwest::Client {
        if url.scheme() == "http" { &self.direct } else { &self.proxied }
    }
}

/// Parses and validates an address: `https`, or `http` on a loopback address.
///
/// # Errors
/// A description that contains only the host, since the rest may be a secret.
pub(crate) fn address(text: &str) -> Result<Url, String> {
    let url: Url = text.parse().map_err(|error| format!("this is no address: {error}"))?;
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    let direct = host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    match url.scheme() {
        "https" => Ok(url),
        "http" if direct => Ok(url),
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
