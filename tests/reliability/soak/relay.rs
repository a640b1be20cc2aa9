//! What stands before several processes: connections go to one after the other, and are cut now and then.

use fastrand::Rng;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;

/// Of so many connections one is cut.
const CUT: u32 = 12;

pub(super) struct Relay {
    pub(super) address: SocketAddr,
    processes: Arc<Mutex<Vec<SocketAddr>>>,
}

impl Relay {
    pub(super) async fn start(processes: Vec<SocketAddr>, mut rng: Rng) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let processes = Arc::new(Mutex::new(processes));
        let known = Arc::clone(&processes);
        tokio::spawn(async move {
            let mut next = 0;
            while let Ok((client, _)) = listener.accept().await {
                next += 1;
                let (known, at) = (known.lock().unwrap().clone(), next);
                let life = (rng.u32(..CUT) == 0).then(|| Duration::from_millis(rng.u64(1..400)));
                tokio::spawn(relay(client, known, at, life.unwrap_or(Duration::from_secs(3600))));
            }
        });
        Self { address, processes }
    }

    /// One of the processes is elsewhere now.
    pub(super) fn moved(&self, which: usize, address: SocketAddr) {
        self.processes.lock().unwrap()[which] = address;
    }
}

/// Connects with the process whose turn it is, or the next one that answers.
async fn relay(mut client: TcpStream, processes: Vec<SocketAddr>, at: usize, life: Duration) {
    for k in 0..processes.len() {
        if let Ok(mut process) = TcpStream::connect(processes[(at + k) % processes.len()]).await {
            let _ = timeout(life, copy_bidirectional(&mut client, &mut process)).await;
            return;
        }
    }
}
