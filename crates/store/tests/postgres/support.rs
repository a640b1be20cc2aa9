//! A server of PostgreSQL, which ends with the test: on a socket in its own folder, and as another user where this one is root, which it refuses.

use cager_store::PostgresCatalog;
use rustix::process::{Pid, Signal, kill_process};
use std::fs::File;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Tells tests that there must be a server.
const REQUIRED: &str = "CAGER_POSTGRES";
pub(crate) struct Server {
    programs: PathBuf,
    folder: tempfile::TempDir,
    process: Option<Child>,
}

impl Server {
    /// A new one; `None`, which is said, where PostgreSQL is not installed and not required.
    pub(crate) fn start() -> Option<Self> {
        let Some(programs) = programs() else {
            assert!(
                std::env::var(REQUIRED).as_deref() != Ok("required"),
                "{REQUIRED}=required, and PostgreSQL is not here"
            );
            eprintln!("PostgreSQL is not installed, so that this tests nothing");
            return None;
        };
        let folder = tempfile::Builder::new().prefix("pg").tempdir().expect("a folder");
        run(Command::new("cp").arg("-a").arg(template(&programs)).arg(folder.path().join("data")));
        give_to_user(folder.path());
        let mut server = Self { programs, folder, process: None };
        server.run();
        Some(server)
    }

    pub(crate) fn run(&mut self) {
        let log = self.folder.path().join("log");
        let began = Instant::now();
        while UnixStream::connect(self.folder.path().join(".s.PGSQL.5432")).is_err() || !self.answers() {
            // After a crash, what is left of the old one may still be there.
            if self.process.as_mut().is_none_or(|process| process.try_wait().expect("its state").is_some()) {
                self.process = Some(self.spawn(&log));
            }
            let said = || std::fs::read_to_string(&log).unwrap_or_default();
            assert!(began.elapsed() < Duration::from_secs(20), "the server does not answer:\n{}", said());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn spawn(&self, log: &Path) -> Child {
        let log = File::options().create(true).append(true).open(log).expect("a log");
        let mut command = as_user(self.programs.join("postgres"));
        command.arg("-D").arg(self.folder.path().join("data")).arg("-k").arg(self.folder.path());
        command.args(["-h", "", "-c", "max_connections=100", "-c", "shared_buffers=32MB", "-c", "fsync=on"]);
        let log_too = log.try_clone().expect("a log");
        command.stdin(Stdio::null()).stdout(log).stderr(log_too).spawn().expect("the server")
    }

    fn answers(&self) -> bool {
        self.try_sql("SELECT 1").is_ok()
    }

    /// Sends a signal to all of its processes.
    pub(crate) fn signal(&self, signal: Signal) {
        let first = self.process.as_ref().expect("it runs").id();
        let of = std::fs::read_to_string(format!("/proc/{first}/task/{first}/children")).expect("its processes");
        let all = of.split_whitespace().filter_map(|id| id.parse().ok()).chain([first as i32]);
        for process in all.filter_map(Pid::from_raw) {
            // One of them may just have ended.
            let _ = kill_process(process, signal);
        }
    }

    /// Kills it, as if it had crashed.
    pub(crate) fn kill(&mut self) {
        if let Some(mut process) = self.process.take() {
            process.kill().expect("killed");
            process.wait().expect("ended");
        }
    }

    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    pub(crate) fn url(&self) -> String {
        self.url_of("cager")
    }

    /// For a user, or a user and a password.
    pub(crate) fn url_of(&self, user: &str) -> String {
        format!("postgres://{user}@{}/postgres", self.folder.path().display().to_string().replace('/', "%2F"))
    }

    pub(crate) fn open(&self) -> PostgresCatalog {
        PostgresCatalog::open(&self.url()).expect("a catalogue")
    }

    /// What SQL gives, as text without alignment.
    pub(crate) fn sql(&self, sql: &str) -> String {
        self.try_sql(sql).unwrap_or_else(|error| panic!("{sql}: {error}"))
    }

    fn try_sql(&self, sql: &str) -> Result<String, String> {
        let mut command = Command::new(self.programs.join("psql"));
        command.args(["-X", "-A", "-t", "-q", "-v", "ON_ERROR_STOP=1", "-U", "cager", "-d", "postgres", "-c", sql]);
        let of = command
            .arg("-h")
            .arg(self.folder.path())
            .env("PGOPTIONS", "-csearch_path=cager -cdefault_transaction_read_only=off");
        let done = of.output().expect("psql");
        let said = String::from_utf8_lossy(&done.stdout).trim().to_owned();
        if done.status.success() { Ok(said) } else { Err(String::from_utf8_lossy(&done.stderr).into_owned()) }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let Some(mut process) = self.process.take() else { return };
        let _ = Pid::from_raw(process.id() as i32).map(|id| kill_process(id, Signal::QUIT));
        let began = Instant::now();
        while matches!(process.try_wait(), Ok(None)) && began.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(Duration::from_millis(5));
        }
        // Where it has not ended so. Its other processes end with it.
        let _ = process.kill();
        let _ = process.wait();
    }
}

/// The folder of the server's programs.
fn programs() -> Option<PathBuf> {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let of_packages = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    let mut of_packages: Vec<_> = of_packages.map(|version| version.path().join("bin")).collect();
    of_packages.sort();
    let mut all = std::env::split_paths(&paths).chain(of_packages.into_iter().rev());
    all.find(|folder| ["postgres", "initdb", "psql"].iter().all(|program| folder.join(program).is_file()))
}

/// The folder of data with which a server begins. It takes a second to make, and so is made once.
fn template(programs: &Path) -> PathBuf {
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let lock = File::create(kept.join("postgres.lock")).expect("a lock");
    lock.lock().expect("locked");
    let made = kept.join("postgres-data");
    if !made.exists() {
        let making = tempfile::tempdir().expect("a folder");
        give_to_user(making.path());
        let data = making.path().join("data");
        let mut initdb = as_user(programs.join("initdb"));
        run(initdb
            .args(["-U", "cager", "-A", "trust", "-E", "UTF8", "--no-locale", "--wal-segsize=1", "-D"])
            .arg(&data));
        let half = kept.join("postgres-data.half");
        run(Command::new("rm").arg("-rf").arg(&half));
        run(Command::new("cp").arg("-a").arg(&data).arg(&half));
        std::fs::rename(&half, &made).expect("renamed");
    }
    made
}

/// A program that ends with the thread that starts it.
fn as_user(program: impl AsRef<std::ffi::OsStr>) -> Command {
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "KILL"]).current_dir("/");
    if let Some(user) = other_user() {
        command.args(["--clear-groups", &format!("--reuid={user}"), &format!("--regid={user}")]);
    }
    command.arg(program);
    command
}

fn give_to_user(folder: &Path) {
    if let Some(user) = other_user() {
        std::os::unix::fs::chown(folder, Some(user), Some(user)).expect("given to the server's user");
    }
}

/// Where this user is root, one who is not: nobody.
fn other_user() -> Option<u32> {
    rustix::process::getuid().is_root().then_some(65534)
}

fn run(command: &mut Command) {
    let done = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(done.status.success(), "{command:?}: {}", String::from_utf8_lossy(&done.stderr));
}
