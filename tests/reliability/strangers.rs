//! A host without a token does its worst; those who have one go on as if nothing were.

use crate::neighbours::House;
use crate::overload::QUIET;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpSocket, TcpStream};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

/// A connection from another address of this machine.
async fn from_elsewhere(address: SocketAddr) -> std::io::Result<TcpStream> {
    let socket = TcpSocket::new_v4()?;
    socket.bind(([127, 0, 0, 2], 0).into())?;
    socket.connect(address).await
}

/// Sends a request that is refused for want of a token, and neither the rest of its body nor the end; again and again.
async fn is_refused_and_stays(address: SocketAddr) {
    loop {
        if let Ok(mut stream) = from_elsewhere(address).await {
            let head = "POST /v1/sessions HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\nx";
            let _ = stream.write_all(head.as_bytes()).await;
            let mut answer = Vec::new();
            let _ = timeout(Duration::from_secs(5), stream.read_to_end(&mut answer)).await;
            sleep(Duration::from_secs(3)).await;
        }
        sleep(Duration::from_millis(10)).await;
    }
}

/// Asks for what needs no token and is long, many times over one connection, and reads nothing.
async fn reads_nothing(address: SocketAddr) {
    loop {
        if let Ok(mut stream) = from_elsewhere(address).await {
            let request = "GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(40);
            let _ = stream.write_all(request.as_bytes()).await;
            // Writing is how it learns that the connection is gone.
            while stream.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").await.is_ok() {
                sleep(Duration::from_millis(100)).await;
            }
        }
        sleep(Duration::from_millis(10)).await;
    }
}

/// New connections with a token find a place while a host without one wants them all.
async fn newcomers_are_served(house: &House) {
    let address = house.server.address;
    for k in 0..30 {
        let client = crate::inside::http().http1_only().build().expect("a client");
        let view = client.get(house.server.url(&house.path(&house.quiet, ""))).bearer_auth(QUIET);
        let answer = timeout(Duration::from_secs(5), view.send()).await.expect("the quiet tenant waits");
        let status = answer.unwrap_or_else(|error| panic!("newcomer {k} to {address}: {error}")).status();
        assert_eq!(status, 200, "newcomer {k} is turned away");
        sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn refused_requests_of_one_host_take_no_place_of_others() {
    let house = House::measured(&["max_connections=40"]).await;
    let mut attack = JoinSet::new();
    (0..150).for_each(|_| drop(attack.spawn(is_refused_and_stays(house.server.address))));
    sleep(Duration::from_millis(500)).await;
    newcomers_are_served(&house).await;
    house.goes_on("refused requests", 50.0).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn files_of_the_page_that_one_host_does_not_read_take_no_place_of_others() {
    let house = House::measured(&["max_connections=40"]).await;
    let mut attack = JoinSet::new();
    (0..150).for_each(|_| drop(attack.spawn(reads_nothing(house.server.address))));
    sleep(Duration::from_millis(1000)).await;
    newcomers_are_served(&house).await;
    house.goes_on("unread files", 80.0).await;
}
