//! A proxy in a process of its own, with its configuration of `docs/OPERATIONS.md` for ports of this test.

use crate::support::{eventually, folder};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Nginx,
    Haproxy,
    Caddy,
    Traefik,
}

/// Whether requests and answers are gathered before they are passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Buffering {
    Off,
    On,
}

pub(super) struct Proxy {
    process: Child,
    folder: TempDir,
    tls: SocketAddr,
    plain: SocketAddr,
}

/// What stands in the document.
const SERVICE: &str = "127.0.0.1:8080";

impl Proxy {
    /// Starts it in front of a service; none where it is not installed.
    pub(super) async fn start(kind: Kind, service: SocketAddr, buffering: Buffering) -> Option<Self> {
        let Some(program) = installed(kind.program()) else {
            eprintln!("{} is not installed, so nothing is sent through it", kind.program());
            return None;
        };
        let place = folder();
        let (tls, plain) = (free_port(), free_port());
        write_certificate(place.path());
        let text = configuration(kind, service, tls, plain, buffering, place.path());
        let file = place.path().join("configuration");
        std::fs::write(&file, text).expect("a file");
        let log = std::fs::File::create(place.path().join("log")).expect("a log");
        let mut command = Command::new(program);
        match kind {
            Kind::Nginx => command.arg("-p").arg(place.path()).arg("-e").arg("stderr").arg("-c").arg(&file),
            Kind::Haproxy => command.arg("-db").arg("-f").arg(&file),
            Kind::Caddy => command.args(["run", "--adapter", "caddyfile", "--config"]).arg(&file),
            Kind::Traefik => command.arg(format!("--configFile={}", split(&file).display())),
        };
        command.env("HOME", place.path()).env("XDG_DATA_HOME", place.path()).env("XDG_CONFIG_HOME", place.path());
        let streams = command.stdin(Stdio::null()).stdout(log.try_clone().expect("a log")).stderr(log);
        let proxy = Self { process: streams.spawn().expect("it starts"), folder: place, tls, plain };
        for address in [tls, plain] {
            eventually("the proxy listens", async || tokio::net::TcpStream::connect(address).await.ok()).await;
        }
        let health = format!("{}/healthz", proxy.plain_url());
        let passes = async || reqwest::get(&health).await.ok().filter(|answer| answer.status() == 200);
        eventually("the proxy passes requests on", passes).await;
        Some(proxy)
    }

    fn log(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("log")).unwrap_or_default()
    }

    pub(super) fn url(&self) -> String {
        format!("https://localhost:{}", self.tls.port())
    }

    pub(super) fn plain_url(&self) -> String {
        format!("http://{}", self.plain)
    }

    /// A client that takes its certificate.
    pub(super) fn http(&self, http2: bool) -> reqwest::Client {
        let _ = rustls::crypto::ring::default_provider().install_default();
        let builder = reqwest::Client::builder().tls_danger_accept_invalid_certs(true).no_proxy();
        let builder = builder.resolve("localhost", self.tls);
        let builder = if http2 { builder } else { builder.http1_only() };
        builder.build().expect("a client")
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        if std::thread::panicking() {
            eprintln!("the proxy's log:\n{}", self.log());
        }
    }
}

impl Kind {
    fn program(self) -> &'static str {
        match self {
            Self::Nginx => "nginx",
            Self::Haproxy => "haproxy",
            Self::Caddy => "caddy",
            Self::Traefik => "traefik",
        }
    }

    /// What to replace for buffers that the document has switched off.
    fn buffered(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::Nginx => &[
                ("proxy_request_buffering off;", "proxy_request_buffering on;"),
                ("proxy_buffering off;", "proxy_buffering on;"),
            ],
            Self::Haproxy => &[("option http-no-delay", "option http-buffer-request")],
            Self::Caddy => &[("flush_interval -1", "buffer_requests\n            buffer_responses")],
            Self::Traefik => &[
                ("      service: cager\n", "      service: cager\n      middlewares: [gather]\n"),
                (
                    "  services:\n",
                    "  middlewares:\n    gather:\n      buffering: {memRequestBodyBytes: 1048576}\n  services:\n",
                ),
            ],
        }
    }
}

fn configuration(
    kind: Kind,
    service: SocketAddr,
    tls: SocketAddr,
    plain: SocketAddr,
    buffering: Buffering,
    place: &Path,
) -> String {
    let document = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/OPERATIONS.md");
    let document = std::fs::read_to_string(document).expect("a document");
    let begin = format!("```{}\n", kind.program());
    let block = document.split(&begin).nth(1).and_then(|rest| rest.split("```").next()).expect("a configuration");
    let certificate = place.join("cager.pem").display().to_string();
    let mut replaced = vec![(SERVICE.to_owned(), service.to_string())];
    let text = match kind {
        Kind::Nginx => {
            replaced.push(("listen 443 ssl http2;".into(), format!("listen {tls} ssl http2; listen {plain};")));
            replaced.push(("/etc/ssl/cager.pem".into(), certificate.clone()));
            replaced.push(("/etc/ssl/cager.key".into(), certificate));
            let temporary = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"]
                .map(|name| format!("{name}_temp_path {}; ", place.join(name).display()))
                .concat();
            format!(
                "daemon off; master_process off; pid {};\nevents {{}}\nhttp {{ access_log off; {temporary}\n{block}}}\n",
                place.join("pid").display()
            )
        }
        Kind::Haproxy => {
            let bind = "bind :443 ssl crt /etc/haproxy/cager.pem alpn h2,http/1.1";
            let ours = format!("bind {tls} ssl crt {certificate} alpn h2,http/1.1\n    bind {plain}");
            replaced.push((bind.into(), ours));
            block.to_owned()
        }
        Kind::Caddy => {
            // One site has either TLS or not.
            let site = "cager.example.org {";
            let guarded = format!("https://localhost:{} {{\n    tls {certificate} {certificate}", tls.port());
            replaced.push((site.into(), guarded));
            let open = block.replace(site, &format!("http://{plain} {{"));
            format!("{{\n    admin off\n    auto_https off\n    skip_install_trust\n}}\n{block}\n{open}")
        }
        Kind::Traefik => {
            let dynamic = place.join("dynamic.yaml").display().to_string();
            replaced.push(("/etc/traefik/cager.yaml".into(), dynamic));
            replaced.push(("/etc/ssl/cager.pem".into(), certificate.clone()));
            replaced.push(("/etc/ssl/cager.key".into(), certificate));
            replaced.push((
                "  websecure:\n    address: \":443\"".into(),
                format!("  open:\n    address: \"{plain}\"\n  websecure:\n    address: \"{tls}\""),
            ));
            replaced.push(("Host(`cager.example.org`) && ".into(), String::new()));
            // A router has either TLS or not.
            let router =
                "    cager:\n      rule: \"!Path(`/metrics`)\"\n      entryPoints: [open]\n      service: cager\n";
            block.replacen("  routers:\n", &format!("  routers:\n{}", router.replacen("cager:", "open:", 1)), 1)
        }
    };
    if buffering == Buffering::On {
        replaced.extend(kind.buffered().iter().map(|&(from, to)| (from.to_owned(), to.to_owned())));
    }
    replaced.into_iter().fold(text, |text, (from, to)| {
        assert!(text.contains(&from), "{from:?} is missing in the configuration of {}", kind.program());
        text.replace(&from, &to)
    })
}

/// The two files that Traefik reads; gives the first.
fn split(file: &Path) -> PathBuf {
    let text = std::fs::read_to_string(file).expect("a configuration");
    let (fixed, dynamic) = text.split_once("---\n").expect("two parts");
    std::fs::write(file.with_file_name("dynamic.yaml"), dynamic).expect("a file");
    let place = file.with_file_name("static.yaml");
    std::fs::write(&place, fixed).expect("a file");
    place
}

fn installed(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain(["/usr/sbin".into()]);
    folders.map(|folder| folder.join(program)).find(|file| file.exists())
}

/// A port that was free a moment ago.
fn free_port() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port")
}

fn write_certificate(place: &Path) {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a certificate");
    let text = format!("{}{}", made.cert.pem(), made.signing_key.serialize_pem());
    std::fs::write(place.join("cager.pem"), text).expect("a file");
}
