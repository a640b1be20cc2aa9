//! TLS: certificate and key from PEM files, reloaded when they change.

use crate::sync::lock;
use rustls::ServerConfig;
use rustls::crypto::{CryptoProvider, ring};
use rustls::pki_types::pem::{self, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

/// Shortest interval between checks of the files, made when connections arrive.
const POLL_INTERVAL: Duration = Duration::from_secs(2);

/// Where certificate and key are.
#[derive(Clone, Debug)]
pub struct Tls {
    /// PEM file: the certificate, then those it is signed with.
    pub certificate: PathBuf,
    /// PEM file: the private key.
    pub key: PathBuf,
}

/// Why TLS cannot be set up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TlsError {
    /// A file cannot be read or has not what it should.
    #[error("{}: {why}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What is wrong and what to do.
        why: String,
    },
    /// The protocol library refused the whole.
    #[error("TLS cannot be set up: {0}")]
    Setup(#[from] rustls::Error),
}

/// Reads certificate and key. Later changes of the files are noticed and used for new connections; a broken change is
/// logged and the old certificate stays.
///
/// # Errors
/// A file that is missing or has no certificate or key, and a key that belongs to another certificate.
pub fn tls_config(tls: &Tls) -> Result<Arc<ServerConfig>, TlsError> {
    let provider = Arc::new(ring::default_provider());
    let stamp = stamp(tls);
    let loaded = Loaded { key: Arc::new(load(tls, &provider)?), stamp, looked: Instant::now() };
    let certificate = Certificate { files: tls.clone(), provider: Arc::clone(&provider), loaded: Mutex::new(loaded) };
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()?
        .with_no_client_auth()
        .with_cert_resolver(Arc::new(certificate));
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    Ok(Arc::new(config))
}

fn load(tls: &Tls, provider: &CryptoProvider) -> Result<CertifiedKey, TlsError> {
    let refuse = |file: &Path, why: String| TlsError::File { file: file.to_owned(), why };
    let wrong = |file: &Path, wanted: &str, error: pem::Error| match error {
        pem::Error::Io(error) => refuse(file, format!("cannot be read: {error}")),
        pem::Error::NoItemsFound => refuse(file, format!("has no {wanted}; give a PEM file that has one")),
        error => refuse(file, format!("is not a PEM file with a {wanted}: {error}")),
    };
    let certificates: Vec<_> = CertificateDer::pem_file_iter(&tls.certificate)
        .and_then(Iterator::collect)
        .map_err(|error| wrong(&tls.certificate, "certificate", error))?;
    if certificates.is_empty() {
        return Err(wrong(&tls.certificate, "certificate", pem::Error::NoItemsFound));
    }
    let key = PrivateKeyDer::from_pem_file(&tls.key).map_err(|error| wrong(&tls.key, "private key", error))?;
    CertifiedKey::from_der(certificates, key, provider).map_err(|error| {
        let certificate = tls.certificate.display();
        refuse(&tls.key, format!("cannot be used with {certificate}: {error}; give the key that belongs to it"))
    })
}

/// Modification time and length of both files.
type Stamp = [Option<(SystemTime, u64)>; 2];

fn stamp(tls: &Tls) -> Stamp {
    [&tls.certificate, &tls.key].map(|file| {
        let metadata = std::fs::metadata(file).ok()?;
        Some((metadata.modified().ok()?, metadata.len()))
    })
}

/// The certificate of every connection.
#[derive(Debug)]
struct Certificate {
    files: Tls,
    provider: Arc<CryptoProvider>,
    loaded: Mutex<Loaded>,
}

#[derive(Debug)]
struct Loaded {
    key: Arc<CertifiedKey>,
    stamp: Stamp,
    looked: Instant,
}

impl ResolvesServerCert for Certificate {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        let mut loaded = lock(&self.loaded);
        if loaded.looked.elapsed() >= POLL_INTERVAL {
            loaded.looked = Instant::now();
            let stamp = stamp(&self.files);
            if stamp != loaded.stamp {
                loaded.stamp = stamp;
                match load(&self.files, &self.provider) {
                    Ok(key) => {
                        loaded.key = Arc::new(key);
                        tracing::info!(file = %self.files.certificate.display(), "certificate reloaded");
                    }
                    Err(error) => tracing::error!(%error, "certificate not reloaded; the old one stays"),
                }
            }
        }
        Some(Arc::clone(&loaded.key))
    }
}
