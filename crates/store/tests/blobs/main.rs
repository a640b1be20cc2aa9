//! Files in a bucket: a folder that behaves as one, and S3 where SeaweedFS is installed.

mod support;

use cager_store::{Blobs, Listed};
use std::io::{ErrorKind, Read as _, Seek as _};
use std::path::Path;
use std::time::{Duration, Instant};
use support::Server;

/// What opens the same place for the process that has taken the database as the so-manieth.
type Open<'a> = &'a dyn Fn(i64) -> Blobs;

/// Does the same in a folder and in S3.
fn everywhere(story: impl Fn(Open<'_>, &Path)) {
    let here = tempfile::tempdir().expect("a folder");
    let url = format!("file://{}/bucket", here.path().display());
    story(&|taken| Blobs::open(&url, taken, []).expect("a folder"), here.path());
    let Some(server) = Server::start() else { return };
    let here = tempfile::tempdir().expect("a folder");
    story(&|taken| server.open("some/place", taken).expect("a bucket"), here.path());
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> std::path::PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a file");
    path
}

fn content(blobs: &Blobs, path: &str) -> Vec<u8> {
    let mut file = tempfile::tempfile().expect("a file");
    let bytes = blobs.fetch(path, &file).expect("fetched");
    let mut content = Vec::new();
    file.rewind().and_then(|()| file.read_to_end(&mut content)).expect("read");
    assert_eq!((content.len() as u64, blobs.bytes(path)), (bytes, Some(bytes)));
    content
}

fn noise(bytes: usize) -> Vec<u8> {
    (0..bytes as u64).map(|at| (at.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56) as u8).collect()
}

#[test]
fn files_are_stored_listed_replaced_and_removed() {
    everywhere(|open, here| {
        let blobs = open(1);
        assert!(blobs.is_empty());
        blobs.probe().expect("writes");
        // Several parts, and an end that is no whole one.
        let large = noise((40 << 20) + 12345);
        blobs.put_file("sessions/a/capture.cager", &write(here, "large", &large)).expect("stored");
        blobs.put_file("sessions/a/group-0000000000", &write(here, "small", b"one")).expect("stored");
        blobs.put_file("sessions/ab/empty", &write(here, "empty", b"")).expect("stored");
        blobs.put_file("number", &write(here, "number", b"7")).expect("stored");
        for blobs in [&blobs, &open(1), &open(2)] {
            assert!(content(blobs, "sessions/a/capture.cager") == large);
            assert_eq!(content(blobs, "sessions/ab/empty"), b"");
            assert!(
                blobs.has_folder("sessions/a") && !blobs.has_folder("session") && !blobs.has_folder("sessions/a/x")
            );
            let folders = [("a", true, 0), ("ab", true, 0)];
            let files = [("capture.cager", false, large.len() as u64), ("group-0000000000", false, 3)];
            for (folder, listed) in [("sessions", folders), ("sessions/a", files)] {
                let listed = listed.map(|(name, is_folder, bytes)| Listed { name: name.to_owned(), is_folder, bytes });
                assert_eq!(blobs.list(folder), listed, "{folder}");
            }
        }
        // By this process and by the next one.
        blobs.put_file("number", &write(here, "number", b"88")).expect("stored");
        let next = open(2);
        next.put_file("number", &write(here, "number", b"999")).expect("stored");
        assert_eq!(content(&open(3), "number"), b"999");
        next.remove("number").expect("removed");
        next.remove("sessions/a").expect("removed");
        next.remove("sessions/a").expect("nothing to be removed");
        for blobs in [next, open(3)] {
            assert_eq!(blobs.bytes("number"), None);
            assert_eq!(blobs.list("sessions/a"), []);
            assert_eq!(content(&blobs, "sessions/ab/empty"), b"");
            let file = tempfile::tempfile().expect("a file");
            assert_eq!(blobs.fetch("number", &file).expect_err("gone").kind(), ErrorKind::NotFound);
        }
    });
}

#[test]
fn what_is_written_bit_by_bit_is_put_together_again() {
    everywhere(|open, _| {
        let blobs = open(4);
        blobs.put_piece("sessions/a/frames-0000000000", 4, b"4567").expect("stored");
        blobs.put_piece("sessions/a/frames-0000000000", 0, b"0123").expect("stored");
        assert_eq!(content(&blobs, "sessions/a/frames-0000000000"), b"01234567");
        // A shorter one replaces no more than it has.
        blobs.put_piece("sessions/a/frames-0000000000", 4, b"ab").expect("stored");
        let next = open(5);
        assert_eq!(content(&next, "sessions/a/frames-0000000000"), b"0123ab67");
        next.put_piece("sessions/a/frames-0000000000", 3, b"C").expect("stored");
        assert_eq!(content(&open(6), "sessions/a/frames-0000000000"), b"012Cab67");
    });
}

#[test]
fn a_process_that_was_taken_over_changes_no_file_of_the_next_one() {
    everywhere(|open, here| {
        let before = open(1);
        before.put_file("sessions/a/capture.cager", &write(here, "old", b"old")).expect("stored");
        let after = open(2);
        after.put_file("sessions/a/capture.cager", &write(here, "new", b"newer")).expect("stored");
        // It was on its way.
        before.put_file("sessions/a/capture.cager", &write(here, "old", b"late")).expect("stored");
        assert_eq!(content(&after, "sessions/a/capture.cager"), b"newer");
        assert_eq!(content(&open(3), "sessions/a/capture.cager"), b"newer");
        before.put_file("sessions/a/other", &write(here, "old", b"late")).expect("stored");
        after.remove("sessions/a").expect("removed");
        assert!(open(3).is_empty(), "what was sent late goes too");
    });
}

#[test]
fn after_a_database_was_restored_what_is_written_counts() {
    everywhere(|open, here| {
        let before = open(7);
        before.put_file("contents/k/rest", &write(here, "old", b"old")).expect("stored");
        before.put_piece("sessions/a/frames-0000000000", 0, b"old").expect("stored");
        // It counts takeovers of before.
        for taken in [6, 6] {
            let now = open(taken);
            now.put_file("contents/k/rest", &write(here, "new", b"newer")).expect("stored");
            now.put_piece("sessions/a/frames-0000000000", 1, b"ew").expect("stored");
            assert_eq!(content(&open(taken), "contents/k/rest"), b"newer");
            assert_eq!(content(&open(taken), "sessions/a/frames-0000000000"), b"oew");
        }
    });
}

#[test]
fn nothing_is_stored_in_what_was_removed_for_good() {
    everywhere(|open, here| {
        let blobs = open(1);
        blobs.put_piece("sessions/a/frames-0000000000", 0, b"old").expect("stored");
        blobs.remove_for_good("sessions/a").expect("removed");
        let late = blobs.put_piece("sessions/a/frames-0000000000", 3, b"late").expect_err("gone");
        assert_eq!(late.kind(), ErrorKind::NotFound);
        let late = blobs.put_file("sessions/a/capture.cager", &write(here, "late", b"late")).expect_err("gone");
        assert_eq!(late.kind(), ErrorKind::NotFound);
        blobs.put_file("sessions/ab/capture.cager", &write(here, "other", b"other")).expect("another one");
        // What is removed otherwise may come again.
        blobs.remove("sessions/ab").expect("removed");
        blobs.put_file("sessions/ab/capture.cager", &write(here, "other", b"other")).expect("stored");
        assert_eq!(open(2).list("sessions").len(), 1);
    });
}

#[test]
fn folders_get_other_names_with_all_that_is_in_them() {
    everywhere(|open, here| {
        let blobs = open(1);
        blobs.put_file("sessions/a/capture.cager", &write(here, "one", b"one")).expect("stored");
        for (offset, bytes) in [(0, &b"01"[..]), (2, b"23")] {
            blobs.put_piece("sessions/a/frames-0000000000", offset, bytes).expect("stored");
        }
        blobs.rename("sessions/a", "quarantine/a").expect("renamed");
        for blobs in [blobs, open(2)] {
            assert_eq!(blobs.list("sessions"), []);
            assert_eq!(content(&blobs, "quarantine/a/capture.cager"), b"one");
            assert_eq!(content(&blobs, "quarantine/a/frames-0000000000"), b"0123");
        }
    });
}

#[test]
fn addresses_that_are_none_and_services_that_do_not_answer_are_told() {
    let refused = |url: &str| Blobs::open(url, 1, []).expect_err(url).to_string();
    for url in ["", "bucket", "http://bucket/x", "file://relative", "s3://", "s3:///path"] {
        assert!(refused(url).contains("give s3://bucket/path"), "{}", refused(url));
    }
    let secret = refused("s3://key:secret@host/bucket");
    assert!(secret.contains("AWS_ACCESS_KEY_ID") && !secret.contains("key:secret"), "{secret}");
    let of = |endpoint: &str| {
        [("AWS_ENDPOINT_URL", endpoint), ("AWS_ACCESS_KEY_ID", "a"), ("AWS_SECRET_ACCESS_KEY", "b")]
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
    };
    let began = Instant::now();
    let nobody = Blobs::open("s3://bucket/x", 1, of("http://127.0.0.1:9")).expect_err("nobody there").to_string();
    assert!(nobody.starts_with("s3://bucket/x: ") && nobody.contains("refused"), "{nobody}");
    assert!(began.elapsed() < Duration::from_secs(15), "{:?}", began.elapsed());
    let open = Blobs::open("s3://bucket/x", 1, of("http://farm.example:9000")).expect_err("not encrypted").to_string();
    assert!(open.contains("http://farm.example:9000") && open.contains("AWS_ALLOW_HTTP"), "{open}");
}

#[test]
fn a_bucket_that_is_away_is_told_and_serves_again_when_it_is_back() {
    let Some(mut server) = Server::start() else { return };
    let here = tempfile::tempdir().expect("a folder");
    let blobs = server.open("x", 1).expect("a bucket");
    let kept = noise(100_000);
    for number in 0..20 {
        blobs.put_file(&format!("kept/{number}"), &write(here.path(), "kept", &kept)).expect("stored");
    }
    server.kill();
    let began = Instant::now();
    let error = blobs.put_file("lost/1", &write(here.path(), "lost", b"lost")).expect_err("nobody there");
    assert!(error.to_string().starts_with("s3://cager/x: "), "{error}");
    assert!(began.elapsed() < Duration::from_secs(15), "{:?}", began.elapsed());
    assert_eq!(blobs.bytes("lost/1"), None);
    blobs.remove("kept/3").expect_err("nobody there");
    assert_eq!(blobs.bytes("kept/3"), None, "nobody relies on what may be gone");
    server.run();
    blobs.put_file("more", &write(here.path(), "more", b"more")).expect("stored");
    let again = server.open("x", 2).expect("a bucket");
    assert_eq!(again.list("kept").len(), 20, "what could not be removed comes back");
    for listed in again.list("kept") {
        assert!(
            content(&again, &format!("kept/{}", listed.name)) == kept,
            "what was acknowledged is there after a crash"
        );
    }
    let wrong = Blobs::open(
        &server.url("x"),
        1,
        [
            ("AWS_ENDPOINT_URL".to_owned(), server.environment()[0].1.clone()),
            ("AWS_ACCESS_KEY_ID".to_owned(), "somebody".to_owned()),
            ("AWS_SECRET_ACCESS_KEY".to_owned(), "unknown".to_owned()),
        ],
    );
    let wrong = wrong.expect_err("a wrong key").to_string();
    assert!(wrong.contains("InvalidAccessKeyId") && !wrong.contains("unknown"), "{wrong}");
}
