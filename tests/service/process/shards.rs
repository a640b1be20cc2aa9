//! Several processes on one database: any of them answers for every tenant, and what one of them had the others take over.

use super::database::refused_with;
use crate::support::{Capture, Database, OCTETS, TestApp, cages_of, eventually, folder, form, service};
use cager_proto::messages::Session;
use serde_json::json;
use std::time::{Duration, Instant};

const TENANTS: [&str; 4] =
    ["east-token-of-16-bytes", "north-token-of-16-bytes", "south-token-of-16-bytes", "west-token-of-16-bytes"];

fn first(database: &Database, settings: &[&str]) -> TestApp {
    TestApp::guarded_on(Some(database.clone()), &tokens(), settings)
}

fn tokens() -> [(&'static str, &'static str, &'static str); 4] {
    TENANTS.map(|token| (token.split('-').next().expect("a name"), token, ""))
}

/// Waits until so many processes have these numbers of shards.
async fn shared_out(database: &Database, shares: &str) {
    let sql = "SELECT coalesce(string_agg(n::text, ',' ORDER BY n), '') FROM (SELECT count(*) AS n FROM shards JOIN processes ON holder = processes.number GROUP BY holder) AS counted";
    eventually(shares, async || (database.sql(sql) == shares).then_some(())).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn any_process_answers_for_every_tenant() {
    let Some(database) = Database::with_bucket() else { return };
    let a = first(&database, &["shards=4"]);
    shared_out(&database, "4").await;
    let b = a.elsewhere().ready();
    shared_out(&database, "2,2").await;
    assert_eq!(a.log().matches("given up").count(), 2, "no more is moved than has to be:\n{}", a.log());
    let capture = Capture::small();
    let unknowns = capture.cage.model.points.len() as u32;
    for token in TENANTS {
        let (by_a, by_b) = (a.caller(Some(token)), b.caller(Some(token)));
        let key = format!("once-{token}");
        let made: Session = by_a.create_with(form(capture, &json!({})), Some(&key)).await.is(201);
        let again: Session = by_b.create_with(form(capture, &json!({})), Some(&key)).await.is(201);
        assert_eq!(made.id, again.id, "one key makes one session, whoever is asked");
        by_b.prepared(&made.id).await;
        let mut follower = by_b.open(&format!("/v1/sessions/{}/cages?first=0&follow=true", made.id)).await;
        by_a.upload(&made.id, 0, capture.raw(0..15)).await;
        by_b.upload(&made.id, 15, capture.raw(15..40)).await;
        by_b.complete(&made.id, 40).await.expect(200);
        let container = by_a.container(&made.id).await;
        assert!(container == capture.encoded(40) && container == by_b.container(&made.id).await);
        let mut followed = Vec::new();
        while let Some(piece) = follower.chunk().await.expect("cages") {
            followed.extend_from_slice(&piece);
        }
        assert_eq!(cages_of(&followed, unknowns).len(), 40);
        // Ranges and entity tags pass unchanged.
        let path = format!("/v1/sessions/{}/capture.cager", made.id);
        let part = [("range", "bytes=10-19")];
        let (one, other) = (by_a.get_with(&path, &part).await, by_b.get_with(&path, &part).await);
        assert_eq!((one.status, one.header("etag")), (206, other.header("etag")));
        assert!(one.body == other.body && one.body == container[10..20]);
        let listed = |text: String| text.matches("\"state\":\"completed\"").count();
        assert_eq!(listed(by_a.get("/v1/sessions").await.expect(200).text()), 1);
        assert_eq!(listed(by_b.get("/v1/sessions").await.expect(200).text()), 1);
        let stranger = if token == TENANTS[0] { TENANTS[1] } else { TENANTS[0] };
        b.caller(Some(stranger)).get(&format!("/v1/sessions/{}", made.id)).await.problem(404, "not-found");
    }
    // What belongs to no tenant is answered by each.
    for app in [&a, &b] {
        app.caller(None).get("/v1/sessions").await.problem(401, "unauthorized");
        app.caller(None).get("/").await.expect(200);
        app.caller(None).get("/readyz").await.expect(200);
        app.get("/v1/elsewhere").await.problem(404, "not-found");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_killed_process_had_others_go_on_with() {
    let Some(database) = Database::with_bucket() else { return };
    let mut a = first(&database, &["shards=4"]);
    let b = a.elsewhere().ready();
    shared_out(&database, "2,2").await;
    let capture = Capture::small();
    let mut made = Vec::new();
    for token in TENANTS {
        let api = b.caller(Some(token));
        let session = api.ready(capture).await;
        let told = api.upload(&session.id, 0, capture.raw(0..15)).await;
        made.push((api, session.id, told));
    }
    a.kill();
    let clock = Instant::now();
    for (api, id, told) in &made {
        assert_eq!(api.errors(id).await, *told);
    }
    let took = clock.elapsed();
    eprintln!("all tenants answered {} ms after the kill", took.as_millis());
    assert!(took < Duration::from_secs(20), "{took:?}");
    shared_out(&database, "4").await;
    for (api, id, _) in &made {
        api.upload(id, 15, capture.raw(15..40)).await;
        api.complete(id, 40).await.expect(200);
        assert!(api.container(id).await == capture.encoded(40));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn processes_are_replaced_one_after_the_other_without_a_failed_request() {
    let Some(database) = Database::with_bucket() else { return };
    // With `CAGER_TEST_OLDER` both are of an earlier version, and one of them is replaced by this one.
    let old = TestApp::older_on(&database, &tokens(), &["shards=4"]);
    let kept = old.elsewhere().ready();
    shared_out(&database, "2,2").await;
    let capture = Capture::small();
    let mut made = Vec::new();
    for token in TENANTS {
        let api = kept.caller(Some(token));
        let session = api.ready(capture).await;
        made.push((api, session.id));
    }
    // Small requests go on meanwhile, some of them with a body.
    let asking = async {
        let (mut next, mut slowest) = (0u32, Duration::ZERO);
        while next < 40 {
            for (api, id) in &made {
                let clock = Instant::now();
                api.get(&format!("/v1/sessions/{id}")).await.expect(200);
                let path = format!("/v1/sessions/{id}/frames?first={next}");
                api.post(&path, OCTETS, capture.frame(next)).await.expect(200);
                slowest = slowest.max(clock.elapsed());
            }
            next += 1;
            tokio::time::sleep(Duration::from_millis(150)).await;
        }
        slowest
    };
    let mut replaced = vec![old];
    let replacing = async {
        for k in 0..2 {
            replaced.push(replaced[k].upgraded().ready());
            shared_out(&database, "1,1,2").await;
            replaced[k].terminate();
            assert!(replaced[k].ended().await.0.success());
            shared_out(&database, "2,2").await;
        }
    };
    let (slowest, ()) = tokio::join!(asking, replacing);
    eprintln!("two processes were replaced; the slowest pair of requests took {} ms", slowest.as_millis());
    for (api, id) in &made {
        api.complete(id, 40).await.expect(200);
        assert!(api.container(id).await == capture.encoded(40));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_shard_that_cannot_be_opened_keeps_nobody_from_the_others() {
    let Some(database) = Database::with_bucket() else { return };
    let mut a = first(&database, &["shards=4"]);
    shared_out(&database, "4").await;
    for token in TENANTS {
        a.caller(Some(token)).get("/v1/sessions").await.expect(200);
    }
    a.kill();
    database.sql("UPDATE cager_3.catalogue SET version = 99");
    let a = a.again();
    shared_out(&database, "3").await;
    let b = a.elsewhere().ready();
    shared_out(&database, "1,2").await;
    assert!(a.log().contains("shard 3 cannot be served"), "{}", a.log());
    let others = database.sql("SELECT string_agg(tenant, ',') FROM tenants WHERE shard < 3");
    for token in TENANTS.iter().filter(|token| others.contains(token.split('-').next().expect("a name"))) {
        b.caller(Some(token)).get("/v1/sessions").await.expect(200);
    }
    database.sql("UPDATE cager_3.catalogue SET version = 2");
    shared_out(&database, "2,2").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_that_pass_through_a_process_end_with_it() {
    let Some(database) = Database::with_bucket() else { return };
    let a = first(&database, &["shards=4"]);
    let mut b = a.elsewhere().ready();
    shared_out(&database, "2,2").await;
    let capture = Capture::small();
    let mut followers = Vec::new();
    for token in TENANTS {
        let session = a.caller(Some(token)).ready(capture).await;
        let path = format!("/v1/sessions/{}/cages?first=0&follow=true", session.id);
        followers.push(b.caller(Some(token)).open(&path).await);
    }
    let clock = Instant::now();
    b.terminate();
    for mut follower in followers {
        // Neither looks whole.
        while follower.chunk().await.is_ok_and(|piece| piece.is_some()) {}
    }
    assert!(b.ended().await.0.success());
    assert!(clock.elapsed() < Duration::from_secs(20), "it waited for {:?}", clock.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn who_was_there_before_it_was_divided_stays_where_the_sessions_are() {
    let Some(database) = Database::with_bucket() else { return };
    let mut whole = first(&database, &[]);
    let capture = Capture::small();
    let before = whole.completed(capture, 40).await;
    whole.terminate();
    assert!(whole.ended().await.0.success());
    let tokens = whole.tokens_file().display().to_string();
    let flags = [&database.flags()[..], &["--tokens".to_owned(), tokens]].concat();
    let flags: Vec<&str> = flags.iter().map(String::as_str).collect();
    let app = whole.elsewhere_with(&["shards=3"]).ready();
    assert!(app.container(&before.id).await == capture.encoded(40));
    for token in &TENANTS[1..3] {
        app.caller(Some(token)).completed(capture, 10).await;
    }
    let spread = "SELECT string_agg(tenant || shard, ',' ORDER BY tenant) FROM tenants";
    assert_eq!(database.sql(spread), "east0,north1,south2");
    // It is not opened as a whole any more.
    let environment = database.environment();
    let said = refused_with(folder().path(), &flags, &environment);
    assert!(said.contains("is divided into shards: start the service with --shards 3"), "{said}");
    let place = folder();
    let mut everywhere = service();
    everywhere
        .args(["--listen", "0.0.0.0:0", "--shards", "3", "--data"])
        .arg(place.path())
        .args(&flags)
        .envs(environment);
    let said = String::from_utf8(everywhere.output().expect("the service").stderr).expect("text");
    assert!(said.contains("say by --advertise where they reach this one"), "{said}");
    drop(app);
    let store = |arguments: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_cager"));
        command.arg("store").args(arguments).args(database.flags()).arg("--data").arg(place.path());
        let output = command.envs(database.environment()).output().expect("it runs");
        let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        (output.status.success(), said)
    };
    let copies = folder();
    let copies = copies.path().display().to_string();
    for (arguments, good, wanted) in [
        (&["verify", "--shards", "3"][..], true, "of 3 sessions and jobs and 3 models in 3 shards"),
        (&["verify", "--shards", "3"], true, "nothing is damaged\n"),
        (&["verify", "--shards", "3", "--shard", "1"], true, "nothing is damaged in shard 1; the others were not"),
        (&["verify", "--shards", "2"], false, "the database is divided into 3; give that number"),
        (&["verify"], false, "is divided into shards"),
        (&["usage", "--shards", "3"], true, "south "),
        (&["export", &copies, "--shards", "3"], true, "wrote 3 containers"),
    ] {
        let (is_good, said) = store(arguments);
        assert!(is_good == good && said.contains(wanted), "{arguments:?}: {said}");
    }
    for (flags, why) in [
        (&["--shards", "3"][..], "shards is set but catalog is not"),
        (&["--shards", "3", "--catalog", "postgres://a@b/c"], "shards is set but tokens is not"),
        (
            &["--shards", "3", "--catalog", "postgres://a@b/c", "--tokens", "t", "--blobs", "s3://b"],
            "write s3://b/cager",
        ),
        (
            &["--shards", "3", "--catalog", "postgres://a@b/c", "--tokens", "t", "--advertise", "a:80"],
            "write an address such as http://10.0.0.5:8080",
        ),
    ] {
        let said = refused_with(folder().path(), flags, &[]);
        assert!(said.contains(why), "{said}");
    }
}
