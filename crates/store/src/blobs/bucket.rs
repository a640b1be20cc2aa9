//! The bucket itself: an S3 service, or a folder that behaves as one. All calls block.

use super::BlobsError;
use bytes::Bytes;
use futures_util::StreamExt as _;
use futures_util::TryStreamExt as _;
use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey, Checksum};
use object_store::client::{HttpClient, HttpConnector};
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, ObjectStoreExt as _, RetryConfig, WriteMultipart};
use std::fs::File;
use std::future::Future;
use std::io::{self, Read as _};
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::runtime::{Builder, Handle, Runtime, RuntimeFlavor};
use tokio::task::block_in_place;
use tokio::time::timeout;

/// Bytes of a part: S3 wants 5 MiB at least, and 10,000 of them at most.
const PART: usize = 8 << 20;
/// Parts under way together.
const PARTS: usize = 2;
/// How long a connection may take, and the next bytes on one.
const CONNECT: Duration = Duration::from_secs(5);
/// A request with its bytes, 8 MiB at most, counts as silence.
const SILENCE: Duration = Duration::from_secs(20);
/// How long who looks whether a bucket is back waits for it.
const LOOK: Duration = Duration::from_secs(5);
/// Endpoints on this machine.
const LOCAL: [&str; 3] = ["127.0.0.1", "localhost", "[::1]"];
/// How long a request is tried again, so that clients are answered while they wait.
const RETRIES: usize = 3;
const RETRY: Duration = Duration::from_secs(10);

#[derive(Debug)]
pub(super) struct Bucket {
    store: Arc<dyn ObjectStore>,
    prefix: Path,
    pub(super) name: String,
    /// What was wrong when it was asked last, where it did not answer.
    away: Mutex<Option<BlobsError>>,
    /// Whether somebody tries if it answers again.
    is_tried: AtomicBool,
    /// Always there until it is dropped.
    runtime: Option<Runtime>,
}

impl Bucket {
    pub(super) fn check_address(url: &str, environment: &[(String, String)]) -> Result<(), BlobsError> {
        match url.strip_prefix("file://") {
            // It is made where it is missing.
            Some(folder) if folder.starts_with('/') => Ok(()),
            _ => place(url, environment, SILENCE).map(drop),
        }
    }

    pub(super) fn connect(url: &str, environment: &[(String, String)]) -> Result<Self, BlobsError> {
        Self::connect_within(url, environment, SILENCE)
    }

    /// As [`Self::connect`], where silence is taken for absence after so long.
    fn connect_within(url: &str, environment: &[(String, String)], silence: Duration) -> Result<Self, BlobsError> {
        let runtime = Builder::new_multi_thread().worker_threads(1).thread_name("blobs").enable_all().build();
        let runtime = runtime
            .map_err(|error| BlobsError::lasting(format!("no thread can be started for the bucket: {error}")))?;
        let (store, prefix) = place(url, environment, silence)?;
        Ok(Self {
            store,
            prefix,
            name: url.trim_end_matches('/').to_owned(),
            away: Mutex::default(),
            is_tried: AtomicBool::new(false),
            runtime: Some(runtime),
        })
    }

    fn path(&self, key: &str) -> Path {
        Path::from(format!("{}/{key}", self.prefix))
    }

    /// All keys with their bytes; only those in a folder where one is given.
    pub(super) fn list(&self, folder: &str) -> io::Result<Vec<(String, u64)>> {
        let prefix = Path::from(format!("{}/{folder}", self.prefix));
        let skipped = if self.prefix.as_ref().is_empty() { 0 } else { self.prefix.as_ref().len() + 1 };
        self.block_on(async {
            let keys = self
                .store
                .list(Some(&prefix))
                .map_ok(|object| (object.location.as_ref().get(skipped..).unwrap_or_default().to_owned(), object.size));
            keys.try_collect().await
        })
    }

    pub(super) fn put(&self, key: &str, bytes: Bytes) -> io::Result<()> {
        self.block_on(async { self.store.put(&self.path(key), bytes.into()).await.map(|_| ()) })
    }

    /// Sends a file. Nothing is there before all of it is.
    pub(super) fn put_file(&self, key: &str, file: &File) -> io::Result<u64> {
        let bytes = file.metadata()?.len();
        if bytes <= PART as u64 {
            let mut content = vec![0; bytes as usize];
            file.read_exact_at(&mut content, 0)?;
            self.put(key, content.into())?;
            return Ok(bytes);
        }
        // So that they are not more than may be.
        let part = PART.max((bytes / 9000) as usize);
        let upload = self.block_on(async { self.store.put_multipart(&self.path(key)).await })?;
        let mut upload = WriteMultipart::new_with_chunk_size(upload, part);
        let mut sent = || {
            let mut reader = file;
            let mut left = bytes;
            while left > 0 {
                let mut piece = vec![0; left.min(part as u64) as usize];
                reader.read_exact(&mut piece)?;
                left -= piece.len() as u64;
                self.block_on(async {
                    upload.wait_for_capacity(PARTS).await?;
                    upload.put(piece.into());
                    Ok(())
                })?;
            }
            Ok(())
        };
        match sent() {
            Ok(()) => self.block_on(async { upload.finish().await })?,
            Err(error) => {
                // Best effort: buckets forget unfinished uploads by a rule of their own.
                let _ = self.block_on(async { upload.abort().await });
                return Err(error);
            }
        };
        Ok(bytes)
    }

    /// Writes an object of this length into a file, from `offset` on.
    pub(super) fn get(&self, key: &str, bytes: u64, file: &File, offset: u64) -> io::Result<()> {
        let path = self.path(key);
        let ranges = (0..bytes).step_by(PART).map(|from| from..bytes.min(from + PART as u64));
        self.block_on(async {
            let fetch = |range: Range<u64>| {
                let path = &path;
                async move { Ok::<_, object_store::Error>((range.clone(), self.store.get_range(path, range).await?)) }
            };
            let mut parts = futures_util::stream::iter(ranges).map(fetch).buffered(PARTS);
            while let Some((range, part)) = parts.try_next().await? {
                if part.len() as u64 != range.end - range.start {
                    return Ok(Err(io::Error::other(BlobsError::lasting(format!(
                        "{}: {key} is shorter than it was",
                        self.name
                    )))));
                }
                if let Err(error) = file.write_all_at(&part, offset + range.start) {
                    return Ok(Err(error));
                }
            }
            Ok(Ok(()))
        })?
    }

    /// Removes objects, those that are not there any more too.
    pub(super) fn remove(&self, keys: &[String]) -> io::Result<()> {
        let paths: Vec<_> = keys.iter().map(|key| Ok(self.path(key))).collect();
        self.block_on(async {
            let mut removed = self.store.delete_stream(futures_util::stream::iter(paths).boxed());
            while let Some(outcome) = removed.next().await {
                match outcome {
                    Ok(_) | Err(object_store::Error::NotFound { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            Ok(())
        })
    }

    /// Gives an object another name too.
    pub(super) fn copy(&self, from: &str, to: &str) -> io::Result<()> {
        self.block_on(async { self.store.copy(&self.path(from), &self.path(to)).await })
    }

    /// Checks that it can be written to.
    pub(super) fn probe(&self) -> io::Result<()> {
        self.put("probe", Bytes::from_static(b"probe\n"))
    }

    /// Whether it answers, also where it takes no writes: what is refused is told by the work itself.
    async fn look(&self) -> Result<(), object_store::Error> {
        match self.store.head(&self.path("probe")).await {
            Err(error @ object_store::Error::Generic { .. }) => Err(error),
            _ => Ok(()),
        }
    }

    /// Where it has not answered, one caller at a time looks whether it does again; the others are told at once, so that they do not all wait.
    fn block_on<T>(&self, work: impl Future<Output = Result<T, object_store::Error>>) -> io::Result<T> {
        let Some(runtime) = &self.runtime else { return Err(io::ErrorKind::NotConnected.into()) };
        let known = lock(&self.away).clone();
        let tries = known.is_some();
        if let Some(error) = known.filter(|_| self.is_tried.swap(true, Ordering::SeqCst)) {
            return Err(io::Error::other(error));
        }
        let is_looking = AtomicBool::new(tries);
        let work = async {
            if tries {
                // Before much is sent.
                timeout(LOOK, self.look()).await.map_err(|_| silent())??;
                // Others read meanwhile, also where this is a write that takes long to fail.
                *lock(&self.away) = None;
                is_looking.store(false, Ordering::SeqCst);
                self.is_tried.store(false, Ordering::SeqCst);
            }
            work.await
        };
        let done = match Handle::try_current().map(|handle| handle.runtime_flavor()) {
            // Of asynchronous work, which goes on elsewhere meanwhile.
            Ok(RuntimeFlavor::MultiThread) => block_in_place(|| runtime.block_on(work)),
            _ => runtime.block_on(work),
        };
        let told = |error: &object_store::Error| BlobsError {
            what: format!("{}: {}", self.name, innermost(error)),
            is_away: matches!(error, object_store::Error::Generic { .. }),
        };
        *lock(&self.away) = match &done {
            Err(error @ object_store::Error::Generic { .. }) => Some(told(error)),
            _ => None,
        };
        if is_looking.into_inner() {
            self.is_tried.store(false, Ordering::SeqCst);
        }
        done.map_err(|error| io::Error::other(told(&error)))
    }
}

fn silent() -> object_store::Error {
    object_store::Error::Generic {
        store: "S3",
        source: "it does not answer; see whether it hangs or is overloaded".into(),
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Bucket {
    fn drop(&mut self) {
        // Wherever that happens: it does not wait.
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// The store at an address, and the path in it.
fn place(
    url: &str,
    environment: &[(String, String)],
    silence: Duration,
) -> Result<(Arc<dyn ObjectStore>, Path), BlobsError> {
    let refused = |what: &dyn std::fmt::Display| {
        // Keys may have been written into it.
        let url = url.rsplit_once('@').map_or(url, |(_, rest)| rest);
        BlobsError::lasting(format!("{url:?} is no place for files: {what}; give s3://bucket/path, or file:///folder"))
    };
    if let Some(folder) = url.strip_prefix("file://").filter(|folder| folder.starts_with('/')) {
        std::fs::create_dir_all(folder).map_err(|error| refused(&error))?;
        let store = LocalFileSystem::new_with_prefix(folder).map_err(|error| refused(&error))?;
        return Ok((Arc::new(store.with_fsync(true)), Path::default()));
    }
    let Some(rest) = url.strip_prefix("s3://") else { return Err(refused(&"it has another beginning")) };
    let (bucket, path) = rest.split_once('/').unwrap_or((rest, ""));
    if bucket.is_empty() || bucket.contains(['@', '?', ':']) {
        return Err(refused(
            &"keys and endpoints do not belong into it, but into the variables AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_ENDPOINT and AWS_REGION",
        ));
    }
    let path = Path::parse(path.trim_end_matches('/')).map_err(|error| refused(&error))?;
    let mut builder = AmazonS3Builder::new();
    let mut endpoint = None;
    for (name, value) in environment {
        let key = name.starts_with("AWS_").then(|| name.to_ascii_lowercase().parse::<AmazonS3ConfigKey>());
        let Some(Ok(key)) = key else { continue };
        if matches!(key, AmazonS3ConfigKey::Endpoint | AmazonS3ConfigKey::S3Endpoint) {
            endpoint = Some(value.as_str());
        }
        builder = builder.with_config(key, value);
    }
    let is_encrypted = endpoint.is_none_or(|endpoint| endpoint.starts_with("https://"));
    // What stays on this machine is read by nobody on the way.
    let is_local = endpoint.and_then(|endpoint| endpoint.strip_prefix("http://")).is_some_and(|rest| {
        let host = rest.split('/').next().unwrap_or_default();
        LOCAL.iter().any(|local| host.strip_prefix(local).is_some_and(|port| port.is_empty() || port.starts_with(':')))
    });
    let is_allowed = environment.iter().any(|(name, value)| name == "AWS_ALLOW_HTTP" && value == "true");
    if !is_encrypted && !is_local && !is_allowed {
        return Err(refused(&format!(
            "what is sent to {} could be read on the way; give an endpoint with https://, or set AWS_ALLOW_HTTP=true",
            endpoint.unwrap_or_default()
        )));
    }
    let builder = builder
        .with_bucket_name(bucket)
        .with_allow_http(true)
        .with_checksum_algorithm(Checksum::SHA256)
        .with_http_connector(Connector { is_encrypted, silence })
        .with_retry(RetryConfig {
            backoff: BackoffConfig {
                init_backoff: Duration::from_millis(50),
                max_backoff: Duration::from_secs(2),
                base: 2.0,
            },
            max_retries: RETRIES,
            retry_timeout: RETRY,
        });
    let store = builder.build().map_err(|error| refused(&innermost(&error)))?;
    Ok((Arc::new(store), path))
}

/// Connections with the cryptography of the rest of this program.
#[derive(Debug)]
struct Connector {
    is_encrypted: bool,
    silence: Duration,
}

impl HttpConnector for Connector {
    fn connect(&self, _options: &ClientOptions) -> object_store::Result<HttpClient> {
        // Fails if the process has installed another provider, which serves as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let builder = reqwest::Client::builder().connect_timeout(CONNECT).read_timeout(self.silence);
        // Where nothing is encrypted no authority has to be trusted.
        let builder = if self.is_encrypted { builder } else { builder.tls_certs_only([]) };
        let client = builder.redirect(reqwest::redirect::Policy::none()).build();
        let client = client.map_err(|error| object_store::Error::Generic { store: "S3", source: Box::new(error) })?;
        Ok(HttpClient::new(client))
    }
}

/// The root cause of an error; the outer ones have addresses and say less.
fn innermost(error: &dyn std::error::Error) -> String {
    std::iter::successors(Some(error), |&error| error.source()).last().map(ToString::to_string).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;
    use std::time::Instant;

    #[test]
    fn a_bucket_that_takes_no_writes_is_read_all_the_same() {
        let folder = tempfile::tempdir().expect("a folder");
        let bucket = Bucket::connect(&format!("file://{}", folder.path().display()), &[]).expect("an address");
        bucket.put("name", Bytes::from_static(b"bytes")).expect("put");
        // Where a file cannot replace it, and is not found.
        std::fs::create_dir_all(folder.path().join("probe/full")).expect("a folder");
        for _ in 0..2 {
            bucket.probe().expect_err("it takes no writes");
            assert!(lock(&bucket.away).is_some(), "it counts as away");
            let read = tempfile::tempfile().expect("a file");
            bucket.get("name", 5, &read, 0).expect("read");
            assert_eq!(read.metadata().expect("its length").len(), 5);
            assert!(lock(&bucket.away).is_none() && !bucket.is_tried.load(Ordering::SeqCst));
        }
    }

    #[test]
    fn a_bucket_that_hangs_is_given_up_and_others_are_told_at_once() {
        // The system takes connections, and nobody answers.
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let endpoint = format!("http://{}", listener.local_addr().expect("an address"));
        let environment = [("AWS_ENDPOINT", &endpoint[..]), ("AWS_ACCESS_KEY_ID", "a"), ("AWS_SECRET_ACCESS_KEY", "b")];
        let environment = environment.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let silence = Duration::from_millis(100);
        let bucket = Bucket::connect_within("s3://bucket/path", &environment, silence).expect("an address");
        let put = || bucket.put("name", Bytes::from_static(b"bytes")).expect_err("nobody answers");
        let clock = Instant::now();
        put();
        assert!(clock.elapsed() < LOOK, "{:?}", clock.elapsed());
        bucket.is_tried.store(true, Ordering::SeqCst);
        let clock = Instant::now();
        put();
        assert!(clock.elapsed() < silence, "who is not the first waits {:?}", clock.elapsed());
    }
}
