//! What is opened, and what is refused.

use crate::conformance::open;
use crate::support::Server;
use cager_store::{Catalog, CatalogError, PostgresCatalog};
use std::time::{Duration, Instant};

fn refused(url: &str) -> CatalogError {
    PostgresCatalog::open(url).map(drop).expect_err("it was opened")
}

/// That it names the place, not the password, and comes in time.
fn says(url: &str, what: &[&str]) {
    let began = Instant::now();
    let error = refused(url).to_string();
    assert!(began.elapsed() < Duration::from_secs(6), "after {:?}", began.elapsed());
    assert!(what.iter().all(|what| error.contains(what)) && !error.contains("secret"), "{error}");
}

#[test]
fn a_newer_version_is_left_as_it_is() {
    let Some(server) = Server::start() else { return };
    open(&server.open(), "a");
    server.sql("UPDATE catalogue SET version = 5");
    assert_eq!(refused(&server.url()), CatalogError::Newer { found: 5, known: 4 });
    server.sql("UPDATE catalogue SET version = 4");
    assert_eq!(server.open().records().expect("records").len(), 1);
}

#[test]
fn processes_that_start_at_once_make_the_tables_once() {
    let Some(server) = Server::start() else { return };
    let opened: Vec<PostgresCatalog> = std::thread::scope(|scope| {
        let all: Vec<_> = (0..6).map(|_| scope.spawn(|| server.open())).collect();
        all.into_iter().map(|one| one.join().expect("opened")).collect()
    });
    open(&opened[0], "a");
    assert!(opened.iter().all(|catalog| catalog.records().expect("records").len() == 1));
    assert_eq!(server.sql("SELECT count(*), max(version) FROM catalogue"), "1|4");
}

#[test]
fn schemas_keep_catalogues_apart() {
    let Some(server) = Server::start() else { return };
    open(&server.open(), "a");
    let other = |path: &str| format!("{}?options=-csearch_path%3D{path}", server.url());
    let catalog = PostgresCatalog::open(&other("other_one")).expect("a catalogue");
    assert_eq!(catalog.records(), Ok(Vec::new()));
    assert!(refused(&other("a,b")).to_string().contains("search_path"));
}

#[test]
fn of_several_hosts_one_that_is_there_and_takes_writes_is_used() {
    let Some(server) = Server::start() else { return };
    let url = format!("{}?target_session_attrs=read-write", server.url().replace('@', "@127.0.0.1:1,"));
    open(&PostgresCatalog::open(&url).expect("a catalogue"), "a");
    server.sql("ALTER DATABASE postgres SET default_transaction_read_only = on");
    says(&url, &["127.0.0.1:1 or ", "takes no writes"]);
}

#[test]
fn a_server_that_is_not_there_is_told_in_time() {
    says("postgres://me:secret@127.0.0.1:1/data", &["127.0.0.1:1", "database data", "cannot be reached"]);
    says("postgres://me:secret@192.0.2.1/data", &["192.0.2.1:5432", "database data"]);
    says("postgres://me:secret@127.0.0.1:port/data", &["postgres://USER:PASSWORD@HOST"]);
    says("mysql://me:secret@127.0.0.1/data", &["postgres://"]);
}

#[test]
fn a_wrong_password_is_told() {
    let Some(server) = Server::start() else { return };
    server.sql("CREATE ROLE guarded LOGIN PASSWORD 'right'");
    let hba = "local all guarded scram-sha-256\nlocal all all trust\n";
    std::fs::write(server.folder().join("data/pg_hba.conf"), hba).expect("written");
    server.sql("SELECT pg_reload_conf()");
    std::thread::sleep(Duration::from_millis(300));
    says(&server.url_of("guarded:secret"), &["refuses this user", "database postgres", "28P01"]);
    // The password is right, and then the user may not make a schema.
    says(&server.url_of("guarded:right"), &["right to do so"]);
    says(&server.url_of("guarded"), &["password"]);
}

#[test]
fn tables_of_others_in_the_same_schema_are_left_alone() {
    let Some(server) = Server::start() else { return };
    server
        .sql("CREATE SCHEMA cager; CREATE TABLE cager.tenants (name text); INSERT INTO cager.tenants VALUES ('mine')");
    open(&server.open(), "a");
    assert_eq!(server.sql("SELECT name FROM cager.tenants"), "mine");
}
