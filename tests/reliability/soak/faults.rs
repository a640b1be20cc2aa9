//! Files that cannot be read, are gone or are damaged when the service starts again: done to a copy of its data, so that the clients of
//! the original never see it.

use super::ledger::Ledger;
use crate::process::{HANG, Server, Setup};
use cager_client::messages::Session;
use fastrand::Rng;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What is done to a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fault {
    /// A folder lies in its place, which nobody can read, not even an administrator.
    Unreadable,
    /// It is not there.
    Gone,
    /// A byte of it is another.
    Damaged,
}

const FAULTS: [Fault; 3] = [Fault::Unreadable, Fault::Gone, Fault::Damaged];

/// A check that takes longer is told of.
const LONG: Duration = Duration::from_secs(3);

/// How often what was done to which file.
pub(crate) type Done = BTreeMap<(String, Fault), u64>;

/// Starts a service on a copy of `data` in which one file is as it should not be. What the ledger knows has to hold there, but for the
/// session that the file belongs to: it may say that it is damaged, and may not say that it is whole and lack what was answered. A file
/// that could not be read is put back, and then everything has to hold.
pub(crate) async fn check(data: &Path, ledger: &Ledger, rng: &mut Rng, done: &mut Done) {
    let (clock, folder) = (Instant::now(), tempfile::tempdir().expect("a folder"));
    let copy = folder.path().join("data");
    copied(data, &copy);
    let Some((path, session)) = chosen(&copy, ledger, rng) else { return };
    let fault = FAULTS[rng.usize(..FAULTS.len())];
    *done.entry((kind(&path), fault)).or_default() += 1;
    let aside = folder.path().join("aside");
    match fault {
        Fault::Unreadable => {
            std::fs::rename(&path, &aside).expect("a file");
            std::fs::create_dir(&path).expect("a folder");
        }
        Fault::Gone => std::fs::remove_file(&path).expect("a file"),
        Fault::Damaged => {
            let mut bytes = std::fs::read(&path).expect("a file");
            if !bytes.is_empty() {
                let place = rng.usize(..bytes.len());
                bytes[place] ^= 1 << rng.u8(..8);
            }
            std::fs::write(&path, bytes).expect("a file");
        }
    }
    let before = ledger.violations().len();
    let server = Setup::new(&copy, &[]).start().await;
    ledger.check_some(&server, session.as_deref(), 10).await;
    if fault == Fault::Unreadable {
        if let Some(id) = &session
            && let Some(status @ (404 | 410)) = server.get(&format!("/v1/sessions/{id}")).await
        {
            ledger.violation(format!("{id} answers {status} although nothing of it is gone"));
        }
        std::fs::remove_dir(&path).expect("a folder");
        std::fs::rename(&aside, &path).expect("a file");
        if let Some(id) = &session {
            readable_again(&server, id).await;
            ledger.check_one(&server, id).await;
        }
    }
    if clock.elapsed() > LONG {
        println!("soak: {:.1} s with a {} that was {fault:?}", clock.elapsed().as_secs_f64(), path.display());
    }
    if ledger.violations().len() > before {
        ledger.violation(format!("these on a copy whose {} was {fault:?}", path.display()));
    }
}

/// Waits until the service has noticed.
async fn readable_again(server: &Server, id: &str) {
    let clock = Instant::now();
    loop {
        let answer = reqwest::get(server.url(&format!("/v1/sessions/{id}"))).await.expect("an answer");
        if answer.status() == 200 {
            let session: Session = answer.json().await.expect("a session");
            if session.problem.is_none() {
                return;
            }
        }
        assert!(clock.elapsed() < HANG, "{id} is not served again");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// A file with the session that it belongs to, if it is a session's.
fn chosen(data: &Path, ledger: &Ledger, rng: &mut Rng) -> Option<(PathBuf, Option<String>)> {
    let mut files: Vec<(PathBuf, Option<String>)> = Vec::new();
    for id in ledger.ids() {
        files.extend(files_in(&data.join("sessions").join(&id)).map(|path| (path, Some(id.clone()))));
    }
    // Each kind of file as often as the others, however many of them there are.
    files.extend(files_in(&data.join("prepared")).map(|path| (path, None)));
    let mut names: Vec<String> = files.iter().map(|(path, _)| kind(path)).collect();
    names.sort_unstable();
    names.dedup();
    let wanted = names.get(rng.usize(..names.len().max(1)))?.clone();
    files.retain(|(path, _)| kind(path) == wanted);
    files.sort_unstable();
    Some(files.swap_remove(rng.usize(..files.len())))
}

fn kind(path: &Path) -> String {
    match path.extension() {
        Some(extension) if extension == "solver" => "solver".to_owned(),
        _ => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    }
}

fn files_in(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|entry| entry.path().is_file()).map(|entry| entry.path())
}

fn copied(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder").flatten() {
        let target = to.join(entry.file_name());
        match entry.path().is_dir() {
            true => copied(&entry.path(), &target),
            false => drop(std::fs::copy(entry.path(), target).expect("a file")),
        }
    }
}
