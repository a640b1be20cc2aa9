//! The client: one address, one token, one pool of connections.

use crate::address::Address;
use crate::backoff::Backoff;
use crate::error::{ClientError, Failure};
use crate::options::ClientOptions;
use crate::problem::check;
use reqwest::header::{AUTHORIZATION, HeaderValue};
use reqwest::{Method, RequestBuilder, Response};
use std::error::Error as _;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use tokio::sync::OnceCell;

/// Longest wait for the answer to a request that has been sent and is worked on.
const WORK_TIMEOUT: Duration = Duration::from_secs(3600);

/// Timeout of the request that detects HTTP/2.
const PROBE_TIMEOUT: Duration = Duration::from_secs(5);

/// A client of one service. Clones share their connections.
///
/// Every call is retried where that is safe and useful, see [`ClientOptions`]. Before the first response, a refused connection is an error
/// at once.
#[derive(Clone)]
pub struct Client {
    shared: Arc<Shared>,
}

struct Shared {
    address: Address,
    token: Token,
    options: ClientOptions,
    http: OnceCell<reqwest::Client>,
    /// Whether the service has ever responded.
    reached: AtomicBool,
    /// Whether a proxy was found that does not carry both directions at once.
    one_way: AtomicBool,
}

#[derive(Clone)]
enum Token {
    None,
    Bearer(HeaderValue),
    /// Contains characters that a header cannot have.
    Unusable,
}

impl std::fmt::Debug for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client")
            .field("address", &self.shared.address.to_string())
            .field("token", &if matches!(self.shared.token, Token::None) { "none" } else { "given" })
            .field("options", &self.shared.options)
            .finish()
    }
}

impl Client {
    /// A client of the service at `address`: `http://host:port`, perhaps with a prefix; `https://` with the feature `tls`.
    /// Nothing is sent yet.
    ///
    /// # Errors
    /// [`ClientError::Address`].
    pub fn new(address: &str) -> Result<Self, ClientError> {
        Ok(Self::assemble(Address::parse(address)?, Token::None, ClientOptions::default()))
    }

    /// Sends this bearer token with every request; white space around it is left out.
    #[must_use]
    pub fn with_token(self, token: &str) -> Self {
        let token = match HeaderValue::try_from(format!("Bearer {}", token.trim())) {
            Ok(mut value) => {
                value.set_sensitive(true);
                Token::Bearer(value)
            }
            Err(_) => Token::Unusable,
        };
        Self::assemble(self.shared.address.clone(), token, self.shared.options.clone())
    }

    /// Replaces the options.
    #[must_use]
    pub fn with_options(self, options: ClientOptions) -> Self {
        Self::assemble(self.shared.address.clone(), self.shared.token.clone(), options)
    }

    fn assemble(address: Address, token: Token, options: ClientOptions) -> Self {
        let (http, reached, one_way) = (OnceCell::new(), AtomicBool::new(false), AtomicBool::new(false));
        Self { shared: Arc::new(Shared { address, token, options, http, reached, one_way }) }
    }

    pub(crate) fn options(&self) -> &ClientOptions {
        &self.shared.options
    }

    /// Whether full-duplex requests are assumed to work.
    pub(crate) fn is_live(&self) -> bool {
        !self.shared.one_way.load(Ordering::Relaxed)
    }

    /// Stops using full-duplex requests.
    pub(crate) fn disable_live(&self) {
        self.shared.one_way.store(true, Ordering::Relaxed);
    }

    pub(crate) fn backoff(&self) -> Backoff {
        Backoff::new(self.options().retries, self.options().max_backoff)
    }

    /// Runs `attempt` until it succeeds, fails permanently, or the retries are exhausted.
    pub(crate) async fn retrying<T, F: Future<Output = Result<T, Failure>>>(
        &self,
        mut attempt: impl FnMut() -> F,
    ) -> Result<T, ClientError> {
        let mut backoff = self.backoff();
        loop {
            match attempt().await {
                Ok(value) => return Ok(value),
                Err(failure) => backoff.wait_after(failure).await?,
            }
        }
    }

    /// A request to a resource, with the token.
    pub(crate) async fn request(
        &self,
        method: Method,
        segments: &[&str],
        query: &[(&str, String)],
    ) -> Result<RequestBuilder, Failure> {
        let url = self.shared.address.join(segments, query)?;
        let request = self.http().await?.request(method, url);
        match &self.shared.token {
            Token::None => Ok(request),
            Token::Bearer(value) => Ok(request.header(AUTHORIZATION, value.clone())),
            Token::Unusable => Err(ClientError::Mismatch(
                "the token has characters that cannot be sent; give it as it was handed out".to_owned(),
            )
            .into()),
        }
    }

    /// Sends a small request; a response other than 2xx is a failure.
    pub(crate) async fn send(&self, request: RequestBuilder) -> Result<Response, Failure> {
        self.send_counted(request, &AtomicU64::new(0)).await
    }

    /// Sends a request whose body counts its bytes in `sent`; a response other than 2xx is a failure.
    pub(crate) async fn send_counted(&self, request: RequestBuilder, sent: &AtomicU64) -> Result<Response, Failure> {
        self.accept(self.with_idle_timeout(sent, request.send()).await?).await
    }

    /// As [`Self::send_counted`], of a body of `bytes` bytes whose answer takes as long as work on it: once it is sent, an answer may take
    /// an hour.
    pub(crate) async fn send_for_work(
        &self,
        request: RequestBuilder,
        sent: &AtomicU64,
        bytes: u64,
    ) -> Result<Response, Failure> {
        let mut answer = pin!(request.send());
        let (mut before, mut working) = (0, Duration::ZERO);
        loop {
            if let Ok(answer) = tokio::time::timeout(self.options().idle_timeout, &mut answer).await {
                return self.accept(answer).await;
            }
            let now = sent.load(Ordering::Relaxed);
            if now >= bytes {
                working += self.options().idle_timeout;
            }
            if (now == before && now < bytes) || working >= WORK_TIMEOUT {
                return Err(self.stalled());
            }
            before = now;
        }
    }

    /// Converts a network error or a response other than 2xx into a failure.
    pub(crate) async fn accept(&self, answer: reqwest::Result<Response>) -> Result<Response, Failure> {
        let response = answer.map_err(|error| self.network(&error))?;
        self.shared.reached.store(true, Ordering::Relaxed);
        check(response).await
    }

    /// Awaits `what` as long as `moved` changes at least once per idle time-out.
    pub(crate) async fn with_idle_timeout<T>(
        &self,
        moved: &AtomicU64,
        what: impl Future<Output = T>,
    ) -> Result<T, Failure> {
        let mut what = pin!(what);
        let mut before = moved.load(Ordering::Relaxed);
        loop {
            if let Ok(value) = tokio::time::timeout(self.options().idle_timeout, &mut what).await {
                return Ok(value);
            }
            let now = moved.load(Ordering::Relaxed);
            if now == before {
                return Err(self.stalled());
            }
            before = now;
        }
    }

    /// The failure after an idle time-out.
    pub(crate) fn stalled(&self) -> Failure {
        self.broken(format!("nothing moved for {:.0?}", self.options().idle_timeout))
    }

    /// The failure of a broken connection.
    pub(crate) fn broken(&self, cause: impl Into<String>) -> Failure {
        let (address, cause) = (self.shared.address.to_string(), cause.into());
        Failure::transient(ClientError::Broken { address, cause })
    }

    /// Classifies a network error.
    pub(crate) fn network(&self, error: &reqwest::Error) -> Failure {
        let cause =
            if error.is_timeout() && !error.is_connect() { "no answer in time".to_owned() } else { innermost(error) };
        if error.is_builder() {
            return Failure::protocol(cause);
        }
        if !error.is_connect() {
            return self.broken(cause);
        }
        let error = ClientError::Connect { address: self.shared.address.to_string(), cause };
        if self.shared.reached.load(Ordering::Relaxed) { Failure::transient(error) } else { Failure::Final(error) }
    }

    async fn http(&self) -> Result<&reqwest::Client, Failure> {
        self.shared.http.get_or_try_init(|| self.negotiate()).await
    }

    /// A server behind `http://` cannot negotiate, so HTTP/2 with prior knowledge is tried on a small request first: proxies that speak
    /// only HTTP/1.1 then need no option.
    async fn negotiate(&self) -> Result<reqwest::Client, Failure> {
        if self.shared.address.is_https() {
            return self.build(!self.options().http2, false);
        }
        if !self.options().http2 {
            return self.build(true, false);
        }
        let modern = self.build(false, true)?;
        let url = self.shared.address.join(&["healthz"], &[])?;
        let probe = |client: &reqwest::Client| client.get(url.clone()).timeout(PROBE_TIMEOUT).send();
        let Err(refused) = probe(&modern).await else { return Ok(modern) };
        if refused.is_connect() && refused.source().is_some_and(|cause| !innermost(cause).contains("http2")) {
            return Err(self.network(&refused));
        }
        let old = self.build(true, false)?;
        match probe(&old).await {
            Ok(_) => Ok(old),
            Err(_) => Err(self.network(&refused)),
        }
    }

    fn build(&self, only_http1: bool, only_http2: bool) -> Result<reqwest::Client, Failure> {
        // Fails if the program has installed another provider, which serves as well.
        #[cfg(feature = "tls")]
        let _ = rustls::crypto::ring::default_provider().install_default();
        let options = self.options();
        let mut builder = reqwest::Client::builder()
            .user_agent(concat!("cager-client/", env!("CARGO_PKG_VERSION")))
            .connect_timeout(options.connect_timeout)
            .tcp_nodelay(true)
            .tcp_keepalive(Duration::from_secs(30))
            // Detects a vanished peer on a busy connection before the idle time-out.
            .http2_keep_alive_interval(Duration::from_secs(20))
            .http2_keep_alive_timeout(Duration::from_secs(20))
            // A redirect would turn an upload into a GET, or carry the token elsewhere; its target is reported instead.
            .redirect(reqwest::redirect::Policy::none());
        if self.shared.address.is_loopback() {
            // A proxy's loopback address is not this machine.
            builder = builder.no_proxy();
        }
        #[cfg(feature = "tls")]
        if !self.shared.address.is_https() {
            // Nothing is encrypted, so that no authority has to be trusted, and none need be installed.
            builder = builder.tls_certs_only([]);
        }
        if only_http1 {
            builder = builder.http1_only();
        }
        if only_http2 {
            builder = builder.http2_prior_knowledge();
        }
        builder.build().map_err(|error| {
            let (address, what) = (self.shared.address.to_string(), innermost(&error));
            Failure::Final(ClientError::Address { address, what })
        })
    }
}

/// The root cause of an error; the outer ones repeat it.
fn innermost(error: &dyn std::error::Error) -> String {
    let mut innermost = error;
    while let Some(cause) = innermost.source() {
        innermost = cause;
    }
    innermost.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_never_shows() {
        let client = Client::new("http://h").expect("an address").with_token("  very-secret\n");
        let shown = format!("{client:?}");
        assert!(shown.contains("given") && !shown.contains("very-secret"), "{shown}");
    }

    #[tokio::test]
    async fn a_token_that_cannot_be_sent_is_an_error_that_does_not_repeat_it() {
        let options = ClientOptions { http2: false, ..ClientOptions::default() };
        let client = Client::new("http://127.0.0.1:9").expect("an address").with_options(options).with_token("a\u{7}b");
        let failure = client.request(Method::GET, &["v1"], &[]).await.expect_err("unusable");
        let Failure::Final(error @ ClientError::Mismatch(_)) = failure else { panic!("{failure:?}") };
        assert!(!error.to_string().contains("a\u{7}b"));
    }

    #[tokio::test]
    async fn an_address_where_nobody_listens_is_an_error_at_once() {
        let place =
            tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a port").local_addr().expect("an address");
        let client = Client::new(&format!("http://{place}")).expect("an address");
        let clock = std::time::Instant::now();
        let error = client.session("s").await.expect_err("nobody is there");
        assert!(matches!(error, ClientError::Connect { .. }), "{error}");
        assert!(clock.elapsed() < Duration::from_secs(3));
    }
}
