//! A service for one test.

use crate::support::{Dir, Small, as_model};
use cager_client::messages::Session;
use cager_client::{Client, ClientOptions, MeshFile, NewSession};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A running `cager serve`; dropped it is killed.
pub(crate) struct Server {
    process: Child,
    /// `127.0.0.1:` and the port.
    pub(crate) place: String,
}

impl Server {
    /// Serves from the folder `data` of `dir` on any free port.
    pub(crate) fn start(dir: &Dir) -> Self {
        Self::start_at(dir, "127.0.0.1:0", &[])
    }

    pub(crate) fn start_at(dir: &Dir, place: &str, more: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_cager"))
            .args(["serve", "--log-filter", "warn", "--listen", place, "--data"])
            .arg(dir.path("data"))
            .args(more)
            .current_dir(dir.path(""))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program runs");
        let mut line = String::new();
        BufReader::new(process.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
        let place = line.trim().strip_prefix("listening on ").expect("the address").to_owned();
        Self { process, place }
    }

    pub(crate) fn address(&self) -> String {
        format!("http://{}", self.place)
    }

    pub(crate) fn client(&self) -> Client {
        let options = ClientOptions { max_backoff: Duration::from_millis(500), ..ClientOptions::default() };
        Client::new(&self.address()).expect("an address").with_options(options)
    }

    /// As a power cut would end it, but for what the system still has to write.
    pub(crate) fn kill(&mut self) {
        self.process.kill().expect("it runs");
        self.process.wait().expect("it ends");
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A session of the small capture, ready for frames.
pub(crate) async fn ready(client: &Client, dir: &Dir) -> Session {
    let new = NewSession::new(
        MeshFile::new("rest.obj", dir.read("rest.obj")),
        MeshFile::new("cage.obj", dir.read("cage.obj")),
    );
    let session = client.create(&new).await.expect("a session");
    client.wait_ready(&session.id, Duration::from_secs(60)).await.expect("a ready session")
}

/// A folder with the rest pose and the cage, and frames in single precision.
pub(crate) fn capture() -> (Dir, usize, Vec<f32>) {
    let (dir, mut small) = (Dir::new(), Small::new());
    small.rest.colors = (0..small.rest.points.len()).map(|k| [k as u8, 100, 255]).collect();
    dir.model("rest.obj", &small.rest);
    dir.model("cage.obj", &as_model(&small.cage));
    dir.frames("frames.npy", &small.frames);
    let values = small.frames.iter().flatten().map(|&x| x as f32).collect();
    (dir, small.rest.points.len(), values)
}

/// The sessions of a service.
#[tokio::main(flavor = "current_thread")]
pub(crate) async fn sessions(server: &Server) -> Vec<Session> {
    server.client().sessions().await.expect("sessions")
}
