//! HTTP client for outgoing requests to addresses that the operator configured: TLS is required except on loopback addresses.

use reqwest::{RequestBuilder, Url, redirect};
use std::error::Error;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Longest time for one request, its answer included.
const TIMEOUT: Duration = Duration::from_secs(10);

/// An HTTP client that follows no redirects, so that a response cannot send it to an address behind the firewall. Loopback addresses bypass
/// proxies.
#[derive(Clone, Debug)]
pub(crate) struct Client {
    direct: reqwest::Client,
    /// Built at the first address with TLS: a machine that asks none needs no certificates of authorities.
    proxied: Arc<OnceLock<Result<reqwest::Client, NoClient>>>,
}

/// Why nothing can be asked.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum NoClient {
    /// The library refuses.
    #[error("requests cannot be sent: {0}")]
    Setup(String),
    /// No certificates of authorities.
    #[error(
        "an address with https:// needs the certificates of the authorities that this machine trusts, and they cannot be loaded ({0}); install them (the package ca-certificates of most systems), or name a file of them in the variable SSL_CERT_FILE"
    )]
    Authorities(String),
}

impl Client {
    /// # Errors
    /// [`NoClient::Setup`].
    pub(crate) fn new() -> Result<Self, NoClient> {
        let loopback = [SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), SocketAddr::from((Ipv6Addr::LOCALHOST, 0))];
        let direct = builder().no_proxy().resolve_to_addrs("localhost", &loopback);
        // Nothing is encrypted here, so that no authority has to be trusted.
        let direct = direct.tls_certs_only([]).build().map_err(|error| NoClient::Setup(innermost(&error)))?;
        Ok(Self { direct, proxied: Arc::default() })
    }

    /// Starts a GET request to an address validated by [`address`].
    ///
    /// # Errors
    /// As [`Self::of`].
    pub(crate) fn get(&self, url: &Url) -> Result<RequestBuilder, NoClient> {
        Ok(self.of(url)?.get(url.clone()))
    }

    /// As [`Self::get`].
    ///
    /// # Errors
    /// As [`Self::of`].
    pub(crate) fn post(&self, url: &Url) -> Result<RequestBuilder, NoClient> {
        Ok(self.of(url)?.post(url.clone()))
    }

    /// The client for an address.
    ///
    /// # Errors
    /// [`NoClient::Authorities`] for an address with TLS.
    pub(crate) fn of(&self, url: &Url) -> Result<&reqwest::Client, NoClient> {
        if url.scheme() == "http" {
            return Ok(&self.direct);
        }
        let build = || builder().build().map_err(|error| NoClient::Authorities(innermost(&error)));
        self.proxied.get_or_init(build).as_ref().map_err(Clone::clone)
    }
}

fn builder() -> reqwest::ClientBuilder {
    // Fails if the process has installed another provider, which serves as well.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let agent = concat!("cager/", env!("CARGO_PKG_VERSION"));
    reqwest::Client::builder().timeout(TIMEOUT).redirect(redirect::Policy::none()).user_agent(agent)
}

/// The root cause of an error; the outer ones say less.
fn innermost(error: &dyn Error) -> String {
    std::iter::successors(Some(error), |&error| error.source()).last().map(ToString::to_string).unwrap_or_default()
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
