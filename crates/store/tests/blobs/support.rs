//! A service of S3 of the test's own: SeaweedFS, which ends with the test.

use cager_store::{Blobs, BlobsError};
use std::fs::File;
use std::io::Write as _;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::{Duration, Instant};

/// The program, where it is not in `PATH`; `required` tells tests that there must be one.
const PROGRAM: &str = "CAGER_SEAWEEDFS";
const BUCKET: &str = "cager";
const KEY: &str = "tests";
const SECRET: &str = "secret-of-the-tests";

pub(crate) struct Server {
    program: PathBuf,
    folder: tempfile::TempDir,
    /// Of master, volumes, filer and S3, each with one for its own calls.
    ports: [u16; 8],
    process: Option<Child>,
}

#[allow(dead_code, reason = "each of those who share it uses a part")]
impl Server {
    /// A new one; `None`, which is said, where SeaweedFS is not installed and not required.
    pub(crate) fn start() -> Option<Self> {
        let said = std::env::var(PROGRAM).ok().filter(|said| !said.is_empty());
        let is_required = said.is_some();
        let program = PathBuf::from(said.filter(|said| said != "required").unwrap_or_else(|| "weed".to_owned()));
        let there = Command::new(&program).arg("version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !there.is_ok_and(|status| status.success()) {
            assert!(!is_required, "{PROGRAM} is set, and {} does not run", program.display());
            eprintln!("SeaweedFS is not installed, so that this tests nothing");
            return None;
        }
        let folder = tempfile::Builder::new().prefix("s3").tempdir().expect("a folder");
        let users = format!(
            r#"{{"identities":[{{"name":"tests","credentials":[{{"accessKey":"{KEY}","secretKey":"{SECRET}"}}],"actions":["Admin","Read","Write","List","Tagging"]}}]}}"#
        );
        std::fs::write(folder.path().join("users.json"), users).expect("a file");
        std::fs::create_dir(folder.path().join("data")).expect("a folder");
        let mut server = Self { program, folder, ports: free(), process: None };
        server.run();
        Some(server)
    }

    pub(crate) fn run(&mut self) {
        assert!(self.process.is_none(), "it runs");
        let path = |name: &str| self.folder.path().join(name).display().to_string();
        let [master, master_own, volume, volume_own, filer, filer_own, s3, s3_own] = self.ports;
        let log = File::options().create(true).append(true).open(path("log")).expect("a log");
        let mut command = Command::new(&self.program);
        command.arg("server").args(["-ip=127.0.0.1", "-ip.bind=127.0.0.1", "-filer", "-s3", "-metricsPort=0"]);
        command.args([
            "-master.volumeSizeLimitMB=64",
            "-volume.max=16",
            "-s3.port.iceberg=0",
            "-s3.port.lance=0",
            "-master.telemetry=false",
        ]);
        command.arg(format!("-dir={}", path("data"))).arg(format!("-s3.config={}", path("users.json")));
        command.arg(format!("-filer.localSocket={}", path("filer"))).arg(format!("-s3.localSocket={}", path("s3")));
        for (name, port, own) in [
            ("master", master, master_own),
            ("volume", volume, volume_own),
            ("filer", filer, filer_own),
            ("s3", s3, s3_own),
        ] {
            command.arg(format!("-{name}.port={port}")).arg(format!("-{name}.port.grpc={own}"));
        }
        let too = log.try_clone().expect("a log");
        self.process = Some(command.stdin(Stdio::null()).stdout(log).stderr(too).spawn().expect("the server"));
        let began = Instant::now();
        while let Err(error) = self.answer() {
            let said = || std::fs::read_to_string(path("log")).unwrap_or_default();
            assert!(began.elapsed() < Duration::from_secs(60), "the server does not answer: {error}\n{}", said());
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// It accepts connections before it can store.
    fn answer(&self) -> Result<(), String> {
        TcpStream::connect((Ipv4Addr::LOCALHOST, self.ports[6])).map_err(|error| error.to_string())?;
        let open = || self.open("ready", 1).map_err(|error| error.to_string());
        let blobs = open().or_else(|_| self.make_bucket().and_then(|()| open()))?;
        std::thread::scope(|scope| scope.spawn(|| blobs.probe()).join().expect("it writes"))
            .map_err(|error| error.to_string())
    }

    fn make_bucket(&self) -> Result<(), String> {
        self.shell(&format!("s3.bucket.create -name {BUCKET}"))
    }

    /// Has the bucket refuse what is written, or take it again.
    pub(crate) fn set_read_only(&self, is_read_only: bool) {
        let line = format!("fs.configure -locationPrefix=/buckets/{BUCKET} -readOnly={is_read_only} -apply");
        let began = Instant::now();
        while let Err(error) = self.shell(&line) {
            assert!(began.elapsed() < Duration::from_secs(60), "{error}");
        }
    }

    /// Gives its shell a line.
    fn shell(&self, line: &str) -> Result<(), String> {
        let [master, master_own, .., filer, filer_own, _, _] = self.ports;
        let mut command = Command::new(&self.program);
        command.arg("shell").arg(format!("-master=127.0.0.1:{master}.{master_own}"));
        command.arg(format!("-filer=127.0.0.1:{filer}.{filer_own}")).stdin(Stdio::piped());
        let shell = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let mut shell = shell.map_err(|error| error.to_string())?;
        let mut said = shell.stdin.take().expect("piped");
        writeln!(said, "{line}").map_err(|error| error.to_string())?;
        drop(said);
        // It would wait for ever for a server that has just ended.
        let began = Instant::now();
        loop {
            match shell.try_wait().map_err(|error| error.to_string())? {
                Some(status) if status.success() => return Ok(()),
                Some(status) => return Err(format!("the shell ended with {status}")),
                None if began.elapsed() > Duration::from_secs(5) => {
                    shell.kill().and_then(|()| shell.wait()).map_err(|error| error.to_string())?;
                }
                None => std::thread::sleep(Duration::from_millis(20)),
            }
        }
    }

    /// By another thread, since those of asynchronous tests may not wait.
    pub(crate) fn open(&self, place: &str, taken: i64) -> Result<Blobs, BlobsError> {
        let environment = self.environment().map(|(name, value)| (name.to_owned(), value));
        let open = || Blobs::open(&self.url(place), taken, environment);
        std::thread::scope(|scope| scope.spawn(open).join().expect("it opens"))
    }

    /// Kills it, as if it had crashed.
    pub(crate) fn kill(&mut self) {
        if let Some(mut process) = self.process.take() {
            process.kill().expect("killed");
            process.wait().expect("ended");
        }
    }

    /// Where it stores.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The address of a place in it.
    pub(crate) fn url(&self, place: &str) -> String {
        url(place)
    }

    /// The environment of programs that use it.
    pub(crate) fn environment(&self) -> [(&'static str, String); 4] {
        environment(&format!("http://127.0.0.1:{}", self.ports[6]))
    }
}

/// The address of a place in the bucket.
pub(crate) fn url(place: &str) -> String {
    format!("s3://{BUCKET}/{place}")
}

/// The environment of programs that use the service of S3 at this address.
pub(crate) fn environment(address: &str) -> [(&'static str, String); 4] {
    [
        ("AWS_ENDPOINT_URL", address.to_owned()),
        ("AWS_ACCESS_KEY_ID", KEY.to_owned()),
        ("AWS_SECRET_ACCESS_KEY", SECRET.to_owned()),
        ("AWS_REGION", "us-east-1".to_owned()),
    ]
}

impl Drop for Server {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Below those that the system gives to connections, so that they are free again after a crash.
fn free() -> [u16; 8] {
    static TRIED: AtomicU16 = AtomicU16::new(0);
    let next = || loop {
        let tried = u32::from(TRIED.fetch_add(1, Ordering::Relaxed));
        let port = 20_000 + (std::process::id() * 64 + tried) % 12_000;
        if TcpListener::bind((Ipv4Addr::LOCALHOST, port as u16)).is_ok() {
            return port as u16;
        }
    };
    std::array::from_fn(|_| next())
}
