//! The service within this process, on a disk that fails on demand.

use crate::capture::{Errors, Reference};
use crate::faults::{FaultyDisk, Loss};
use crate::gate::{Gate, GatedDisk};
use crate::process::{Door, HANG};
use cager_client::messages::{FrameResult, Problem, Session};
use cager_client::{Client, ClientOptions};
use cager_service::config::ServeConfig;
use cager_service::http::listen::serve;
use cager_service::http::{admin, router, seen, seen_by_operators, spare};
use cager_service::service::{Service, StartError};
use cager_service::store::{Disk, StoreError};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use tower::ServiceExt as _;

/// A running service.
pub(crate) struct Inside {
    folder: TempDir,
    pub(crate) disk: FaultyDisk,
    /// Holds all syncs up while it is closed.
    pub(crate) gate: Gate,
    running: Option<Running>,
    config: ServeConfig,
}

struct Running {
    address: SocketAddr,
    service: Weak<Service>,
    stop: CancellationToken,
    served: JoinHandle<std::io::Result<()>>,
}

/// The answer to an upload.
#[derive(Debug)]
pub(crate) struct Posted {
    pub(crate) status: u16,
    pub(crate) frames: BTreeMap<u32, Errors>,
    /// Instead of the records, or after them.
    pub(crate) problem: Option<Problem>,
}

impl Inside {
    pub(crate) async fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let data = folder.path().join("data");
        std::fs::create_dir(&data).expect("a folder");
        let disk = FaultyDisk::new(&data).expect("a disk");
        let config = ServeConfig { data, drain_timeout_s: 1, ..ServeConfig::default() };
        let mut inside = Self { folder, disk, gate: Gate::default(), running: None, config };
        inside.start().await;
        inside
    }

    async fn start(&mut self) {
        self.running = Some(start(self.config.clone(), Arc::new(GatedDisk::new(self.disk.clone(), &self.gate))).await);
    }

    fn running(&self) -> &Running {
        self.running.as_ref().expect("it runs")
    }

    /// As [`Self::restart`]; as soon as it has started, the gate is closed.
    pub(crate) async fn restart_slowly(&mut self, loss: Loss) {
        self.stop(loss).await;
        self.start().await;
        self.gate.close();
    }

    /// The process ends, or the power does, and the service starts again.
    pub(crate) async fn restart(&mut self, loss: Loss) {
        self.stop(loss).await;
        self.start().await;
    }

    async fn stop(&mut self, loss: Loss) {
        self.disk.stop();
        let Running { service, stop, served, .. } = self.running.take().expect("it runs");
        stop.cancel();
        timeout(HANG, served).await.expect("it stops").expect("a task").expect("serving");
        let clock = Instant::now();
        while service.strong_count() > 0 {
            assert!(clock.elapsed() < HANG, "the stopped service is still in use");
            sleep(Duration::from_millis(2)).await;
        }
        self.disk.restart(loss).expect("the disk");
    }

    pub(crate) fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.running().address)
    }

    pub(crate) async fn status(&self, path: &str) -> u16 {
        http().build().expect("a client").get(self.url(path)).send().await.expect("an answer").status().as_u16()
    }

    /// A client that tells every refusal.
    pub(crate) fn impatient(&self) -> Client {
        let options = ClientOptions { retries: 0, ..ClientOptions::default() };
        self.client().with_options(options)
    }

    pub(crate) fn client(&self) -> Client {
        Door { address: self.running().address, token: None }.client()
    }

    /// A session that takes frames.
    pub(crate) async fn ready(&self, reference: &Reference, name: &str) -> Session {
        let session = self.client().create(&reference.session(name, None)).await.expect("a session");
        self.client().wait_ready(&session.id, HANG).await.expect("a session that is ready")
    }

    pub(crate) async fn post(&self, id: &str, first: u32, body: Vec<u8>) -> Posted {
        post(self.url(&format!("/v1/sessions/{id}/frames?first={first}")), body).await
    }

    /// Bytes that the service counts against the quota of its only tenant.
    pub(crate) async fn counted_bytes(&self) -> u64 {
        let service = self.running().service.upgrade().expect("it runs");
        let request = http::Request::get("/admin/tenants").header("host", "localhost").body(axum::body::Body::empty());
        let routes = admin(Arc::clone(&service), seen_by_operators(service), true);
        let answer = routes.oneshot(request.expect("a request")).await.expect("an answer");
        let body = axum::body::to_bytes(answer.into_body(), 1 << 20).await.expect("a body");
        let tenants: Vec<serde_json::Value> = serde_json::from_slice(&body).expect("tenants");
        tenants.iter().filter_map(|tenant| tenant["stored_bytes"].as_u64()).sum()
    }

    pub(crate) fn folder(&self, name: &str) -> PathBuf {
        self.folder.path().join("data").join(name)
    }

    /// Names in a folder of the store.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder(folder)).expect(folder);
        entries.map(|entry| entry.expect(folder).file_name().to_string_lossy().into_owned()).collect()
    }

    /// All that was answered is there to the bit.
    pub(crate) async fn check(&self, reference: &Reference, id: &str, answered: &BTreeMap<u32, Errors>) {
        let client = self.client();
        client.wait_ready(id, HANG).await.expect("the session is there");
        let told: BTreeMap<u32, Errors> =
            client.errors(id).await.expect("errors").iter().map(|r| (r.frame, errors(r))).collect();
        for (frame, errors) in answered {
            assert_eq!(told.get(frame), Some(errors), "frame {frame} of {id}");
            assert_eq!(*errors, reference.errors[*frame as usize], "frame {frame}");
        }
        for frame in told.keys() {
            let cage = client.cages(id, *frame, 1).await.expect("a cage").remove(0);
            assert_eq!(cage.values, reference.cages[*frame as usize], "frame {frame} of {id}");
        }
    }

    /// Uploads what is missing and completes; the container is that of this process.
    pub(crate) async fn finish(&self, reference: &Reference, session: &Session) {
        let client = self.client();
        let frames = cager_client::MemoryFrames::new(reference.points, reference.frames.concat());
        let uploaded = client.upload(session, frames, Default::default()).await.expect("an upload");
        assert_eq!(uploaded.frames, reference.count());
        client.complete(&session.id, reference.count()).await.expect("a completion");
        self.check_container(reference, &session.id).await;
    }

    pub(crate) async fn check_container(&self, reference: &Reference, id: &str) {
        let mut container = Vec::new();
        self.client().download(id, &mut container).await.expect("the container");
        assert!(container == reference.container, "the container of {id} is another");
    }
}

async fn start(config: ServeConfig, disk: Arc<dyn Disk>) -> Running {
    let stop = CancellationToken::new();
    let limits = config.limits();
    let clock = Instant::now();
    let service = loop {
        match Service::start(config.clone(), Arc::clone(&disk), stop.clone()) {
            // Threads of the one before let go of the folder a moment later.
            Err(StartError::Store(StoreError::Locked { .. })) if clock.elapsed() < HANG => {
                sleep(Duration::from_millis(2)).await;
            }
            started => break started.expect("a service"),
        }
    };
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("an address");
    let (app, spare) = (router(Arc::clone(&service)), spare(seen(Arc::clone(&service))));
    let served = tokio::spawn(serve(listener, app, spare, limits, None, stop.clone()));
    Running { address, service: Arc::downgrade(&service), stop, served }
}

pub(crate) fn errors(result: &FrameResult) -> Errors {
    let bits = |x: Option<f32>| x.expect("it was measured").to_bits();
    Errors { l2: bits(result.l2), linf: bits(result.linf) }
}

/// A client to be made, in a process that knows how to encrypt: reqwest asks for it even where nothing is encrypted.
pub(crate) fn http() -> reqwest::ClientBuilder {
    // Another test of the process may have been first.
    let _ = rustls::crypto::ring::default_provider().install_default();
    reqwest::Client::builder()
}

/// Posts raw frames and takes the answer apart.
pub(crate) async fn post(url: String, body: Vec<u8>) -> Posted {
    let request =
        http().build().expect("a client").post(url).header("content-type", "application/octet-stream").body(body);
    let answer = timeout(HANG, request.send()).await.expect("an answer in time").expect("an answer");
    let status = answer.status().as_u16();
    // An answer that is cut off counts as far as it came.
    let text = timeout(HANG, answer.text()).await.expect("the answer ends").unwrap_or_default();
    let mut posted = Posted { status, frames: BTreeMap::new(), problem: None };
    if status != 200 {
        posted.problem = Some(serde_json::from_str(&text).unwrap_or_else(|e| panic!("{status}: {e}: {text}")));
        return posted;
    }
    for line in text.lines() {
        assert!(posted.problem.is_none(), "a line follows the problem: {text}");
        // A problem may name a frame, too.
        if let Ok(problem) = serde_json::from_str(line) {
            posted.problem = Some(problem);
            continue;
        }
        let result: FrameResult = serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"));
        posted.frames.insert(result.frame, errors(&result));
    }
    posted
}
