//! The service over HTTP, as its clients meet it.

mod listen;
mod openapi;

/// A client to be made, in a process that knows how to encrypt: reqwest asks for it even where nothing is encrypted.
fn client() -> reqwest::ClientBuilder {
    // Another test of the process may have been first.
    let _ = rustls::crypto::ring::default_provider().install_default();
    reqwest::Client::builder()
}
