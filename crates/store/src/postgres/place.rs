//! Where the database is, as its URL says, and how it is connected to.

use crate::CatalogError;
use crate::link::Link;
use crate::trouble::Trouble;
use reqwest::Url;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use sqlx::ConnectOptions as _;
use sqlx::postgres::{PgConnectOptions, PgSslMode};
use std::sync::Once;
use std::time::Duration;

/// How long connecting may take, unless the URL says otherwise.
const CONNECT: Duration = Duration::from_secs(5);
/// Settings of each connection, unless the URL says otherwise. Nobody waits for ever, and who is gone holds no lock.
const DEFAULTS: &str = "-csearch_path=cager -cstatement_timeout=30s -cidle_in_transaction_session_timeout=15s -cjit=off -ctcp_keepalives_idle=5 -ctcp_keepalives_interval=2 -ctcp_keepalives_count=3 -ctcp_user_timeout=10s";
/// Settings that hold whatever the URL and the database say: what is acknowledged is on its disk.
const ALWAYS: &str = "-csynchronous_commit=on -cdefault_transaction_isolation=read\\ committed";

/// It is said once.
static TOLD: Once = Once::new();

/// A database, and how to connect to it.
pub(super) struct Place {
    /// Its servers, of which the first one is taken that is there.
    servers: Vec<PgConnectOptions>,
    /// It must take writes.
    writes: bool,
    /// How long connecting may take.
    connect: Duration,
    /// Names it in messages, without the password.
    pub(super) name: String,
}

impl Place {
    pub(super) fn parse(url: &str) -> Result<Self, CatalogError> {
        Self::parsed(url).map_err(|why| {
            CatalogError::Failed(format!(
                "the address of the database cannot be used: {why}; it looks like postgres://USER:PASSWORD@HOST:5432/DATABASE, with special characters percent-encoded"
            ))
        })
    }

    fn parsed(url: &str) -> Result<Self, String> {
        let Some((scheme @ ("postgres" | "postgresql"), rest)) = url.split_once("://") else {
            return Err("it does not begin with postgres://".to_owned());
        };
        let (authority, rest) = rest.split_at(rest.find(['/', '?']).unwrap_or(rest.len()));
        let (user, hosts) = authority.rsplit_once('@').unwrap_or(("", authority));
        if user.contains('@') {
            return Err("there is an @ in its user or password, which is written %40".to_owned());
        }
        let urls = hosts.split(',').map(|host| match user {
            "" => Url::parse(&format!("{scheme}://{host}{rest}")),
            user => Url::parse(&format!("{scheme}://{user}@{host}{rest}")),
        });
        let urls: Vec<Url> = urls.collect::<Result<_, _>>().map_err(|error| error.to_string())?;
        let (mut mode, mut roots, mut writes, mut connect) = ("prefer".to_owned(), None, false, CONNECT);
        let (mut own, mut kept) = (String::new(), Vec::new());
        for (key, value) in urls[0].query_pairs() {
            match &*key {
                "sslmode" => mode = value.into_owned(),
                "sslrootcert" => roots = Some(value.into_owned()),
                "options" => own = value.into_owned(),
                "target_session_attrs" if value == "any" => {}
                "target_session_attrs" if value == "read-write" => writes = true,
                "connect_timeout" => {
                    let seconds = value.parse().map_err(|_| "connect_timeout is a number of seconds".to_owned())?;
                    connect = Duration::from_secs(seconds);
                }
                "application_name" | "host" | "port" | "user" | "password" | "dbname" => kept.push((key, value)),
                _ => return Err(format!("it has no option {key}={value}")),
            }
        }
        if hosts.is_empty() && kept.iter().all(|(key, _)| key != "host") {
            return Err("it names no host".to_owned());
        }
        let is_encrypted = match &*mode {
            "disable" | "allow" | "prefer" => false,
            "require" | "verify-ca" | "verify-full" => true,
            _ => return Err("sslmode is disable, prefer, require, verify-ca or verify-full".to_owned()),
        };
        roots.iter().filter(|_| is_encrypted).try_for_each(|path| check_certificates(path))?;
        let options = [DEFAULTS, &own, ALWAYS].join(" ");
        let server = |url: &Url| {
            let mut url = url.clone();
            url.query_pairs_mut().clear().extend_pairs(&kept).append_pair("options", &options);
            let server: PgConnectOptions = url.as_str().parse().map_err(|error: sqlx::Error| error.to_string())?;
            let server = match server.get_application_name() {
                None => server.application_name("cager"),
                Some(_) => server,
            };
            // Certificates are always checked.
            let server = match (is_encrypted, &roots) {
                (false, _) => server.ssl_mode(PgSslMode::Disable),
                (true, None) => server.ssl_mode(PgSslMode::VerifyFull),
                (true, Some(roots)) => server.ssl_mode(PgSslMode::VerifyFull).ssl_root_cert(roots),
            };
            Ok(server.disable_statement_logging())
        };
        let servers: Vec<PgConnectOptions> = urls.iter().map(server).collect::<Result<_, String>>()?;
        let name = name(&servers);
        if !is_encrypted && servers.iter().any(is_elsewhere) {
            TOLD.call_once(|| {
                tracing::warn!(
                    "the connection to {name} is not encrypted: `sslmode=require` in its address encrypts it"
                );
            });
        }
        Ok(Self { servers, writes, connect, name })
    }

    /// As it is, for the connection that says who has the database.
    pub(super) fn of_owner(&self) -> Self {
        let system = rustix::system::uname();
        let host = system.nodename().to_string_lossy();
        let name = format!("cager {} on {host}", std::process::id());
        // It may wait for the changes of an owner that is gone.
        let server =
            |server: &PgConnectOptions| server.clone().application_name(&name).options([("statement_timeout", "40s")]);
        Self { servers: self.servers.iter().map(server).collect(), name: self.name.clone(), ..*self }
    }

    /// Connects to the first of the servers that is there and, where that is asked for, takes writes.
    pub(super) fn connect(&self) -> Result<Link, Trouble> {
        let connect = |server: &PgConnectOptions| {
            let mut link = Link::to_postgres(server, self.connect)?;
            link.limit(self.connect);
            let is_wrong = self.writes && link.only("SELECT current_setting('transaction_read_only') = 'on'", &[])?;
            match is_wrong {
                true => Err(CatalogError::Away(format!("{} takes no writes", self.name)).into()),
                false => Ok(link),
            }
        };
        let mut outcome = connect(&self.servers[0]);
        for server in &self.servers[1..] {
            if outcome.is_err() {
                outcome = connect(server);
            }
        }
        outcome
    }
}

/// Sees that there are certificates in a file.
fn check_certificates(path: &str) -> Result<(), String> {
    let unreadable = |error: &dyn std::fmt::Display| format!("sslrootcert {path}: {error}");
    let mut found = CertificateDer::pem_file_iter(path).map_err(|error| unreadable(&error))?.peekable();
    if found.peek().is_none() {
        return Err(unreadable(&"it has no certificates in PEM"));
    }
    found.try_for_each(|certificate| certificate.map(drop)).map_err(|error| unreadable(&error))
}

fn name(servers: &[PgConnectOptions]) -> String {
    let place = |server: &PgConnectOptions| match server.get_socket() {
        Some(folder) => format!("{} port {}", folder.display(), server.get_port()),
        None => format!("{}:{}", server.get_host(), server.get_port()),
    };
    let places: Vec<String> = servers.iter().map(place).collect();
    let database = servers[0].get_database().unwrap_or_else(|| servers[0].get_username());
    format!("PostgreSQL at {}, database {database}", places.join(" or "))
}

fn is_elsewhere(server: &PgConnectOptions) -> bool {
    let host = server.get_host().trim_matches(['[', ']']);
    let is_here = host == "localhost" || host.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback());
    server.get_socket().is_none() && !is_here
}
