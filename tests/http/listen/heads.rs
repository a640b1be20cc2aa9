//! Headers that are too large, never end, or contradict themselves; and more connections than places.

use super::*;
use std::fmt::Write as _;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn too_many_header_lines_are_refused() {
    let server = start(limits()).await;
    let mut text = "GET / HTTP/1.1\r\nHost: x\r\n".to_owned();
    for i in 0..200 {
        write!(text, "X-{i}: y\r\n").unwrap();
    }
    text += "\r\n";
    let answer = ask(&mut server.connect().await, &text).await;
    assert!(answer.starts_with("HTTP/1.1 431 "), "{answer}");

    let client = crate::client().http2_prior_knowledge().build().unwrap();
    let mut request = client.get(format!("http://{}/", server.address));
    for i in 0..200 {
        request = request.header(format!("x-{i}"), "y");
    }
    assert_eq!(request.send().await.unwrap().status(), 431);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_header_just_below_the_limit_passes_and_one_above_does_not() {
    let server = start(Limits { max_header_bytes: 4096, ..limits() }).await;
    let request = |padding: usize| format!("GET / HTTP/1.1\r\nHost: x\r\nX: {}\r\n\r\n", "y".repeat(padding));
    let fixed = request(0).len();
    let answer = ask(&mut server.connect().await, &request(4096 - fixed)).await;
    assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
    let answer = ask(&mut server.connect().await, &request(4097 - fixed)).await;
    assert!(answer.starts_with("HTTP/1.1 431 "), "{answer}");
    assert!(answer.contains("application/problem+json") && answer.contains("\"limit\":4096"), "{answer}");
    assert!(answer.contains("\r\nx-request-id: ") && answer.contains("\"request_id\":"), "{answer}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_header_that_never_ends_is_cut_off_early() {
    let server = start(Limits { header_timeout: HANG, ..limits() }).await;
    for line in ["GET /", "GET / HTTP/1.1\r\nX: "] {
        let mut stream = server.connect().await;
        stream.write_all(line.as_bytes()).await.unwrap();
        let (mut reader, mut writer) = stream.split();
        let mut sent = 0_usize;
        let write = async {
            while writer.write_all(&[b'y'; 16 << 10]).await.is_ok() && sent < 64 << 20 {
                sent += 16 << 10;
            }
        };
        let mut answer = Vec::new();
        let (_, read) = tokio::join!(write, timeout(HANG, reader.read_to_end(&mut answer)));
        let answer = String::from_utf8_lossy(&answer);
        // The rest is what fits into the buffers of the two sockets and what is thrown away while closing.
        assert!(sent < 16 << 20, "the server took {sent} bytes of a header");
        assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
        assert!(read.is_ok());
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_declared_lengths_are_refused_whatever_their_order() {
    let server = start(limits()).await;
    let chunks = "3\r\nabc\r\n0\r\n\r\n";
    for lines in [
        "Content-Length: 3\r\nTransfer-Encoding: chunked",
        "Transfer-Encoding: chunked\r\nContent-Length: 3",
        "Content-Length: 3\r\nContent-Length: 4",
        "Content-Length: +3",
        "Transfer-Encoding: gzip",
    ] {
        let request = format!("POST /count HTTP/1.1\r\nHost: x\r\n{lines}\r\n\r\n{chunks}");
        let answer = ask(&mut server.connect().await, &request).await;
        assert!(answer.starts_with("HTTP/1.1 400 "), "{lines}: {answer}");
    }
    // On a connection that has served others, and behind an unread body, as well.
    let mut stream = server.connect().await;
    let honest = format!("POST /count HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n{chunks}");
    for _ in 0..3 {
        assert!(ask(&mut stream, &honest).await.ends_with("\r\n\r\n3"));
    }
    let smuggled = format!("POST /count HTTP/1.1\r\nTransfer-Encoding: chunked\r\nContent-Length: 3\r\n\r\n{chunks}");
    let answer = ask(&mut stream, &smuggled).await;
    assert!(answer.starts_with("HTTP/1.1 400 ") && answer.contains("connection: close"), "{answer}");
    assert!(read_to_close(&mut stream).await.is_empty());

    // Two at once: the second's header is not seen by itself, so that it may not be chunked.
    let mut stream = server.connect().await;
    stream.write_all(format!("{honest}{smuggled}").as_bytes()).await.unwrap();
    let bytes = read_to_close(&mut stream).await;
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains("HTTP/1.1 200 ") && text.contains("HTTP/1.1 400 "), "{text}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn connections_beyond_the_limit_get_one_answer_and_silent_ones_make_way() {
    let few = Limits { max_connections: 2, spare_connections: 2, header_timeout: HANG, ..limits() };
    let server = start(few).await;
    // At work, as idle ones make way after a second.
    let mut busy = [server.connect().await, server.connect().await];
    for stream in &mut busy {
        stream.write_all(b"GET /ticking HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
        stream.read_u8().await.unwrap();
    }

    let mut health = server.connect().await;
    assert!(ask(&mut health, "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n").await.ends_with("ok"));
    assert!(read_to_close(&mut health).await.is_empty(), "a spare connection is closed after its answer");
    drop(health);
    let client = crate::client().http2_prior_knowledge().build().unwrap();
    let refused = client.get(format!("http://{}/", server.address)).send().await.unwrap();
    assert_eq!((refused.status().as_u16(), &refused.headers()["retry-after"]), (503, &"1".parse().unwrap()));
    drop((refused, client));

    tokio::time::sleep(ms(300)).await;
    let mut spare = [server.connect().await, server.connect().await];
    tokio::time::sleep(ms(100)).await;
    // The spare connection that has said nothing for longest makes way.
    let began = Instant::now();
    let mut third = server.connect().await;
    assert!(read_to_close(&mut spare[0]).await.is_empty());
    assert!(began.elapsed() < HANG / 3, "{:?}", began.elapsed());
    for stream in [&mut spare[1], &mut third] {
        let answer = ask(stream, "GET / HTTP/1.1\r\nHost: x\r\n\r\n").await;
        assert!(answer.starts_with("HTTP/1.1 503 ") && answer.contains("retry-after: 1"), "{answer}");
    }

    // A place that becomes free is used again.
    drop((busy, spare, third));
    placed(&server).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn handlers_know_their_peer() {
    let server = start(limits()).await;
    let mut stream = server.connect().await;
    let peer = stream.local_addr().unwrap().to_string();
    assert!(ask(&mut stream, "GET /peer HTTP/1.1\r\nHost: x\r\n\r\n").await.ends_with(&peer));
}
