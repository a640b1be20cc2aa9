//! What one address may take.

use super::*;
use tokio::net::TcpSocket;

async fn from(address: [u8; 4], server: &Server) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((address, 0).into()).unwrap();
    socket.connect(server.address).await.unwrap()
}

const SLOW: &[u8] = b"GET /slow HTTP/1.1\r\nHost: x\r\n\r\n";
const HERE: &str = "GET / HTTP/1.1\r\nHost: x\r\n\r\n";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_address_has_its_share_of_the_places_and_no_more() {
    let long = Limits { header_timeout: HANG, idle_timeout: HANG, ..limits() };
    let server = start(Limits { max_connections: 4, spare_connections: 0, max_per_address: 2, ..long }).await;
    let [one, two] = [[127, 0, 0, 1], [127, 0, 0, 2]];
    let mut busy = [from(one, &server).await, from(one, &server).await];
    for stream in &mut busy {
        stream.write_all(SLOW).await.unwrap();
    }
    // Until both are at work.
    tokio::time::sleep(ms(500)).await;
    let began = Instant::now();
    let answer = read_to_close(&mut from(one, &server).await).await;
    assert!(answer.is_empty() && began.elapsed() < HANG / 3, "it has as many as it may: {:?}", began.elapsed());
    let mut other = from(two, &server).await;
    assert!(ask(&mut other, HERE).await.ends_with("here"), "others have theirs");
    for stream in &mut busy {
        read_response(stream).await;
    }
    // Whichever of the two was answered first, the other has been idle for longer now.
    assert!(ask(&mut busy[1], HERE).await.ends_with("here"));
    // One that is idle makes way for a newer one of the same address, and for no other.
    tokio::time::sleep(ms(1100)).await;
    let mut next = from(one, &server).await;
    assert!(ask(&mut next, HERE).await.ends_with("here"));
    assert!(read_to_close(&mut busy[0]).await.is_empty());
    assert!(ask(&mut busy[1], HERE).await.ends_with("here"));
    assert!(ask(&mut other, HERE).await.ends_with("here"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_is_not_known_has_little_time_to_read() {
    let server = start(Limits { write_timeout: HANG, stranger_write_timeout: ms(500), ..limits() }).await;
    let mut stream = server.connect().await;
    let began = Instant::now();
    stream.write_all(b"GET /endless HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
    while stream.write_all(b"x").await.is_ok() && began.elapsed() < HANG {
        tokio::time::sleep(ms(30)).await;
    }
    assert_took(began.elapsed(), ms(500));
}
