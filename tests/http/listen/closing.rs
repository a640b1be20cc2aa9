//! Stopping the service.

use super::*;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_connections_and_with_idle_ones_stopping_is_quick() {
    assert!(start(limits()).await.stop().await < limits().drain_timeout);

    let long = Limits { idle_timeout: HANG, header_timeout: HANG, drain_timeout: HANG, ..limits() };
    let server = start(long).await;
    let silent = server.connect().await;
    let mut idle = server.connect().await;
    assert!(ask(&mut idle, "GET / HTTP/1.1\r\nHost: x\r\n\r\n").await.ends_with("here"));
    let mut half = server.connect().await;
    half.write_all(b"GET / HT").await.unwrap();
    let mut http2 = server.connect().await;
    http2.write_all(HTTP2).await.unwrap();
    tokio::time::sleep(ms(100)).await;
    let took = server.stop().await;
    // HTTP/2 and half a header are given a second to end in good order.
    assert!(took < HANG / 3, "{took:?}");
    drop((silent, half));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_request_at_work_is_finished_and_nothing_new_is_accepted() {
    let server = start(Limits { drain_timeout: HANG, ..limits() }).await;
    let address = server.address;
    let mut stream = server.connect().await;
    stream.write_all(b"GET /slow HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
    // Until it is at work, and until the port is closed.
    tokio::time::sleep(ms(400)).await;
    let stopping = tokio::spawn(server.stop());
    tokio::time::sleep(ms(400)).await;
    assert!(TcpStream::connect(address).await.is_err(), "the port is still open");
    let bytes = read_to_close(&mut stream).await;
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.starts_with("HTTP/1.1 200 ") && text.contains("connection: close"), "{text}");
    drop(stream);
    assert!(stopping.await.unwrap() < HANG / 2);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stream_without_end_is_cut_at_the_end_of_the_drain_time() {
    let server = start(limits()).await;
    let mut http1 = server.connect().await;
    http1.write_all(b"GET /ticking HTTP/1.1\r\nHost: x\r\n\r\n").await.unwrap();
    let client = crate::client().http2_prior_knowledge().build().unwrap();
    let mut http2 = client.get(format!("http://{}/ticking", server.address)).send().await.unwrap();
    assert_eq!(http2.chunk().await.unwrap().unwrap(), "tick\n");
    let stopping = tokio::spawn(server.stop());
    let bytes = read_to_close(&mut http1).await;
    assert!(bytes.windows(4).filter(|bytes| bytes == b"tick").count() > 10, "streams may go on for the drain time");
    let rest = async { while let Ok(Some(_)) = http2.chunk().await {} };
    timeout(HANG, rest).await.expect("the stream goes on");
    assert_took(stopping.await.unwrap(), limits().drain_timeout);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn work_ends_when_its_client_leaves_though_the_rest_of_the_body_was_not_read() {
    let long = Limits { body_timeout: HANG * 4, write_timeout: HANG * 4, ..limits() };
    let server = start(long).await;
    let mut client = server.connect().await;
    client.write_all(b"POST /stuck HTTP/1.1\r\nHost: x\r\nContent-Length: 100000000\r\n\r\n").await.unwrap();
    // More than is read before the handler asks for it, and no more than the system takes: behind that the end would not arrive.
    client.write_all(&vec![7; 60 << 10]).await.unwrap();
    let begun = Instant::now();
    while STUCK.load(Ordering::SeqCst) == 0 {
        assert!(begun.elapsed() < HANG, "it was not begun");
        tokio::time::sleep(ms(10)).await;
    }
    // A client that stays is worked for.
    tokio::time::sleep(ms(300)).await;
    assert_eq!(STUCK.load(Ordering::SeqCst), 1);
    drop(client);
    let left = Instant::now();
    while STUCK.load(Ordering::SeqCst) > 0 {
        assert!(left.elapsed() < HANG / 3, "it is worked on for nobody");
        tokio::time::sleep(ms(10)).await;
    }
}
