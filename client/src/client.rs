//! The client: one address, one token, one pool of connections.

use crate::address::Address;
use crate::backoff::Backoff;
use crate::body::json;
use crate::error::{ClientError, Failure};
use crate::options::ClientOptions;
use crate::problem::check;
use reqwest::header::{AUTHORIZATION, HeaderValue};
use reqwest::{Method, RequestBuilder, Response};
use serde::de::DeserializeOwned;
use std::error::Error as _;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use tokio::sync::OnceCell;

/// Longest wait for the answer that tells whether a server speaks HTTP/2.
const PROBE_PATIENCE: Duration = Duration::from_secs(5);

/// A client of one service. Clones share their connections.
///
/// Every call is tried again where that is safe and may help, see [`ClientOptions`]; only before the service has answered
/// for the first time, an address where nobody listens is an error at once.
#[derive(Clone)]
pub struct Client {
    shared: Arc<Shared>,
}

struct Shared {
    address: Address,
    token: Token,
    options: ClientOptions,
    http: OnceCell<reqwest::Client>,
    /// Whether the service has ever answered.
    reached: AtomicBool,
    /// Whether something in between was found to carry one direction at a time.
    one_way: AtomicBool,
}

#[derive(Clone)]
enum Token {
    None,
    Bearer(HeaderValue),
    /// What was given cannot be sent.
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

    /// Connects in this way, and with this patience.
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

    /// Whether connections carry both directions at once, as far as is known.
    pub(crate) fn is_live(&self) -> bool {
        !self.shared.one_way.load(Ordering::Relaxed)
    }

    /// From here on answers begin when the whole request has arrived.
    pub(crate) fn give_up_live(&self) {
        self.shared.one_way.store(true, Ordering::Relaxed);
    }

    pub(crate) fn backoff(&self) -> Backoff {
        Backoff::new(self.options().retries, self.options().max_backoff)
    }

    /// Runs `attempt` until it succeeds, fails for good, or the patience is spent.
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

    /// A small JSON answer, from a request that is safe to repeat.
    pub(crate) async fn fetch<T: DeserializeOwned>(
        &self,
        method: Method,
        segments: &[&str],
        query: &[(&str, String)],
    ) -> Result<T, ClientError> {
        self.retrying(|| async {
            let request = self.request(method.clone(), segments, query).await?;
            json(self, self.send(request).await?).await
        })
        .await
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

    /// Sends a small request and passes a success on.
    pub(crate) async fn send(&self, request: RequestBuilder) -> Result<Response, Failure> {
        self.send_counted(request, &AtomicU64::new(0)).await
    }

    /// Sends a request whose body adds its bytes to `sent`, and passes a success on.
    pub(crate) async fn send_counted(&self, request: RequestBuilder, sent: &AtomicU64) -> Result<Response, Failure> {
        self.accept(self.while_moving(sent, request.send()).await?).await
    }

    /// Passes a success on.
    pub(crate) async fn accept(&self, answer: reqwest::Result<Response>) -> Result<Response, Failure> {
        let response = answer.map_err(|error| self.network(&error))?;
        self.shared.reached.store(true, Ordering::Relaxed);
        check(response).await
    }

    /// Waits for something as long as `moved` changes at least once per idle time-out.
    pub(crate) async fn while_moving<T>(&self, moved: &AtomicU64, what: impl Future<Output = T>) -> Result<T, Failure> {
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

    /// Nothing moved for too long.
    pub(crate) fn stalled(&self) -> Failure {
        self.broken(format!("nothing moved for {:.0?}", self.options().idle_timeout))
    }

    /// The connection did not last.
    pub(crate) fn broken(&self, cause: impl Into<String>) -> Failure {
        let (address, cause) = (self.shared.address.to_string(), cause.into());
        Failure::transient(ClientError::Broken { address, cause })
    }

    /// What the network said.
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

    /// A server behind `http://` cannot be asked for its protocols, so HTTP/2 is tried on a small request: a proxy that
    /// knows only HTTP/1.1 must not need an option.
    async fn negotiate(&self) -> Result<reqwest::Client, Failure> {
        if self.shared.address.is_https() {
            return self.build(!self.options().http2, false);
        }
        if !self.options().http2 {
            return self.build(true, false);
        }
        let modern = self.build(false, true)?;
        let url = self.shared.address.join(&["healthz"], &[])?;
        let probe = |client: &reqwest::Client| client.get(url.clone()).timeout(PROBE_PATIENCE).send();
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
        // Fails where the program has chosen its own, which is as good.
        #[cfg(feature = "tls")]
        let _ = rustls::crypto::ring::default_provider().install_default();
        let options = self.options();
        let mut builder = reqwest::Client::builder()
            .user_agent(concat!("cager-client/", env!("CARGO_PKG_VERSION")))
            .connect_timeout(options.connect_timeout)
            .tcp_nodelay(true)
            .tcp_keepalive(Duration::from_secs(30))
            // A peer that vanished without a word is noticed on a busy connection before the idle time-out.
            .http2_keep_alive_interval(Duration::from_secs(20))
            .http2_keep_alive_timeout(Duration::from_secs(20))
            // A redirect would turn an upload into a GET, or carry the token elsewhere; its target is reported instead.
            .redirect(reqwest::redirect::Policy::none());
        if self.shared.address.is_loopback() {
            // A proxy's loopback is another machine's.
            builder = builder.no_proxy();
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

/// The cause of all causes: the layers above it repeat each other.
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
