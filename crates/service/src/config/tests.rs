use super::*;
use clap::Parser as _;
use std::fs;

#[derive(clap::Parser)]
struct Line {
    #[command(flatten)]
    flags: ServeFlags,
}

fn flags(line: &str) -> ServeFlags {
    Line::parse_from(std::iter::once("serve").chain(line.split_whitespace())).flags
}

fn load(file: &str, env: &[(&str, &str)], line: &str) -> Result<ServeConfig, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cager.toml");
    fs::write(&path, file).unwrap();
    let env = env.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
    let loaded = ServeConfig::load(Some(&path), env, &flags(line)).map_err(|error| error.to_string());
    let named = |text: String| text.replace(&*folder.path().to_string_lossy(), "DIR");
    loaded.map_err(named)
}

#[test]
fn every_default_is_possible() {
    for (name, value) in &toml::Table::try_from(ServeConfig::default()).unwrap() {
        settings::read(name, value).unwrap().unwrap();
    }
}

#[test]
fn later_layers_override_earlier_ones() {
    let file = "max_streams = 1\nmax_requests = 1\nmax_preparing = 1\nworkers = 1\ncache_bytes = \"3 GiB\"\nupload_bytes = 1048576\nmax_rest_bytes = 1048576";
    let env = [("CAGER_MAX_REQUESTS", "2"), ("CAGER_MAX_PREPARING", "2"), ("CAGER_WORKERS", "2"), ("HOME", "/x")];
    let config =
        load(file, &env, "--set max-preparing=3 --set workers=3 --workers 4 --set frame_bytes=1MB2").unwrap_err();
    assert!(config.contains("--set frame_bytes: frame_bytes = \"1MB2\": write a size from 1 MiB"), "{config}");
    let config = load(file, &env, "--set max-preparing=3 --set workers=3 --workers 4").unwrap();
    assert_eq!((config.max_streams, config.max_requests, config.max_preparing, config.workers), (1, 2, 3, 4));
    assert_eq!((config.cache_bytes, config.upload_bytes, config.frame_bytes), (3 << 30, 1 << 20, 256 << 20));
    assert_eq!(config.origins["workers"], Origin::Flag("--workers".to_owned()));
    assert_eq!(config.origins["max_requests"], Origin::Environment("CAGER_MAX_REQUESTS".to_owned()));
    assert!(!config.origins.contains_key("frame_bytes"));
    assert_eq!(config.admin_listen, None);
    let config = load("", &[], "--admin-listen --workers 4").unwrap();
    assert_eq!(config.admin_listen, Some("127.0.0.1:8081".parse().unwrap()), "operators of this machine");
}

#[test]
fn mistakes_name_their_place_and_what_to_do() {
    for (file, env, line, wanted) in [
        (
            "max_stream = 1",
            &[][..],
            "",
            "file DIR/cager.toml: unknown setting max_stream, did you mean max_streams?; --check-config",
        ),
        ("[tenant]\nx = 1", &[], "", "file DIR/cager.toml: unknown setting tenant; --check-config"),
        ("listen = \"0.0.0.0\"", &[], "", "listen = \"0.0.0.0\": write ADDRESS:PORT"),
        ("workers = -1", &[], "", "workers = -1: write a whole number from 0 to 4096"),
        ("workers = 1.5", &[], "", "workers = 1.5: write a whole number"),
        ("cache_bytes = \"1 GX\"", &[], "", "cache_bytes = \"1 GX\": write a size from 0 B to 1024 TiB"),
        ("body_timeout_s = 0", &[], "", "body_timeout_s = 0: write a whole number from 1 to 86400"),
        ("tokens = 3", &[], "", "tokens = 3: write the path"),
        ("log = \"xml\"", &[], "", "log = \"xml\": write \"human\" or \"json\""),
        ("log_filter = \"cager=loud\"", &[], "", "write a level such as info"),
        ("log_filter = \"inof\"", &[], "", "inof is no level, did you mean info?; write a level such as info"),
        ("log_filter = \"hyper=warn, Warning\"", &[], "", "Warning is no level, did you mean warn?; write"),
        ("log_filter = \"[s{a,b=info\"", &[], "", "write a level such as info"),
        (
            "catalog = \"host=db password=secret\"",
            &[],
            "",
            "catalog = ***: write the address of a database, such as postgres://",
        ),
        ("allowed_origins = [\"foo\"]", &[], "", "foo is no origin: write one such as https://tools.studio"),
        ("", &[], "--set allowed_origins=https://tools.studio/", "https://tools.studio/ is no origin"),
        ("allowed_hosts = [\"https://cager.studio\"]", &[], "", "https://cager.studio is no name of a host"),
        ("", &[], "--set allowed_hosts=cager.studio,b:80,a:b", "a:b is no name of a host"),
        ("listen = \"127.0.0.1:99999\"", &[], "", "write ADDRESS:PORT"),
        ("", &[], "--listen 127.0.0.1:80 --admin-listen 127.0.0.1:80", "listen and admin_listen are both 127.0.0.1:80"),
        ("workers = 1\nworkers = 2", &[], "", "DIR/cager.toml: line 2: "),
        ("", &[("CAGER_MAX_STREAM", "1")], "", "environment CAGER_MAX_STREAM: unknown setting max_stream"),
        ("", &[("CAGER_WORKERS", "many")], "", "environment CAGER_WORKERS: workers = \"many\": write"),
        ("", &[], "--set workers", "--set workers: write --set KEY=VALUE"),
        ("", &[], "--set wrokers=1", "flag --set wrokers: unknown setting wrokers, did you mean workers?"),
        ("", &[], "--tls-key k.pem", "tls_key is set but tls_certificate is not"),
    ] {
        let error = load(file, env, line).unwrap_err();
        assert!(error.contains(wanted), "{file:?} {env:?} {line:?}\n  {error}\n  {wanted}");
    }
    let error = ServeConfig::load(Some(Path::new("no/such.toml")), std::iter::empty(), &flags("")).unwrap_err();
    assert!(error.to_string().starts_with("no/such.toml: cannot be read: "), "{error}");
    assert!(std::error::Error::source(&error).is_none(), "it would be told twice");
}

#[test]
fn filters_of_the_log_may_name_crates_spans_and_their_fields() {
    for filter in [
        "WARN",
        "off",
        "3",
        "hyper",
        "info,hyper",
        "info,cager_service::http=debug",
        "[s{a,b,c}]=info",
        "warn,h2[s{a=1,b}]",
    ] {
        assert_eq!(load("", &[], &format!("--log-filter {filter}")).unwrap().log_filter, filter);
    }
    for filter in ["", "info", "hyper", "debug,hyper=info", "hyper=info,debug,[s]=trace"] {
        let known = tracing_subscriber::EnvFilter::try_new(filter).unwrap();
        assert_eq!(crate::telemetry::log_filter(filter).unwrap().to_string(), known.to_string());
    }
}

#[test]
fn who_looks_at_what_is_stored_needs_no_tokens() {
    let flags = flags("--listen 0.0.0.0:80 --catalog postgres://db/x");
    assert!(ServeConfig::load(None, std::iter::empty(), &flags).is_err());
    assert!(ServeConfig::load_stored(None, std::iter::empty(), &flags).is_ok());
}

#[test]
fn files_that_are_missing_are_told_before_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("tokens.toml");
    fs::write(&good, format!("[[token]]\nname = \"a\"\ntenant = \"a\"\nsha256 = \"{}\"", "0".repeat(64))).unwrap();
    let empty = folder.path().join("empty.toml");
    fs::write(&empty, "").unwrap();
    let (good, empty) = (good.display(), empty.display());
    for (line, wanted) in [
        ("--tokens none.toml", "none.toml: cannot be read"),
        ("--set webhooks=none.toml", "none.toml: cannot be read"),
        ("--set audit=none/audit.jsonl", "none/audit.jsonl: cannot be written"),
        ("--tls-certificate c.pem --tls-key k.pem", "c.pem: cannot be read"),
        (&format!("--tokens {empty}"), "line 1: there is no token in it"),
        ("--catalog postgres://u@h:99999/d", "catalog: the address of the database cannot be used: invalid"),
        ("--catalog postgres://u@h/d?sslmode=foo", "sslmode is disable, prefer, require, verify-ca or verify-full"),
        ("--catalog postgres://u@h/d?sslmode=require&sslrootcert=none.pem", "sslrootcert none.pem: "),
        ("--catalog postgres://u@h/d?sslmod=require", "catalog: the address of the database cannot be used: "),
        ("--catalog postgres://u:p@x@h/d", "written %40"),
        ("--catalog postgres:///d", "it names no host"),
        ("--catalog postgres://u@h/d --blobs bucket/path", "blobs: \"bucket/path\" is no place for files"),
        ("--catalog postgres://u@h/d --blobs s3://k@b/path", "keys and endpoints do not belong into it"),
        (&format!("--data {good}/data"), "tokens.toml is no folder"),
        (&format!("--data {good}"), "tokens.toml is no folder"),
        ("--data /proc/none/data", "data: /proc/none/data: cannot be written by this user"),
        (
            "--catalog postgres://u@h/d --blobs file:///proc/none/b",
            "blobs: /proc/none/b: cannot be written by this user",
        ),
        (&format!("--catalog postgres://u@h/d --blobs file://{good}"), "tokens.toml is no folder"),
        ("--set oidc_issuer=login.studio --set oidc_audience=cager", "oidc_issuer: "),
        ("--set oidc_issuer=http://login.studio --set oidc_audience=cager", "oidc_issuer: "),
        ("--set oidc_issuer=https://a --set oidc_audience=c --set oidc_keys=keys.json", "oidc_keys: "),
    ] {
        let error = load("", &[], line).unwrap().check_files().unwrap_err();
        assert!(format!("{error:#}").contains(wanted), "{error:#}");
    }
    let config =
        load("", &[], &format!("--tokens {good} --set webhooks={empty} --set audit={empty} --data {empty}-data"))
            .unwrap();
    config.check_files().unwrap();
}

#[test]
fn others_may_use_the_prefix_in_the_environment() {
    // What Kubernetes sets for a service of this name, and what the client commands read.
    let env = [("CAGER_SERVICE_HOST", "10.0.0.1"), ("CAGER_PORT", "tcp://10.0.0.1:80"), ("CAGER_TOKEN", "secret")];
    let config = load("", &env, "").unwrap();
    assert_eq!(config, ServeConfig::default());
}

#[test]
fn paths_in_a_file_are_relative_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cager.toml");
    fs::write(&path, "data = \"store\"\ntokens = \"/etc/tokens.toml\"").unwrap();
    let env = [("CAGER_CONFIG".to_owned(), path.to_str().unwrap().to_owned())];
    let config = ServeConfig::load(None, env.into_iter(), &flags("")).unwrap();
    assert_eq!(config.data, folder.path().join("store"));
    assert_eq!(config.tokens.as_deref(), Some(Path::new("/etc/tokens.toml")));
    let config = ServeConfig::load(Some(&path), std::iter::empty(), &flags("--data here")).unwrap();
    assert_eq!(config.data, Path::new("here"));
}

#[test]
fn without_tokens_only_this_machine_is_let_in() {
    for address in ["127.0.0.1:0", "[::1]:80", "127.9.9.9:1", "localhost:8080"] {
        load("", &[], &format!("--listen {address}")).unwrap();
    }
    for address in ["0.0.0.0:80", "[::]:80", "192.168.0.1:80", "[::ffff:127.0.0.1]:80"] {
        let error = load("", &[("CAGER_LISTEN", address)], "").unwrap_err();
        assert!(error.contains("openssl rand -hex 32") && error.contains("--tokens"), "{error}");
        load("", &[], &format!("--listen {address} --tokens t.toml")).unwrap();
    }
}

#[test]
fn the_shown_settings_can_be_read_again_and_name_their_origins() {
    let given = load("max_rest_bytes = 1500\nlog = \"json\"", &[("CAGER_WORKERS", "2")], "--data a\"b").unwrap();
    let text = given.check_config();
    let line = |start: &str| text.lines().find(|line| line.starts_with(start)).unwrap_or_default();
    assert!(line("workers = 2 ").ends_with("# environment CAGER_WORKERS"), "{text}");
    assert!(line("max_rest_bytes = \"1500 B\" ").contains("# file "), "{text}");
    assert!(line("cache_bytes = \"2 GiB\" ").ends_with("# default"), "{text}");
    assert!(line("# tokens is not set").ends_with("# default"), "{text}");
    let mut again = load(&text, &[], "--data a\"b").unwrap();
    again.origins = given.origins.clone();
    assert_eq!(again, given);
    assert_eq!(settings::names().count(), text.lines().count());
}
