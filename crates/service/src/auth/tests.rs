use super::*;
use http::HeaderValue;
use std::fmt::Write as _;
use std::fs;

const DEFAULTS: TenantLimits = TenantLimits { max_sessions: 10, max_bytes: 1000, max_age_s: 60, max_streams: 4 };
const FIRST: &str = "0123456789abcdef-first";
const SECOND: &str = "0123456789abcdef-second";

fn hex(token: &str) -> String {
    Sha256::digest(token).iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

fn entry(name: &str, tenant: &str, token: &str, more: &str) -> String {
    format!("[[token]]\nname = \"{name}\"\ntenant = \"{tenant}\"\nsha256 = \"{}\"\n{more}\n", hex(token))
}

fn open(text: &str) -> (tempfile::TempDir, Result<Access, AccessError>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tokens.toml");
    fs::write(&path, text).unwrap();
    let access = Access::open(Some(&path), DEFAULTS);
    (folder, access)
}

fn with(value: &str) -> HeaderMap {
    HeaderMap::from_iter([(AUTHORIZATION, HeaderValue::from_str(value).unwrap())])
}

fn bearer(token: &str) -> HeaderMap {
    with(&format!("Bearer {token}"))
}

#[test]
fn without_a_file_everyone_is_local() {
    let access = Access::open(None, DEFAULTS).unwrap();
    for headers in [HeaderMap::new(), bearer("whatever")] {
        let tenant = access.authenticate(&headers).unwrap().tenant;
        assert_eq!((tenant.name.as_str(), tenant.limits), (LOCAL, DEFAULTS));
    }
}

#[test]
fn tokens_tell_tenants_with_their_priorities_and_limits() {
    let text = entry("farm", "a", FIRST, "priority = \"low\"\nmax_sessions = 3\nmax_age_s = 0")
        + &entry("artist", "a", SECOND, "priority = \"high\"\nmax_bytes = 1");
    let (_folder, access) = open(&text);
    let access = access.unwrap();
    let farm = access.authenticate(&bearer(FIRST)).unwrap().tenant;
    assert_eq!((farm.name.as_str(), farm.priority), ("a", Priority::Low));
    assert_eq!(farm.limits, TenantLimits { max_sessions: 3, max_age_s: 0, ..DEFAULTS });
    let artist = access.authenticate(&with(&format!("bEaReR   {SECOND} "))).unwrap().tenant;
    assert_eq!((artist.priority, artist.limits.max_bytes), (Priority::High, 1));

    let both = access.tenant("a");
    assert_eq!(both.priority, Priority::High);
    assert_eq!(both.limits, TenantLimits { max_sessions: 10, max_bytes: 1000, max_age_s: 0, max_streams: 4 });
    assert_eq!(access.tenant("gone").limits, DEFAULTS);
}

#[test]
fn a_tenant_with_one_token_has_exactly_its_limits() {
    let (_folder, access) = open(&entry("one", "a", FIRST, "max_sessions = 1\nmax_age_s = 5"));
    let tenant = access.unwrap().tenant("a");
    assert_eq!(tenant.limits, TenantLimits { max_sessions: 1, max_age_s: 5, ..DEFAULTS });
}

#[test]
fn other_headers_are_denied() {
    let (_folder, access) = open(&entry("one", "a", FIRST, ""));
    let access = access.unwrap();
    // A second header might be meant for another reader of the same request.
    let mut twice = bearer(FIRST);
    twice.append(AUTHORIZATION, HeaderValue::from_static("Bearer another-one-of-them"));
    assert_eq!(access.authenticate(&twice), Err(Denied::Malformed));
    let not_text = HeaderMap::from_iter([(AUTHORIZATION, HeaderValue::from_bytes(b"Bearer \xff\xfe").unwrap())]);
    for (headers, denied) in [
        (HeaderMap::new(), Denied::Missing),
        (with(FIRST), Denied::Malformed),
        (with("Bearer "), Denied::Malformed),
        (with(&format!("Basic {FIRST}")), Denied::Malformed),
        (not_text, Denied::Malformed),
        (bearer("short"), Denied::Unknown),
        (bearer(&"x".repeat(100_000)), Denied::Unknown),
        (bearer(&hex(FIRST)), Denied::Unknown),
        (bearer(&FIRST[1..]), Denied::Unknown),
        (bearer(&FIRST.to_uppercase()), Denied::Unknown),
    ] {
        assert_eq!(access.authenticate(&headers), Err(denied), "{headers:?}");
    }
}

#[test]
fn the_place_of_an_entry_makes_no_difference() {
    let tokens: Vec<_> = (0..5).map(|i| format!("0123456789abcdef-{i}")).collect();
    let text: String =
        tokens.iter().enumerate().map(|(i, token)| entry(&format!("n{i}"), &format!("t{i}"), token, "")).collect();
    let (_folder, access) = open(&text);
    let access = access.unwrap();
    for (i, token) in tokens.iter().enumerate() {
        assert_eq!(access.authenticate(&bearer(token)).unwrap().tenant.name, format!("t{i}"));
    }
    assert_eq!(access.authenticate(&bearer("0123456789abcdef-5")), Err(Denied::Unknown));
}

#[test]
fn mistakes_name_file_and_line_and_show_no_hash() {
    let good = entry("one", "a", FIRST, "");
    let secret = hex(SECOND);
    let written = |name: &str, tenant: &str, hash: &str| {
        format!("{good}[[token]]\nname = \"{name}\"\ntenant = \"{tenant}\"\nsha256 = \"{hash}\"\n")
    };
    for (text, wanted) in [
        (String::new(), "line 1: there is no token in it"),
        ("# nobody\n".to_owned(), "line 1: there is no token in it"),
        (written("two", "b", &secret[..63]), "line 9: sha256 must be 64 hexadecimal digits"),
        (written("two", "b", &format!("{}é", &secret[..62])), "line 9: sha256 must be"),
        (written("one", "b", &secret), "line 7: name one is used by another token, in line 2"),
        (written("two", "b", &hex(FIRST)), "line 9: another entry has the same token"),
        (written("two", "../b", &secret), "line 8: tenant must be 1 to 64 letters"),
        (written("", "b", &secret), "line 7: name must be"),
        (written("two", "b", &secret) + "priority = \"urgent\"", "line 10: "),
        (written("two", "b", &secret) + "max_session = 3", "line 10: "),
        (written("two", "b", &secret) + "max_bytes = -3", "line 10: "),
        (format!("{good}[[token]]\nname = \"{secret}"), "line 7: "),
        (format!("{good}[[token]]\nname = {secret}"), "line 7: "),
        (format!("{good}[[token]]\nname = \"x\"\npriority = \"{secret}\""), "line "),
        (format!("{good}[[tokens]]\nname = \"x\""), "line 6: "),
        (format!("{good}[[token]]\nname = \"x\""), "line 6: "),
    ] {
        let (_folder, access) = open(&text);
        let error = access.unwrap_err().to_string();
        assert!(error.contains("tokens.toml: ") && error.contains(wanted), "{error}\n  {wanted}");
        assert!(!error.contains(&secret[..16]) && !error.contains(&hex(FIRST)[..16]), "{error}");
    }
    let error = Access::open(Some(Path::new("no/tokens.toml")), DEFAULTS).unwrap_err().to_string();
    assert!(error.starts_with("no/tokens.toml: cannot be read ("), "{error}");
}

#[test]
fn debug_output_shows_no_hash() {
    let (_folder, access) = open(&entry("one", "a", FIRST, ""));
    let text = format!("{:?}", access.unwrap());
    assert!(text.contains("\"a\"") && !text.contains(&hex(FIRST)[..8]), "{text}");
    let bytes = format!("{:?}", &Sha256::digest(FIRST)[..4]);
    assert!(!text.contains(bytes.trim_matches(['[', ']'])), "{text}");
}

#[tokio::test]
async fn a_file_that_is_being_rewritten_revokes_nothing() {
    let text = entry("one", "a", FIRST, "") + &entry("two", "b", SECOND, "");
    let (folder, access) = open(&text);
    let (path, access) = (folder.path().join("tokens.toml"), access.unwrap());
    let stop = CancellationToken::new();
    let watching = tokio::spawn(access.clone().watch(stop.clone()));
    let granted = access.authenticate(&bearer(SECOND)).unwrap();
    let (mut last, mut longest) = (Instant::now(), Duration::ZERO);
    for _ in 0..30 {
        // Emptied, half of it, and whole.
        for part in ["", text.split_at(text.len() / 2).0, &text] {
            fs::write(&path, part).unwrap();
            tokio::time::sleep(Duration::from_millis(30)).await;
            longest = longest.max(last.elapsed());
            last = Instant::now();
        }
    }
    // On a busy machine the file may have stood still for that long.
    assert!(!granted.revoked.is_cancelled() || longest > SETTLED_FOR / 2);
    stop.cancel();
    watching.await.unwrap();
}

#[tokio::test]
async fn changes_of_the_file_are_noticed() {
    let (folder, access) = open(&(entry("one", "a", FIRST, "") + &entry("two", "b", SECOND, "")));
    let (path, access) = (folder.path().join("tokens.toml"), access.unwrap());
    let stop = CancellationToken::new();
    let watching = tokio::spawn(access.clone().watch(stop.clone()));
    let settle = || tokio::time::sleep(Duration::from_millis(1600));
    let known = |token| access.authenticate(&bearer(token)).is_ok();
    let become_known = async |first, second| {
        let begun = Instant::now();
        while (known(FIRST), known(SECOND)) != (first, second) {
            assert!(begun.elapsed() < Duration::from_secs(20), "not noticed");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    assert!(known(FIRST) && known(SECOND));

    // Revoked, by rewriting in place.
    fs::write(&path, entry("one", "a", FIRST, "")).unwrap();
    become_known(true, false).await;

    // Broken: what was there stays.
    fs::write(&path, "[[token]\n").unwrap();
    settle().await;
    assert!(known(FIRST) && !known(SECOND));

    // Emptied, or without an entry: that is a mishap, and locks nobody out.
    for text in ["", "# none\n"] {
        fs::write(&path, text).unwrap();
        settle().await;
        assert!(known(FIRST) && !known(SECOND));
    }

    // Replaced, as Kubernetes and careful editors do.
    let other = folder.path().join("other");
    fs::write(&other, entry("two", "b", SECOND, "")).unwrap();
    fs::rename(&other, &path).unwrap();
    become_known(false, true).await;

    // Gone for a moment.
    fs::remove_file(&path).unwrap();
    settle().await;
    assert!(known(SECOND));
    fs::write(&path, entry("one", "a", FIRST, "")).unwrap();
    become_known(true, false).await;

    stop.cancel();
    watching.await.unwrap();
}
