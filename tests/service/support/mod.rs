//! A real service in a process of its own, and clients that talk to it.

mod api;
mod capture;
#[path = "../../database/mod.rs"]
mod database;
mod elsewhere;
mod inside;
mod raw;

pub(crate) use api::{
    Api, OCTETS, RECORDS, Reply, cage_form, cage_form_of, cages_of, file, form, form_of, lines, piece, records, text,
};
pub(crate) use capture::{Capture, Mesh, USD_UNITS, units_of, usd};
pub(crate) use database::Database;
pub(crate) use elsewhere::{Elsewhere, Heard};
pub(crate) use inside::{Inside, SlowDesigns};
pub(crate) use raw::{Raw, chunked};

use sha2::{Digest as _, Sha256};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions as _};
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longer than anything here takes; what takes this long hangs.
pub(crate) const HANG: Duration = Duration::from_secs(30);

/// A running service. Requests through it go over HTTP/1.1, with the token of its first tenant where it has one.
pub(crate) struct TestApp {
    process: Child,
    _stdout: BufReader<ChildStdout>,
    pub(crate) address: SocketAddr,
    place: Arc<TempDir>,
    flags: Vec<String>,
    environment: Vec<(String, String)>,
    /// Where its catalogue is, unless that is in its folder.
    database: Option<Database>,
    api: Api,
}

/// A service that does not answer yet.
pub(crate) struct Waiting {
    process: Child,
    stdout: BufReader<ChildStdout>,
    place: Arc<TempDir>,
    flags: Vec<String>,
    environment: Vec<(String, String)>,
    database: Option<Database>,
    token: Option<String>,
}

impl Deref for TestApp {
    type Target = Api;

    fn deref(&self) -> &Api {
        &self.api
    }
}

impl TestApp {
    /// A file of a cage design in the data folder.
    pub(crate) fn cage_file(&self, id: &str, name: &str) -> PathBuf {
        self.place.path().join("data/cages").join(id).join(name)
    }

    /// Starts a service with default settings.
    pub(crate) fn start() -> Self {
        Self::with(&[])
    }

    /// A file of a session in the data folder.
    pub(crate) fn session_file(&self, id: &str, name: &str) -> PathBuf {
        self.place.path().join("data/sessions").join(id).join(name)
    }

    /// Waits until a solver is on disk: the service writes it in the background.
    pub(crate) async fn solver_stored(&self) {
        let folder = self.place.path().join("data/prepared");
        let stored = async || std::fs::read_dir(&folder).expect("a folder").next();
        eventually("that the solver is on disk", stored).await.expect("a file");
    }

    /// Starts a service with these settings, each `KEY=VALUE`.
    pub(crate) fn with(settings: &[&str]) -> Self {
        let flags = settings.iter().flat_map(|setting| ["--set".to_owned(), (*setting).to_owned()]).collect();
        Self::launch(Arc::new(folder()), flags, Vec::new(), None)
    }

    /// Starts a service with its catalogue in a database and these settings.
    pub(crate) fn on(database: &Database, settings: &[&str]) -> Self {
        let flags = settings.iter().flat_map(|setting| ["--set".to_owned(), (*setting).to_owned()]).collect();
        Waiting::spawn(Arc::new(folder()), flags, Vec::new(), Some(database.clone()), None).ready()
    }

    /// Starts a service with its files in its folder, wherever those of others are.
    pub(crate) fn with_its_files(settings: &[&str]) -> Self {
        let flags = settings.iter().flat_map(|setting| ["--set".to_owned(), (*setting).to_owned()]).collect();
        Waiting::spawn(Arc::new(folder()), flags, Vec::new(), Database::of_all_alone(), None).ready()
    }

    /// Starts a service with its catalogue in its folder, wherever that of others is.
    pub(crate) fn in_folder() -> Self {
        Waiting::spawn(Arc::new(folder()), Vec::new(), Vec::new(), None, None).ready()
    }

    /// Address of the database with its catalogue, unless that is in its folder.
    pub(crate) fn catalog(&self) -> Option<String> {
        self.database.as_ref().map(Database::url)
    }

    /// Starts the service again, on the same folder, with its catalogue in a database.
    pub(crate) fn moved_to(&self, database: &Database) -> Self {
        let (place, flags) = (Arc::clone(&self.place), self.flags.clone());
        Waiting::spawn(place, flags, Vec::new(), Some(database.clone()), self.api.token.clone()).ready()
    }

    /// Another one with the same settings, on a folder that is new.
    pub(crate) fn elsewhere(&self) -> Waiting {
        self.elsewhere_with(&[])
    }

    /// As [`Self::elsewhere`], with these settings too.
    pub(crate) fn elsewhere_with(&self, settings: &[&str]) -> Waiting {
        let more = settings.iter().flat_map(|setting| ["--set".to_owned(), (*setting).to_owned()]);
        let (flags, environment) = (self.flags.iter().cloned().chain(more).collect(), self.environment.clone());
        Waiting::spawn(Arc::new(folder()), flags, environment, self.database.clone(), self.api.token.clone())
    }

    /// Another one, on the same folder with the same settings.
    pub(crate) fn beside(&self) -> Waiting {
        let (place, flags, environment) = (Arc::clone(&self.place), self.flags.clone(), self.environment.clone());
        Waiting::spawn(place, flags, environment, self.database.clone(), self.api.token.clone())
    }

    /// Of its process.
    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }

    /// Starts a service with default settings and these variables.
    pub(crate) fn with_environment(variables: &[(&str, &str)]) -> Self {
        let variables = variables.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        Self::launch(Arc::new(folder()), Vec::new(), variables, None)
    }

    /// Starts a service with a tokens file. Each entry is a tenant, its token and further keys of the file.
    pub(crate) fn guarded(tokens: &[(&str, &str, &str)]) -> Self {
        Self::guarded_with(tokens, &[])
    }

    /// As [`Self::guarded`], with these settings.
    pub(crate) fn guarded_with(tokens: &[(&str, &str, &str)], settings: &[&str]) -> Self {
        Self::guarded_on(Database::of_all(), tokens, settings)
    }

    /// As [`Self::guarded_with`], with its catalogue in a database where one is given.
    pub(crate) fn guarded_on(database: Option<Database>, tokens: &[(&str, &str, &str)], settings: &[&str]) -> Self {
        let place = folder();
        let file = place.path().join("tokens.toml");
        write_tokens(&file, tokens);
        let settings = settings.iter().flat_map(|setting| ["--set".to_owned(), (*setting).to_owned()]);
        let flags = ["--tokens".to_owned(), file.display().to_string()].into_iter().chain(settings).collect();
        let token = tokens.first().map(|(_, token, _)| (*token).to_owned());
        Waiting::spawn(Arc::new(place), flags, Vec::new(), database, token).ready()
    }

    fn launch(
        place: Arc<TempDir>,
        flags: Vec<String>,
        environment: Vec<(String, String)>,
        token: Option<String>,
    ) -> Self {
        Waiting::spawn(place, flags, environment, Database::of_all(), token).ready()
    }

    /// The same over HTTP/2.
    pub(crate) fn http2(&self) -> Api {
        Api::new(self.address, self.api.token.clone(), true)
    }

    /// Connections of its own with another token, or none.
    pub(crate) fn caller(&self, token: Option<&str>) -> Api {
        Api::new(self.address, token.map(str::to_owned), false)
    }

    /// Connections of its own.
    pub(crate) fn stranger(&self) -> Api {
        Api::new(self.address, self.api.token.clone(), false)
    }

    /// The client that users program with.
    pub(crate) fn client(&self) -> cager_client::Client {
        cager_client::Client::new(&format!("http://{}", self.address)).expect("an address")
    }

    pub(crate) fn tokens_file(&self) -> PathBuf {
        self.place.path().join("tokens.toml")
    }

    /// What the service has logged.
    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(self.place.path().join("log")).expect("a log")
    }

    /// The data folder.
    pub(crate) fn data(&self) -> PathBuf {
        self.place.path().join("data")
    }

    /// Changes the catalogue behind the service's back; `sql` gives a column of the rows that were changed. Gives the first one, as text.
    fn change(&self, sql: &str) -> String {
        match &self.database {
            Some(database) => database.sql(sql),
            None => {
                let options = SqliteConnectOptions::new().filename(self.data().join("catalog.db"));
                let query = sqlx::query_scalar(AssertSqlSafe(sql.to_owned()));
                futures_executor::block_on(async { query.fetch_one(&mut options.connect().await?).await }).expect(sql)
            }
        }
    }

    /// Changes what is stored of a session or job behind the service's back.
    pub(crate) fn set_record(&self, id: &str, change: &str) {
        assert_eq!(self.change(&format!("UPDATE records SET {change} WHERE id = '{id}' RETURNING id")), id);
    }

    /// Changes what is stored of a session or job in a column, with its digest.
    pub(crate) fn rewrite(&self, id: &str, column: &str, change: impl FnOnce(&mut serde_json::Value)) {
        let hex = if self.database.is_some() { format!("encode({column}, 'hex')") } else { format!("hex({column})") };
        let stored = self.change(&format!("SELECT {hex} FROM records WHERE id = '{id}'"));
        let byte = |at: usize| u8::from_str_radix(&stored[at..at + 2], 16).expect("hexadecimal");
        let stored: Vec<u8> = (0..stored.len()).step_by(2).map(byte).collect();
        let mut whole: serde_json::Value = serde_json::from_slice(&stored).expect("JSON");
        change(&mut whole["body"]);
        let (kind, body) = (whole["kind"].as_str().expect("a kind"), whole["body"].to_string());
        let digest = blake3::hash(body.as_bytes()).to_hex();
        let text = format!("{{\"format\":1,\"kind\":\"{kind}\",\"blake3\":\"{digest}\",\"body\":{body}}}\n");
        let hex = text.bytes().fold(String::new(), |hex, byte| hex + &format!("{byte:02x}"));
        self.set_bytes(id, column, &hex);
    }

    /// Changes a column of what is stored of a session or job to these bytes, in hexadecimal.
    pub(crate) fn set_bytes(&self, id: &str, column: &str, hex: &str) {
        let bytes = if self.database.is_some() { format!("'\\x{hex}'") } else { format!("x'{hex}'") };
        self.set_record(id, &format!("{column} = {bytes}"));
    }

    /// Damages the cages that are stored of a session.
    pub(crate) fn damage_frames(&self, id: &str) {
        let zeros = if self.database.is_some() {
            "decode(repeat('00', length(bytes)), 'hex')"
        } else {
            "zeroblob(length(bytes))"
        };
        let of_session = format!("record = (SELECT number FROM records WHERE id = '{id}')");
        let damaged = self.change(&format!("UPDATE chunks SET bytes = {zeros} WHERE {of_session} RETURNING 'damaged'"));
        assert!(damaged.starts_with("damaged"));
    }

    /// A value of `/metrics`; 0 where it is not there yet.
    pub(crate) async fn metric(&self, name: &str) -> f64 {
        let text = self.get("/metrics").await.expect(200).text();
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.map_or(0.0, |value| value.trim().parse().expect("a number"))
    }

    /// Memory that the process holds, in MiB.
    #[cfg(target_os = "linux")]
    pub(crate) fn resident_mib(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).expect("its status");
        let kib = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
        kib.trim().trim_end_matches(" kB").parse::<u64>().expect("a number") / 1024
    }

    /// Niceness of a thread.
    #[cfg(target_os = "linux")]
    pub(crate) fn niceness(&self, thread: &str) -> i32 {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.process.id())).expect("its threads");
        let mut stats = tasks.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("stat")).ok());
        let own = stats.find(|stat| stat.contains(&format!("({thread})"))).expect("the thread");
        let fields = own.rsplit(") ").next().expect("its fields");
        fields.split(' ').nth(16).expect("its niceness").parse().expect("a number")
    }

    /// Asks the service to stop.
    pub(crate) fn terminate(&self) {
        let pid = rustix::process::Pid::from_child(&self.process);
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("it is there");
    }

    /// Ends the service without a word.
    pub(crate) fn kill(&mut self) {
        self.process.kill().expect("it is there");
        self.process.wait().expect("its end");
    }

    /// Waits until the process is gone; gives the time that took.
    pub(crate) async fn ended(&mut self) -> (ExitStatus, Duration) {
        let clock = Instant::now();
        loop {
            if let Some(status) = self.process.try_wait().expect("its status") {
                return (status, clock.elapsed());
            }
            assert!(clock.elapsed() < HANG, "the service does not end");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// Starts the service again, on the same folder with the same settings.
    pub(crate) fn again(&self) -> Self {
        self.beside().ready()
    }
}

impl Waiting {
    fn spawn(
        place: Arc<TempDir>,
        flags: Vec<String>,
        environment: Vec<(String, String)>,
        database: Option<Database>,
        token: Option<String>,
    ) -> Self {
        let log = std::fs::OpenOptions::new().create(true).append(true).open(place.path().join("log"));
        let mut process = service()
            .args(["--listen", "127.0.0.1:0", "--data"])
            .arg(place.path().join("data"))
            .args(database.iter().flat_map(Database::flags))
            .args(&flags)
            .envs(database.iter().flat_map(Database::environment))
            .envs(environment.iter().map(|(name, value)| (name, value)))
            .stdout(Stdio::piped())
            .stderr(log.expect("a log"))
            .spawn()
            .expect("the service starts");
        let stdout = BufReader::new(process.stdout.take().expect("its output"));
        Self { process, stdout, place, flags, environment, database, token }
    }

    /// What services on this folder have logged.
    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(self.place.path().join("log")).unwrap_or_default()
    }

    /// Waits until it listens.
    pub(crate) fn ready(mut self) -> TestApp {
        let mut line = String::new();
        self.stdout.read_line(&mut line).expect("its first line");
        let Some(address) = line.trim().strip_prefix("listening on ") else {
            let _ = self.process.kill();
            panic!("{line:?}; {}", self.log());
        };
        let address: SocketAddr = address.parse().expect("an address");
        let api = Api::new(address, self.token, false);
        let Self { process, stdout, place, flags, environment, database, .. } = self;
        TestApp { process, _stdout: stdout, address, place, flags, environment, database, api }
    }
}

impl Drop for TestApp {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        if std::thread::panicking() {
            eprintln!("the service's log:\n{}", self.log());
        }
    }
}

/// `cager serve` without settings from the environment of the tests.
pub(crate) fn service() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cager"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CAGER_") || name.starts_with("OTEL_")) {
        command.env_remove(name);
    }
    command.arg("serve").stdin(Stdio::null());
    command
}

pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Writes a tokens file; see [`TestApp::guarded`].
pub(crate) fn write_tokens(file: &Path, tokens: &[(&str, &str, &str)]) {
    let mut text = String::new();
    for (k, (tenant, token, more)) in tokens.iter().enumerate() {
        let hash: String = Sha256::digest(token).iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(text, "[[token]]\nname = \"key-{k}\"\ntenant = \"{tenant}\"\nsha256 = \"{hash}\"\n{more}")
            .expect("a text");
    }
    std::fs::write(file, text).expect("a tokens file");
}

/// Waits until something is there.
pub(crate) async fn eventually<T, F: Future<Output = Option<T>>>(what: &str, mut look: impl FnMut() -> F) -> T {
    let clock = Instant::now();
    loop {
        if let Some(found) = look().await {
            return found;
        }
        assert!(clock.elapsed() < HANG, "{what}: not within {HANG:?}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// Waits for something that must not hang.
pub(crate) async fn within<T>(what: &str, limit: Duration, work: impl Future<Output = T>) -> T {
    let outcome = tokio::time::timeout(limit, work).await;
    outcome.unwrap_or_else(|_| panic!("{what}: not within {limit:?}"))
}
