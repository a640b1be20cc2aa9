//! Clients that wait, at every place where one can.

use super::*;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_silent_connection_is_closed() {
    let server = start(limits()).await;
    let began = Instant::now();
    assert!(read_to_close(&mut server.connect().await).await.is_empty());
    assert_took(began.elapsed(), limits().header_timeout);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn half_a_header_is_not_waited_for_however_it_drips() {
    let server = start(limits()).await;
    let began = Instant::now();
    let mut stream = server.connect().await;
    stream.write_all(b"GET / HTTP/1.1\r\nHos").await.unwrap();
    read_to_close(&mut stream).await;
    assert_took(began.elapsed(), limits().header_timeout);

    let mut stream = server.connect().await;
    let began = Instant::now();
    stream.write_all(b"GET / HTTP/1.1\r\nX: ").await.unwrap();
    while stream.write_all(b"x").await.is_ok() && began.elapsed() < HANG {
        tokio::time::sleep(ms(30)).await;
    }
    assert_took(began.elapsed(), limits().header_timeout);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn half_a_header_of_a_later_request_is_not_waited_for() {
    let server = start(Limits { idle_timeout: HANG, ..limits() }).await;
    let mut stream = server.connect().await;
    assert!(ask(&mut stream, "GET / HTTP/1.1\r\nHost: x\r\n\r\n").await.ends_with("here"));
    let began = Instant::now();
    stream.write_all(b"GET / HTTP/1.1\r\nHos").await.unwrap();
    read_to_close(&mut stream).await;
    assert_took(began.elapsed(), limits().header_timeout);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_idle_connection_is_closed_later_than_a_silent_one() {
    let server = start(limits()).await;
    let mut stream = server.connect().await;
    let began = Instant::now();
    assert!(ask(&mut stream, "GET / HTTP/1.1\r\nHost: x\r\n\r\n").await.ends_with("here"));
    read_to_close(&mut stream).await;
    assert_took(began.elapsed(), limits().idle_timeout);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_body_that_stops_coming_fails_and_the_client_hears_of_it() {
    let server = start(limits()).await;
    for head in ["Content-Length: 100\r\n\r\nabc", "Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n"] {
        let mut stream = server.connect().await;
        let began = Instant::now();
        stream.write_all(format!("POST /count HTTP/1.1\r\nHost: x\r\n{head}").as_bytes()).await.unwrap();
        let bytes = read_to_close(&mut stream).await;
        assert!(bytes.starts_with(b"HTTP/1.1 408 "), "{}", String::from_utf8_lossy(&bytes));
        assert_took(began.elapsed(), limits().body_timeout);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_slow_but_steady_body_is_taken() {
    let server = start(Limits { body_timeout: ms(2000), ..limits() }).await;
    let mut stream = server.connect().await;
    stream.write_all(b"POST /count HTTP/1.1\r\nHost: x\r\nContent-Length: 8\r\n\r\n").await.unwrap();
    for _ in 0..8 {
        tokio::time::sleep(ms(400)).await;
        stream.write_all(b"x").await.unwrap();
    }
    assert!(read_response(&mut stream).await.ends_with("\r\n\r\n8"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_body_that_waits_for_the_server_is_not_late() {
    let server = start(limits()).await;
    let mut stream = server.connect().await;
    let body = "x".repeat(4 << 20);
    let request = format!("POST /lazy HTTP/1.1\r\nHost: x\r\nContent-Length: {}\r\n\r\n{body}", body.len());
    assert!(ask(&mut stream, &request).await.ends_with("\r\n\r\n4194304"));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_at_work_is_not_idle() {
    let server = start(limits()).await;
    let mut stream = server.connect().await;
    let answer = ask(&mut stream, "GET /slow HTTP/1.1\r\nHost: x\r\n\r\n").await;
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_does_not_read_is_closed() {
    let server = start(limits()).await;
    let mut stream = server.connect().await;
    let began = Instant::now();
    stream.write_all(b"GET /endless HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
    // Writing is how a client that does not read learns that the connection is gone.
    while stream.write_all(b"x").await.is_ok() && began.elapsed() < HANG {
        tokio::time::sleep(ms(30)).await;
    }
    assert_took(began.elapsed(), limits().write_timeout);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_uploads_without_reading_is_not_closed_before_it_stops() {
    let server = start(limits()).await;
    let mut stream = loop {
        let mut stream = server.connect().await;
        stream.write_all(b"POST /duplex HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\n").await.unwrap();
        let (began, mut last, mut longest) = (Instant::now(), Instant::now(), Duration::ZERO);
        let kept = loop {
            if began.elapsed() >= 3 * limits().write_timeout {
                break true;
            }
            longest = longest.max(last.elapsed());
            last = Instant::now();
            if stream.write_all(b"x").await.is_err() {
                break false;
            }
            tokio::time::sleep(ms(100)).await;
        };
        // On a busy machine this client may have been late itself.
        if kept {
            break stream;
        }
        assert!(2 * longest > limits().body_timeout, "the connection should be kept while the upload goes on");
    };
    let stopped = Instant::now();
    // Once the buffers are read, a reset or the end is all that is left.
    tokio::time::sleep(limits().write_timeout + ms(300)).await;
    let _ = timeout(HANG, stream.read_to_end(&mut Vec::new())).await.expect("the connection stays open");
    assert_took(stopped.elapsed(), limits().write_timeout);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn http_2_silent_and_idle_connections_are_closed() {
    let server = start(limits()).await;
    let began = Instant::now();
    let mut half = server.connect().await;
    half.write_all(&HTTP2[..16]).await.unwrap();
    read_to_close(&mut half).await;
    assert_took(began.elapsed(), limits().header_timeout);

    // Preface and settings, then silence: not even an answer to the ping that asks for the end.
    let mut idle = server.connect().await;
    let began = Instant::now();
    idle.write_all(HTTP2).await.unwrap();
    read_to_close(&mut idle).await;
    assert_took(began.elapsed(), limits().idle_timeout);

    let client = crate::client().http2_prior_knowledge().build().unwrap();
    let url = format!("http://{}/peer", server.address);
    let peer = async || client.get(&url).send().await.unwrap().text().await.unwrap();
    let first = peer().await;
    assert_eq!(first, peer().await, "requests share a connection");
    tokio::time::sleep(limits().idle_timeout + ms(1200)).await;
    assert_ne!(first, peer().await, "the connection should have been closed");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn http_2_readers_that_stall_and_bodies_that_stop_are_ended() {
    let server = start(limits()).await;
    let client = crate::client().http2_prior_knowledge().build().unwrap();
    let mut response = client.get(format!("http://{}/endless", server.address)).send().await.unwrap();
    tokio::time::sleep(limits().write_timeout + ms(1000)).await;
    let read = async { while let Ok(Some(_)) = response.chunk().await {} };
    timeout(HANG, read).await.expect("the stalled stream goes on");

    let pieces = futures_util::stream::iter([Ok::<_, Infallible>("abc")]).chain(futures_util::stream::pending());
    let request = client.post(format!("http://{}/count", server.address)).body(reqwest::Body::wrap_stream(pieces));
    let response = timeout(HANG, request.send()).await.expect("the body is waited for").unwrap();
    assert_eq!(response.status(), StatusCode::REQUEST_TIMEOUT);
}
