//! TLS.

use super::*;
use cager_service::http::listen::{Tls, tls_config};
use rustls::pki_types::CertificateDer;
use rustls::{ClientConfig, RootCertStore};
use std::path::Path;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;

/// A request of HTTP/2 for `/`: a header frame whose fields are all in the static table.
const GET: &[u8] = b"\x00\x00\x03\x01\x05\x00\x00\x00\x01\x82\x87\x84";

/// Writes a fresh certificate for localhost; gives it.
fn write_certificate(folder: &Path) -> (Tls, CertificateDer<'static>) {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let files = Tls { certificate: folder.join("certificate.pem"), key: folder.join("key.pem") };
    std::fs::write(&files.certificate, made.cert.pem()).unwrap();
    std::fs::write(&files.key, made.signing_key.serialize_pem()).unwrap();
    (files, made.cert.der().clone())
}

async fn connect(
    server: &Server,
    trusted: &CertificateDer<'static>,
    protocol: &str,
) -> std::io::Result<TlsStream<TcpStream>> {
    let mut roots = RootCertStore::empty();
    roots.add(trusted.clone()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let mut config = builder.with_root_certificates(roots).with_no_client_auth();
    config.alpn_protocols = vec![protocol.into()];
    let name = "localhost".try_into().unwrap();
    TlsConnector::from(Arc::new(config)).connect(name, server.connect().await).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn both_protocols_are_negotiated() {
    let folder = tempfile::tempdir().unwrap();
    let (files, certificate) = write_certificate(folder.path());
    let server = start_with(limits(), Some(tls_config(&files).unwrap())).await;

    let mut http1 = connect(&server, &certificate, "http/1.1").await.unwrap();
    assert_eq!(http1.get_ref().1.alpn_protocol(), Some(&b"http/1.1"[..]));
    for _ in 0..2 {
        assert!(ask(&mut http1, "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").await.ends_with("here"));
    }

    let mut http2 = connect(&server, &certificate, "h2").await.unwrap();
    assert_eq!(http2.get_ref().1.alpn_protocol(), Some(&b"h2"[..]));
    http2.write_all(HTTP2).await.unwrap();
    http2.write_all(GET).await.unwrap();
    let mut bytes = Vec::new();
    let answer = async {
        while !bytes.ends_with(b"here") {
            assert!(http2.read_buf(&mut bytes).await.unwrap() > 0, "closed after {bytes:?}");
        }
    };
    timeout(HANG, answer).await.expect("no answer");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_renewed_certificate_is_noticed_and_a_broken_one_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let (files, old) = write_certificate(folder.path());
    let server = start_with(limits(), Some(tls_config(&files).unwrap())).await;
    connect(&server, &old, "h2").await.unwrap();
    let (_, renewed) = write_certificate(folder.path());
    tokio::time::sleep(ms(2200)).await;
    connect(&server, &renewed, "h2").await.unwrap();
    assert!(connect(&server, &old, "h2").await.is_err(), "the old certificate is still in use");
    std::fs::write(&files.key, "nonsense").unwrap();
    tokio::time::sleep(ms(2200)).await;
    connect(&server, &renewed, "h2").await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_handshake_is_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let (files, _) = write_certificate(folder.path());
    let server = start_with(limits(), Some(tls_config(&files).unwrap())).await;
    let began = Instant::now();
    let mut stream = server.connect().await;
    // The beginning of a handshake record.
    stream.write_all(&[22, 3, 1, 2, 0, 1]).await.unwrap();
    read_to_close(&mut stream).await;
    assert_took(began.elapsed(), limits().header_timeout);
}

#[test]
fn errors_name_the_file_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let (files, _) = write_certificate(folder.path());
    let missing = Tls { certificate: folder.path().join("none.pem"), ..files.clone() };
    let text = tls_config(&missing).unwrap_err().to_string();
    assert!(text.contains("none.pem: cannot be read"), "{text}");
    let swapped = Tls { certificate: files.key.clone(), key: files.certificate.clone() };
    let text = tls_config(&swapped).unwrap_err().to_string();
    assert!(text.contains("key.pem: has no certificate; give"), "{text}");
    let other = tempfile::tempdir().unwrap();
    let (others, _) = write_certificate(other.path());
    let text = tls_config(&Tls { key: others.key, ..files }).unwrap_err().to_string();
    assert!(text.contains("give the key that belongs to it"), "{text}");
}
