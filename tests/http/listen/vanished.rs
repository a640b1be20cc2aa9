//! Clients whose machine or network is gone: nothing comes from them any more, not even the end of the connection.

use super::{HANG, limits, ms, start};
use socket2::{SockFilter, SockRef};
use std::net::SocketAddr;
use std::time::Instant;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

/// From here on the client's side of the connection answers nothing: what arrives is thrown away before TCP sees it.
fn vanish(client: &TcpStream) {
    const RETURN: u16 = 6;
    SockRef::from(client).attach_filter(&[SockFilter::new(RETURN, 0, 0, 0)]).unwrap();
}

/// Whether the service holds its side of the connection, by the system's list of connections in use.
fn is_held(service: SocketAddr, client: SocketAddr) -> bool {
    const ESTABLISHED: &str = "01";
    let port = |field: &str| u16::from_str_radix(field.rsplit(':').next().unwrap(), 16).unwrap();
    let list = std::fs::read_to_string("/proc/self/net/tcp").unwrap();
    list.lines().skip(1).any(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        (port(fields[1]), port(fields[2]), fields[3]) == (service.port(), client.port(), ESTABLISHED)
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stream_without_news_ends_when_its_client_has_vanished() {
    let server = start(limits()).await;
    let follow = async || {
        let mut client = server.connect().await;
        client.write_all(b"GET /silent HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
        assert!(client.read(&mut [0; 1024]).await.unwrap() > 0, "the response begins");
        client
    };
    let (gone, there) = (follow().await, follow().await);
    vanish(&gone);
    let address = |client: &TcpStream| client.local_addr().unwrap();
    assert!(is_held(server.address, address(&gone)));
    let vanished = Instant::now();
    while is_held(server.address, address(&gone)) {
        assert!(vanished.elapsed() < HANG, "the service goes on for a client that is not there");
        tokio::time::sleep(ms(50)).await;
    }
    assert!(vanished.elapsed() > ms(6000), "one lost packet is no reason to give up");
    assert!(is_held(server.address, address(&there)), "a client that only waits is not disturbed");
}
