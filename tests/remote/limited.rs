//! Uploads through a proxy that limits bodies, as nginx does (`client_max_body_size`).

use crate::server::{Server, capture, ready};
use crate::support::{Dir, ENCODE, Small};
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

/// Starts a proxy that answers 413 where a body is longer than `limit`; returns its address. It ends with the test.
fn proxy(server: &str, limit: usize) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = format!("http://{}", listener.local_addr().expect("an address"));
    let server = server.to_owned();
    std::thread::spawn(move || {
        for client in listener.incoming().flatten() {
            let server = server.clone();
            std::thread::spawn(move || pass(client, &server, limit));
        }
    });
    address
}

/// Passes one request on, once it is there as a whole; ends at what is no HTTP/1.1.
fn pass(mut client: TcpStream, server: &str, limit: usize) -> Option<()> {
    let mut request = Vec::new();
    let head = loop {
        match request.windows(4).position(|window| window == b"\r\n\r\n") {
            Some(end) => break end + 4,
            None => more(&mut client, &mut request)?,
        }
    };
    let text = String::from_utf8(request[..head].to_vec()).ok()?.to_lowercase();
    if text.starts_with("pri ") {
        return None;
    }
    let length = text.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse::<usize>().ok());
    let is_chunked = text.contains("transfer-encoding: chunked");
    let is_whole = |request: &[u8]| match is_chunked {
        true => chunks_end(&request[head..]),
        false => request.len() >= head + length.unwrap_or(0),
    };
    loop {
        if length.unwrap_or(0).max(request.len() - head) > limit {
            let page = "<html><h1>413 Request Entity Too Large</h1>nginx/1.22.1</html>";
            let answer = format!(
                "HTTP/1.1 413 Request Entity Too Large\r\nContent-Type: text/html\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{page}",
                page.len()
            );
            client.write_all(answer.as_bytes()).ok()?;
            client.shutdown(std::net::Shutdown::Write).ok()?;
            client.set_read_timeout(Some(Duration::from_secs(2))).ok()?;
            while more(&mut client, &mut Vec::new()).is_some() {}
            return None;
        }
        if is_whole(&request) {
            break;
        }
        more(&mut client, &mut request)?;
    }
    let mut upstream = TcpStream::connect(server).ok()?;
    let line_end = request.windows(2).position(|window| window == b"\r\n")? + 2;
    upstream.write_all(&request[..line_end]).ok()?;
    upstream.write_all(b"Connection: close\r\n").ok()?;
    upstream.write_all(&request[line_end..]).ok()?;
    std::io::copy(&mut upstream, &mut client).ok()?;
    Some(())
}

fn more(client: &mut TcpStream, bytes: &mut Vec<u8>) -> Option<()> {
    let mut piece = [0; 64 << 10];
    let read = client.read(&mut piece).ok().filter(|read| *read > 0)?;
    bytes.extend_from_slice(&piece[..read]);
    Some(())
}

/// Whether the last chunk is there.
fn chunks_end(mut body: &[u8]) -> bool {
    while let Some(end) = body.windows(2).position(|window| window == b"\r\n") {
        let size = std::str::from_utf8(&body[..end]).ok().and_then(|size| usize::from_str_radix(size, 16).ok());
        let Some(size) = size else { return false };
        if size == 0 {
            return body.len() >= end + 4;
        }
        match body.get(end + 2 + size + 2..) {
            Some(rest) => body = rest,
            None => return false,
        }
    }
    false
}

#[test]
fn a_capture_passes_a_proxy_that_takes_a_part_of_it_at_a_time() {
    let (dir, points, _) = capture();
    let frames: Vec<Vec<f64>> = (0..60).flat_map(|_| Small::new().frames).collect();
    dir.frames("frames.npy", &frames);
    let server = Server::start(&dir);
    // Rest pose and cage pass at once; of the frames a tenth.
    let limit = (frames.len() * 12 * points / 10).max(dir.read("rest.obj").len() + dir.read("cage.obj").len() + 4096);
    let address = proxy(&server.place, limit);
    for more in ["", " --connections 3"] {
        dir.cager(&format!("{ENCODE} --server {address}{more}")).succeeds();
        let there = dir.read("out.cager");
        std::fs::remove_file(dir.path("out.cager")).expect("a file");
        dir.cager(ENCODE).succeeds();
        assert!(dir.read("out.cager") == there, "other bytes than on this machine");
        std::fs::remove_file(dir.path("out.cager")).expect("a file");
    }
}

#[test]
fn a_limit_that_no_frame_passes_is_told_with_what_to_raise() {
    let (dir, points, _) = capture();
    let server = Server::start(&dir);
    let address = proxy(&server.place, 12 * points - 1);
    let said = dir.cager(&format!("{ENCODE} --server {address}")).run();
    assert_eq!(said.status, Some(1));
    assert!(said.stderr.contains("client_max_body_size") && said.stderr.contains("413"), "{}", said.stderr);
    assert!(!said.stderr.contains("goes on"), "{}", said.stderr);

    let session = made(&server, &dir);
    let said = dir.cager(&format!("{ENCODE} --server {address} --session {session}")).run();
    assert_eq!(said.status, Some(1));
    for words in ["a single frame of", "client_max_body_size", &format!("give --session {session} as well")] {
        assert!(said.stderr.contains(words), "{words}: {}", said.stderr);
    }
    assert!(!said.stderr.contains("goes on"), "{}", said.stderr);
    assert!(!dir.path("out.cager").exists());
    // As it says.
    let raised = proxy(&server.place, 1 << 30);
    dir.cager(&format!("{ENCODE} --server {raised} --session {session}")).succeeds();
}

#[tokio::main(flavor = "current_thread")]
async fn made(server: &Server, dir: &Dir) -> String {
    ready(&server.client(), dir).await.id
}
