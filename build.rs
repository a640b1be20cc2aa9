//! The version that `cager --version` tells: that of the package, and the commit where it is known.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-env-changed=CAGER_COMMIT");
    let version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let known = std::env::var("CAGER_COMMIT").ok().filter(|commit| !commit.is_empty());
    if known.is_none()
        && let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"])
    {
        println!("cargo::rerun-if-changed={log}");
    }
    let commit = known.or_else(|| git(&["rev-parse", "--short=10", "HEAD"]));
    let commit = commit.map_or_else(String::new, |commit| format!(" ({commit})"));
    println!("cargo::rustc-env=CAGER_VERSION={version}{commit}");
}

/// What git says in this folder; none without git, or outside a repository.
fn git(arguments: &[&str]) -> Option<String> {
    let said = Command::new("git").args(arguments).output().ok().filter(|said| said.status.success())?;
    Some(String::from_utf8(said.stdout).ok()?.trim().to_owned()).filter(|text| !text.is_empty())
}
