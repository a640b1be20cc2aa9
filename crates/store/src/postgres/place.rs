//! Where the database is, as its URL says, and how it is connected to.

use super::tls;
use crate::CatalogError;
use std::sync::Once;
use std::time::Duration;
use tokio_postgres::Config;
use tokio_postgres::config::{Host, SslMode};
use tokio_postgres_rustls::MakeRustlsConnect;

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
    pub(super) config: Config,
    /// `None`: without encryption.
    pub(super) tls: Option<MakeRustlsConnect>,
    /// How long connecting may take.
    pub(super) connect: Duration,
    /// Names it in messages, without the password.
    pub(super) name: String,
}

impl Place {
    pub(super) fn parse(url: &str) -> Result<Self, CatalogError> {
        let refused = |why: &str| {
            CatalogError::Failed(format!(
                "the address of the database cannot be used: {why}; it looks like postgres://USER:PASSWORD@HOST:5432/DATABASE, with special characters percent-encoded"
            ))
        };
        if !["postgres://", "postgresql://"].iter().any(|scheme| url.starts_with(scheme)) {
            return Err(refused("it does not begin with postgres://"));
        }
        let (base, query) = url.split_once('?').unwrap_or((url, ""));
        let (mut mode, mut roots, mut kept) = ("prefer", None, Vec::new());
        for option in query.split('&').filter(|option| !option.is_empty()) {
            match option.split_once('=') {
                Some(("sslmode", value)) => mode = value,
                Some(("sslrootcert", value)) => roots = Some(value.replace("%2F", "/").replace("%2f", "/")),
                _ => kept.push(option),
            }
        }
        let parsed = format!("{base}?{}", kept.join("&")).parse::<Config>();
        let mut config = parsed.map_err(|error| refused(&super::trouble::chain(&error)))?;
        if config.get_hosts().is_empty() && config.get_hostaddrs().is_empty() {
            return Err(refused("it names no host"));
        }
        let tls = match mode {
            "disable" | "allow" | "prefer" => None,
            "require" | "verify-ca" | "verify-full" => Some(tls::connector(roots.as_deref()).map_err(|e| refused(&e))?),
            _ => return Err(refused("sslmode is disable, prefer, require, verify-ca or verify-full")),
        };
        config.ssl_mode(if tls.is_some() { SslMode::Require } else { SslMode::Disable });
        let options = [DEFAULTS, config.get_options().unwrap_or_default(), ALWAYS].join(" ");
        config.options(options);
        if config.get_application_name().is_none() {
            config.application_name("cager");
        }
        let connect = config.get_connect_timeout().copied().unwrap_or(CONNECT);
        config.connect_timeout(connect);
        let name = name(&config);
        if config.get_hosts().iter().any(|host| matches!(host, Host::Tcp(name) if name.contains('@'))) {
            return Err(refused("there is an @ in its user or password, which is written %40"));
        }
        if tls.is_none() && config.get_hosts().iter().any(is_elsewhere) {
            TOLD.call_once(|| {
                tracing::warn!(
                    "the connection to {name} is not encrypted: `sslmode=require` in its address encrypts it"
                );
            });
        }
        Ok(Self { config, tls, connect, name })
    }

    /// As it is, in another schema.
    pub(super) fn of_schema(mut self, schema: &str) -> Self {
        let options = format!("{} -csearch_path={schema}", self.config.get_options().unwrap_or_default());
        self.config.options(options);
        self.name = format!("{}, schema {schema}", self.name);
        self
    }

    /// As it is, for the connection that says who has the database.
    pub(super) fn of_owner(&self) -> Self {
        let mut config = self.config.clone();
        let system = rustix::system::uname();
        let host = system.nodename().to_string_lossy();
        config.application_name(format!("cager {} on {host}", std::process::id()));
        // It may wait for the changes of an owner that is gone.
        let options = format!("{} -cstatement_timeout=40s", config.get_options().unwrap_or_default());
        config.options(options);
        Self { config, tls: self.tls.clone(), connect: self.connect, name: self.name.clone() }
    }
}

fn name(config: &Config) -> String {
    let of_port = |index: usize| config.get_ports().get(index).or(config.get_ports().first()).copied().unwrap_or(5432);
    let host = |(index, host): (usize, &Host)| match host {
        Host::Tcp(host) => format!("{host}:{}", of_port(index)),
        Host::Unix(folder) => format!("{} port {}", folder.display(), of_port(index)),
    };
    let mut hosts: Vec<_> = config.get_hosts().iter().enumerate().map(host).collect();
    if hosts.is_empty() {
        hosts =
            config.get_hostaddrs().iter().enumerate().map(|(index, ip)| format!("{ip}:{}", of_port(index))).collect();
    }
    let database = config.get_dbname().or(config.get_user()).unwrap_or("of the user");
    format!("PostgreSQL at {}, database {database}", hosts.join(" or "))
}

fn is_elsewhere(host: &Host) -> bool {
    match host {
        Host::Unix(_) => false,
        Host::Tcp(name) if name == "localhost" => false,
        Host::Tcp(name) => !name.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback()),
    }
}
