//! Files that operators write.

use crate::Target;
use cager_service::auth::{Access, TenantLimits};
use cager_service::config::{ServeConfig, ServeFlags};
use std::cell::RefCell;
use std::fs::File;
use std::io::{Seek, Write};
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

const FIXED: usize = 4 << 20;

pub(super) const TOKENS: Target = Target {
    name: "tokens",
    run: tokens,
    seeds: || {
        let two = "[[token]]\nname = \"farm\"\ntenant = \"studio-a\"\nsha256 = \"9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08\"\n\
                   priority = \"high\"\nmax_sessions = 100\nmax_bytes = 5\nmax_age_s = 0\nmax_streams = 3\n\
                   [[token]]\nname = 'b'\ntenant = \"\"\"studio-b\"\"\"\nsha256 = \"0000000000000000000000000000000000000000000000000000000000000000\"\n";
        vec![two.into(), b"# nothing\n".to_vec(), b"token = []".to_vec()]
    },
    words: &[
        "[[token]]\n",
        "name = \"a\"\n",
        "tenant = \"t\"\n",
        "sha256 = \"",
        "priority = \"low\"\n",
        "max_sessions = ",
        "max_bytes = ",
        "\"\"\"",
        "'''",
        "\\u0000",
        "{}",
        "[",
        "0x7fffffffffffffff",
        "1979-05-27",
        "inf",
        "true",
        "=",
        ".",
    ],
    fixed: FIXED,
    per_byte: 4096,
};

pub(super) const CONFIG: Target = Target {
    name: "config",
    run: config,
    seeds: || {
        let some = "listen = \"127.0.0.1:0\"\ndata = \"d\"\ntokens = \"/t\"\nlog = \"json\"\nlog_filter = \"info,cager_service::http=debug\"\n\
                    workers = 2\nframe_bytes = \"512 MiB\"\nmax_rest_bytes = 1_000_000\nheader_timeout_s = \"7\"\n";
        vec![some.into(), b"max_header_bytes = \"32 KiB\"\ntenant_max_bytes='1 TiB'\n".to_vec()]
    },
    words: &[
        "listen = ",
        "data = ",
        "tokens = ",
        "tls_certificate = ",
        "tls_key = ",
        "log = ",
        "log_filter = ",
        "workers = ",
        "cache_bytes = ",
        "max_streams = ",
        "drain_timeout_s = ",
        "\"[::1]:80\"",
        "\"localhost:1\"",
        "\" TiB\"",
        "\"",
        "'",
        "[a]",
        "{b=1}",
        "KiB",
        "=trace",
        "[{x=1}]=info",
        ",",
    ],
    fixed: FIXED,
    per_byte: 4096,
};

thread_local! {
    static SCRATCH: RefCell<Option<(PathBuf, File)>> = const { RefCell::new(None) };
}

/// A file without a name, so that nothing stays; in memory where the system offers it as a folder.
fn scratch() -> (PathBuf, File) {
    let file = tempfile::tempfile_in("/dev/shm").or_else(|_| tempfile::tempfile()).expect("a scratch file");
    (PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd())), file)
}

fn with_file<T>(bytes: &[u8], f: impl FnOnce(&Path) -> T) -> T {
    SCRATCH.with_borrow_mut(|kept| {
        let (path, file) = kept.get_or_insert_with(scratch);
        let written = file.set_len(0).and_then(|()| file.rewind()).and_then(|()| file.write_all(bytes));
        written.expect("a scratch file");
        f(path)
    })
}

fn tokens(bytes: &[u8]) {
    let limits = TenantLimits { max_sessions: 1, max_bytes: 1, max_age_s: 0, max_streams: 1 };
    with_file(bytes, |path| match Access::open(Some(path), limits) {
        Ok(access) => assert!(access.is_guarded()),
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with(&path.display().to_string()), "{text}");
            // Never quotes what may be a hash.
            let longest = text.split(|c: char| !c.is_ascii_hexdigit()).map(str::len).max().unwrap_or(0);
            assert!(longest < 60, "{text}");
        }
    });
}

fn config(bytes: &[u8]) {
    with_file(bytes, |path| match ServeConfig::load(Some(path), std::iter::empty(), &ServeFlags::default()) {
        Ok(config) => {
            assert!(config.listen.ip().is_loopback() || config.tokens.is_some(), "open to everyone");
            assert_eq!(config.tls_certificate.is_some(), config.tls_key.is_some());
            assert!(config.max_streams > 0 && config.max_header_bytes >= 1024 && config.header_timeout_s > 0);
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    });
}
