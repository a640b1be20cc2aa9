//! The service within this process, on a socket, with designs that take as long as a test wants.

use super::Api;
use cager_cages::{Design, DesignError, Progress};
use cager_geometry::mesh::{TriMesh, bounds};
use cager_service::cage_job::Designer;
use cager_service::config::ServeConfig;
use cager_service::http::listen::serve;
use cager_service::http::{router, seen, spare};
use cager_service::service::Service;
use cager_service::store::LocalDisk;
use std::ops::{ControlFlow, Deref};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Designs that go on until they are let go or told to stop.
#[derive(Default)]
pub(crate) struct SlowDesigns {
    released: AtomicBool,
    pub(crate) begun: AtomicUsize,
    pub(crate) running: AtomicUsize,
    /// Frames that each was given.
    pub(crate) frames: Mutex<Vec<usize>>,
}

impl SlowDesigns {
    pub(crate) fn release(&self) {
        self.released.store(true, SeqCst);
    }

    fn designer(self: &Arc<Self>) -> Arc<Designer> {
        let slow = Arc::clone(self);
        Arc::new(move |rest, frames, _, watch| {
            slow.begun.fetch_add(1, SeqCst);
            slow.running.fetch_add(1, SeqCst);
            slow.frames.lock().expect("a list").push(frames.len());
            let cage = around(&rest.points);
            let (mut better, mut step, mut outcome) = (Some(&cage), 0, Ok(()));
            while !slow.released.load(SeqCst) {
                step += 1;
                let (fraction, error) = (1.0 - 1.0 / f64::from(step), Some(1.0 / f64::from(step)));
                if watch(Progress { stage: "descent", fraction, error, better: better.take() })
                    == ControlFlow::Break(())
                {
                    outcome = Err(DesignError::Stopped);
                    break;
                }
                std::thread::sleep(Duration::from_millis(20));
            }
            slow.running.fetch_sub(1, SeqCst);
            outcome?;
            Ok(Design {
                cage,
                carriers: Vec::new(),
                stages: Vec::new(),
                unseen: None,
                timed_out: false,
                missed: false,
                warnings: vec!["slow".to_owned()],
            })
        })
    }
}

/// A box, made at once.
fn around(points: &[[f64; 3]]) -> TriMesh {
    let (low, high) = bounds(points);
    let corner = |i: usize| std::array::from_fn(|k| if i >> k & 1 == 0 { low[k] - 0.1 } else { high[k] + 0.1 });
    let quads: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    TriMesh { vertices: (0..8).map(corner).collect(), triangles }
}

/// A running service. Dropped it stops.
pub(crate) struct Inside {
    api: Api,
    folder: Arc<TempDir>,
    stop: CancellationToken,
    served: Option<JoinHandle<std::io::Result<()>>>,
}

impl Deref for Inside {
    type Target = Api;

    fn deref(&self) -> &Api {
        &self.api
    }
}

impl Inside {
    pub(crate) async fn start(slow: &Arc<SlowDesigns>, settings: impl FnOnce(&mut ServeConfig)) -> Self {
        Self::start_in(Arc::new(super::folder()), slow, settings).await
    }

    async fn start_in(folder: Arc<TempDir>, slow: &Arc<SlowDesigns>, settings: impl FnOnce(&mut ServeConfig)) -> Self {
        let mut config = ServeConfig { data: folder.path().join("data"), drain_timeout_s: 1, ..ServeConfig::default() };
        settings(&mut config);
        let stop = CancellationToken::new();
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let limits = config.limits();
        let service = Service::start_with(config, Arc::new(LocalDisk), slow.designer(), stop.clone());
        let service = service.expect("the service starts");
        let routes = (router(Arc::clone(&service)), spare(seen(service)));
        let served = tokio::spawn(serve(listener, routes.0, routes.1, limits, None, stop.clone()));
        Self { api: Api::new(address, None, false), folder, stop, served: Some(served) }
    }

    /// Stops it and starts another on the same folder.
    pub(crate) async fn again(mut self, slow: &Arc<SlowDesigns>) -> Self {
        self.stop.cancel();
        if let Some(served) = self.served.take() {
            served.await.expect("it ends").expect("it ends well");
        }
        // The lock of the folder goes with the last of what ran.
        let lock = self.folder.path().join("data/lock");
        super::eventually("the folder is free", async || {
            let file = std::fs::File::open(&lock).expect("a lock");
            file.try_lock().ok()
        })
        .await;
        Self::start_in(Arc::clone(&self.folder), slow, |_| ()).await
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        self.stop.cancel();
    }
}
