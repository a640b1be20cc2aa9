//! A service within this process, for the duration of one command.

use crate::config::ServeConfig;
use crate::serve::run_until;
use anyhow::{Context, Result, anyhow};
use cager_formats::ScratchDir;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// The same service as `cager serve`, on a free port that only this machine reaches. Stopped and forgotten when dropped.
pub struct LocalService {
    address: String,
    stop: CancellationToken,
    running: Option<JoinHandle<Result<()>>>,
    // Removed last, or on a signal.
    _data: ScratchDir,
}

impl LocalService {
    /// Starts one that keeps its data in a temporary folder within `folder`.
    pub fn start(folder: &Path) -> Result<Self> {
        let data = ScratchDir::create(folder)?;
        let config = ServeConfig {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 0)),
            data: data.path().to_owned(),
            // One client, whom nothing has to be kept from.
            cache_bytes: u64::MAX,
            prepared_disk_bytes: u64::MAX,
            max_rest_bytes: 1 << 34,
            max_prepare_bytes: u64::MAX,
            drain_timeout_s: 1,
            ..ServeConfig::default()
        };
        let (stop, (listens, listening)) = (CancellationToken::new(), channel());
        let token = stop.clone();
        let serve = move || {
            let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().thread_name("serve").build()?;
            let outcome = runtime.block_on(run_until(config, token, |address| {
                // `start` waits for it.
                let _ = listens.send(address);
            }));
            runtime.shutdown_timeout(Duration::from_secs(2));
            outcome
        };
        let begun = data.undisturbed(|| {
            let running = std::thread::Builder::new().name("service".to_owned()).spawn(serve);
            running.map(|running| (running, listening.recv()))
        });
        let (running, listening) = begun.context("the service")?;
        let mut service = Self { address: String::new(), stop, running: Some(running), _data: data };
        match listening {
            Ok(address) => service.address = format!("http://{address}"),
            // It ended before it listened; how tells why.
            Err(_) => return Err(service.end().err().unwrap_or_else(|| anyhow!("the service did not start"))),
        }
        Ok(service)
    }

    /// Where it listens.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Stops it, and waits until it has ended.
    pub fn stop(mut self) -> Result<()> {
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        self.stop.cancel();
        match self.running.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(outcome)) => outcome,
            Some(Err(_)) => Err(anyhow!("the service broke down; please report this")),
        }
    }
}

impl Drop for LocalService {
    fn drop(&mut self) {
        // The error was reported already, or is secondary to the one that led here.
        let _ = self.end();
    }
}
