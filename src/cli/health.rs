//! `cager health`: for images that hold nothing but this program.

use super::args::HealthArgs;
use super::{plain, print};
use anyhow::{Context, Result, bail};
use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpStream};
use std::time::{Duration, Instant};

/// Longer answers are cut.
const MAX_ANSWER_BYTES: usize = 1 << 16;
/// First byte of a TLS alert, with which a service with TLS answers plain HTTP.
const TLS_ALERT: u8 = 0x15;

pub(super) fn run(args: &HealthArgs) -> Result<()> {
    let address = match args.address {
        Some(address) => address,
        None => match std::env::var("CAGER_LISTEN") {
            Ok(text) => text.parse().with_context(|| format!("CAGER_LISTEN={text}: not ADDRESS:PORT"))?,
            Err(_) => SocketAddr::from((Ipv4Addr::LOCALHOST, 8080)),
        },
    };
    let address = reachable(address);
    let path = if args.live { "/healthz" } else { "/readyz" };
    let end = Instant::now() + Duration::from_secs(args.timeout_s);
    let answer = ask(address, path, end).with_context(|| format!("{address}: no answer; is `cager serve` running?"))?;
    if answer.first() == Some(&TLS_ALERT) {
        return print("alive; it wants TLS, so more is not known\n");
    }
    let answer = String::from_utf8_lossy(&answer);
    let mut words = answer.split_ascii_whitespace();
    match (words.next(), words.next()) {
        (Some(protocol), Some("200")) if protocol.starts_with("HTTP/1.") => {
            print(if args.live { "alive\n" } else { "ready\n" })
        }
        (Some(protocol), Some(status)) if protocol.starts_with("HTTP/1.") => {
            let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
            let problem: Option<cager_client::messages::Problem> = serde_json::from_str(body).ok();
            let why = problem.map_or_else(|| format!("status {status}"), |problem| problem.detail);
            bail!("{address}: not ready: {}", plain(&why))
        }
        _ => bail!("{address}: something else than `cager serve` answers there"),
    }
}

/// Replaces an unspecified listening address by the loopback address.
fn reachable(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        IpAddr::V4(Ipv4Addr::UNSPECIFIED) => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(Ipv6Addr::UNSPECIFIED) => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, address.port())
}

fn ask(address: SocketAddr, path: &str, end: Instant) -> std::io::Result<Vec<u8>> {
    let left = || {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(std::io::Error::from(ErrorKind::TimedOut)) } else { Ok(left) }
    };
    let mut stream = TcpStream::connect_timeout(&address, left()?)?;
    stream.set_write_timeout(Some(left()?))?;
    stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").as_bytes())?;
    let (mut answer, mut piece) = (Vec::new(), [0; 4096]);
    while answer.len() < MAX_ANSWER_BYTES {
        stream.set_read_timeout(Some(left()?))?;
        match stream.read(&mut piece) {
            Ok(0) => break,
            Ok(count) => answer.extend_from_slice(&piece[..count]),
            // A connection cut after the answer has answered.
            Err(error) if error.kind() == ErrorKind::ConnectionReset && !answer.is_empty() => break,
            Err(error) => return Err(error),
        }
    }
    Ok(answer)
}

#[cfg(test)]
mod tests {
    use super::reachable;

    #[test]
    fn all_addresses_are_asked_at_the_machines_own() {
        for (listened, asked) in [
            ("0.0.0.0:1", "127.0.0.1:1"),
            ("[::]:2", "[::1]:2"),
            ("10.1.2.3:4", "10.1.2.3:4"),
            ("[fe80::1]:4", "[fe80::1]:4"),
        ] {
            assert_eq!(reachable(listened.parse().unwrap()), asked.parse().unwrap());
        }
    }
}
