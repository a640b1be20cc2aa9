//! Refusals that come while the client is still sending.

use super::*;

const BODY_BYTES: usize = 64 << 20;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_writes_blindly_finds_the_refusal_afterwards() {
    let server = start(limits()).await;
    let mut seen = 0;
    for _ in 0..10 {
        let mut stream = server.connect().await;
        let head = format!("POST /refuse HTTP/1.1\r\nHost: x\r\nContent-Length: {BODY_BYTES}\r\n\r\n");
        stream.write_all(head.as_bytes()).await.unwrap();
        let piece = vec![0; 1 << 20];
        for _ in 0..BODY_BYTES / piece.len() {
            if stream.write_all(&piece).await.is_err() {
                break;
            }
        }
        let bytes = read_to_close(&mut stream).await;
        seen += usize::from(bytes.starts_with(b"HTTP/1.1 413 "));
    }
    assert!(seen >= 9, "{seen} of 10 clients saw the refusal");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn ordinary_clients_see_the_refusal() {
    let server = start(limits()).await;
    let mut seen = 0;
    for _ in 0..10 {
        let client = crate::client().http1_only().build().unwrap();
        let request = client.post(format!("http://{}/refuse", server.address)).body(vec![0; BODY_BYTES]);
        let answer = timeout(HANG, request.send()).await.expect("no answer");
        seen += usize::from(answer.is_ok_and(|answer| answer.status() == StatusCode::PAYLOAD_TOO_LARGE));
    }
    assert!(seen >= 9, "{seen} of 10 clients saw the refusal");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_refused_connection_is_closed_and_its_place_given_back() {
    let server =
        start(Limits { max_connections: 1, spare_connections: 0, body_timeout: HANG, idle_timeout: HANG, ..limits() })
            .await;
    for _ in 0..3 {
        let mut stream = placed(&server).await;
        let answer = ask(&mut stream, "POST /refuse HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nabc").await;
        let began = Instant::now();
        assert!(answer.starts_with("HTTP/1.1 413 ") && answer.contains("connection: close"), "{answer}");
        read_to_close(&mut stream).await;
        assert!(began.elapsed() < HANG / 3, "the server says at once that it is done");
    }
    // A client that does not close may still read, but has no place any more.
    let mut rude = placed(&server).await;
    ask(&mut rude, "POST /refuse HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nabc").await;
    placed(&server).await;
}
