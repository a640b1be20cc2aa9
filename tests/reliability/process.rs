//! A `cager serve` of its own: started, watched and killed.

use crate::database::Database;
use cager_client::{Client, ClientOptions};
use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Nothing takes this long unless it hangs.
pub(crate) const HANG: Duration = Duration::from_secs(20);

/// Where a service is reached, and with which token.
#[derive(Clone, Debug)]
pub(crate) struct Door {
    pub(crate) address: SocketAddr,
    pub(crate) token: Option<String>,
}

/// A running service; killed when dropped.
pub(crate) struct Server {
    child: Child,
    door: Door,
    /// From the start of the process until it said that it is ready.
    pub(crate) ready: Duration,
    /// Ends after it.
    _database: Option<Database>,
}

/// How a service is started.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    pub(crate) data: PathBuf,
    /// `127.0.0.1:0` for any free port.
    pub(crate) listen: SocketAddr,
    pub(crate) settings: Vec<String>,
    pub(crate) tokens: Option<PathBuf>,
    /// Where its catalogue is, unless that is in its folder.
    pub(crate) database: Option<Database>,
}

impl Setup {
    pub(crate) fn new(data: &Path, settings: &[&str]) -> Self {
        let listen = "127.0.0.1:0".parse().expect("an address");
        Self {
            data: data.to_owned(),
            listen,
            settings: settings.iter().map(|&s| s.to_owned()).collect(),
            tokens: None,
            database: Database::of_all(),
        }
    }

    pub(crate) async fn start(&self) -> Server {
        // The tests' client asks for it even where nothing is encrypted; another test of the process may have been first.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let clock = Instant::now();
        let mut command = Command::new(env!("CARGO_BIN_EXE_cager"));
        command.args(["serve", "--log-filter", "error", "--listen", &self.listen.to_string(), "--data"]);
        command.arg(&self.data);
        for setting in &self.settings {
            command.args(["--set", setting]);
        }
        if let Some(database) = &self.database {
            command.args(database.flags()).envs(database.environment());
        }
        if let Some(tokens) = &self.tokens {
            command.arg("--tokens").arg(tokens);
        }
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().expect("cager serve");
        let stdout = child.stdout.take().expect("its output");
        let line = tokio::task::spawn_blocking(move || {
            let mut line = String::new();
            BufReader::new(stdout).read_line(&mut line).map(|_| line)
        });
        let line = line.await.expect("a thread").expect("its first line");
        let address = line.trim().strip_prefix("listening on ").and_then(|a| a.parse().ok());
        let address: SocketAddr = address.unwrap_or_else(|| panic!("it said {line:?} instead of its address"));
        let door = Door { address, token: None };
        let mut server = Server { child, door, ready: Duration::ZERO, _database: self.database.clone() };
        while server.get("/readyz").await != Some(200) {
            assert!(clock.elapsed() < HANG, "it is not ready");
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        server.ready = clock.elapsed();
        server
    }
}

impl Deref for Server {
    type Target = Door;

    fn deref(&self) -> &Door {
        &self.door
    }
}

impl Door {
    pub(crate) fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    /// The status of a short request; `None` where nobody answers.
    pub(crate) async fn get(&self, path: &str) -> Option<u16> {
        let request = self.with_token(reqwest::Client::new().get(self.url(path)));
        Some(request.send().await.ok()?.status().as_u16())
    }

    pub(crate) fn with_token(&self, request: reqwest::RequestBuilder) -> reqwest::RequestBuilder {
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    /// A client that is patient enough for restarts and quick to come back.
    pub(crate) fn client(&self) -> Client {
        let quick = Duration::from_millis(100);
        let options = ClientOptions { retries: 200, max_backoff: quick, ..ClientOptions::default() };
        let client = Client::new(&format!("http://{}", self.address)).expect("an address").with_options(options);
        match &self.token {
            Some(token) => client.with_token(token),
            None => client,
        }
    }
}

impl Server {
    /// SIGKILL: it ends where it stands.
    pub(crate) fn kill(mut self) {
        self.child.kill().expect("it is running");
        self.child.wait().expect("its end");
    }

    fn proc(&self, file: &str) -> String {
        std::fs::read_to_string(format!("/proc/{}/{file}", self.child.id())).expect(file)
    }

    /// Memory in use, in MiB.
    pub(crate) fn rss(&self) -> f64 {
        self.memory("VmRSS:")
    }

    /// Most memory in use since the last [`Self::forget_peak`], in MiB.
    pub(crate) fn peak(&self) -> f64 {
        self.memory("VmHWM:")
    }

    /// Lets [`Self::peak`] begin anew.
    pub(crate) fn forget_peak(&self) {
        std::fs::write(format!("/proc/{}/clear_refs", self.child.id()), "5").expect("clear_refs");
    }

    fn memory(&self, field: &str) -> f64 {
        let status = self.proc("status");
        let line = status.lines().find_map(|line| line.strip_prefix(field)).expect(field);
        line.trim().trim_end_matches(" kB").parse::<f64>().expect("a number") / 1024.0
    }

    /// Bytes on disk of files that are open and have no name, in MiB.
    pub(crate) fn unnamed_files(&self) -> f64 {
        let open = std::fs::read_dir(format!("/proc/{}/fd", self.child.id())).expect("its files");
        let unnamed = open.flatten().filter(|file| {
            let target = std::fs::read_link(file.path()).unwrap_or_default();
            target.is_absolute() && target.to_string_lossy().ends_with(" (deleted)")
        });
        let bytes: u64 = unnamed.filter_map(|file| Some(std::fs::metadata(file.path()).ok()?.len())).sum();
        bytes as f64 / f64::from(1 << 20)
    }

    /// Processor time used so far; `stat` counts it in hundredths of a second.
    pub(crate) fn cpu(&self) -> Duration {
        let stat = self.proc("stat");
        let after_name: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
        let ticks: u64 = after_name[11..13].iter().map(|field| field.parse::<u64>().expect("ticks")).sum();
        Duration::from_millis(10 * ticks)
    }

    /// A number of `/metrics`.
    pub(crate) async fn metric(&self, name: &str) -> f64 {
        let text = reqwest::get(self.url("/metrics")).await.expect("metrics").text().await.expect("metrics");
        let value = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        value.unwrap_or_else(|| panic!("no {name} in\n{text}")).parse().expect("a number")
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have been killed already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
