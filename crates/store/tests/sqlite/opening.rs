//! What is opened, and what is refused.

use crate::conformance::{append, cage, open};
use crate::support::{Dir, file, folder_of_child, with_small_disk};
use cager_store::{Catalog, CatalogError, SqliteCatalog};
use std::os::unix::fs::PermissionsExt as _;

fn refused(path: &std::path::Path) -> CatalogError {
    SqliteCatalog::open(path).map(drop).expect_err("it was opened")
}

#[test]
fn a_file_that_is_no_database_is_damaged_and_left_as_it_is() {
    let dir = Dir::new();
    let text = b"this is a text of some length, as others have it in their files. ".repeat(100);
    std::fs::write(dir.file(), &text).expect("written");
    assert_eq!(refused(&dir.file()), CatalogError::Corrupt("file is not a database".to_owned()));
    assert!(std::fs::read(dir.file()).expect("the file") == text);
}

#[test]
fn a_newer_version_is_left_as_it_is() {
    let dir = Dir::new();
    open(&dir.open(), "a");
    dir.beside().run("PRAGMA user_version = 2");
    let error = refused(&dir.file());
    assert_eq!(error, CatalogError::Newer { found: 2, known: 1 });
    assert!(error.to_string().contains("has version 2, and this program knows versions up to 1"), "{error}");
    dir.beside().run("PRAGMA user_version = 1");
    assert_eq!(dir.open().records().expect("records").len(), 1);
}

#[test]
fn an_empty_file_becomes_a_catalogue() {
    let dir = Dir::new();
    std::fs::write(dir.file(), b"").expect("written");
    let catalog = dir.open();
    open(&catalog, "a");
    assert_eq!(dir.beside().number("PRAGMA auto_vacuum"), 2, "it gives room back in steps");
    assert_eq!(dir.beside().number("PRAGMA user_version"), 1);
}

#[test]
fn what_cannot_be_opened_says_why() {
    let dir = Dir::new();
    for (path, why) in [
        (dir.path().join("missing/catalogue"), "No such file or directory"),
        (dir.path().to_owned(), "directory"),
        (std::path::PathBuf::new(), "No such file or directory"),
    ] {
        let error = refused(&path).to_string();
        assert!(error.contains(why), "{error}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).expect("the folder").count(), 0);
}

#[test]
fn all_files_are_for_their_user_alone() {
    let dir = Dir::new();
    let catalog = dir.open();
    open(&catalog, "a");
    append(&catalog, "a", &[(0, cage(0, 4))]);
    let files = std::fs::read_dir(dir.path()).expect("the folder").map(|file| file.expect("a file"));
    let mut files: Vec<_> = files.map(|file| (file.file_name(), file.metadata().expect("its mode"))).collect();
    files.sort_by_key(|(name, _)| name.clone());
    let names: Vec<_> = files.iter().map(|(name, _)| name.to_string_lossy()).collect();
    assert_eq!(names, ["catalogue", "catalogue-shm", "catalogue-wal", "catalogue.reserve"]);
    for (name, metadata) in &files {
        assert_eq!(metadata.permissions().mode() & 0o777, 0o600, "{name:?}");
    }
}

#[test]
fn a_vanished_file_is_not_made_anew_by_reading() {
    let dir = Dir::new();
    let catalog = dir.open();
    std::fs::remove_file(dir.file()).expect("removed");
    assert!(catalog.records().is_err());
    assert!(!dir.file().exists());
}

#[test]
fn a_read_only_disk_is_refused() {
    with_small_disk("opening::child_with_a_read_only_disk", 32);
}

#[test]
#[ignore = "another test starts it"]
fn child_with_a_read_only_disk() {
    let Some(folder) = folder_of_child() else { return };
    let (old, new) = (file(&folder), folder.join("new"));
    open(&SqliteCatalog::open(&old).expect("a catalogue"), "a");
    let mount = |options: &str| {
        let mut command = std::process::Command::new("mount");
        let done = command.args(["-o", options]).arg(&folder).output().expect("mount");
        assert!(done.status.success(), "{done:?}");
    };
    mount("remount,ro");
    for path in [&old, &new] {
        let error = refused(path);
        assert!(error.to_string().contains("Read-only file system"), "{error}");
    }
    mount("remount,rw");
    assert_eq!(SqliteCatalog::open(&old).expect("a catalogue").records().expect("records").len(), 1);
}
