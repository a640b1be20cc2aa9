//! `cager store`: what a service has stored, while it does not run.

use crate::cli::{print, tell};
use anyhow::{Context as _, Result, bail};
use cager_formats::{AtomicFile, Target};
use cager_service::config::{ServeConfig, ServeFlags};
use cager_service::store::{CAGE, Completion, Kind, LocalDisk, Opened, Shared, Store, StoredPart, Verified};
use clap::{Args, Subcommand};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Look after what a service has stored, while it does not run: how much that is, whether it is
/// whole, copies of its containers.
///
/// Example: cager store verify --data /srv/cager
#[derive(Args)]
pub(crate) struct StoreArgs {
    #[command(subcommand)]
    command: StoreCommand,

    /// The service's data folder [default: cager-data].
    #[arg(long, global = true, value_name = "DIR")]
    data: Option<PathBuf>,

    /// The service's database, where it has one. A password is safer in the variable CAGER_CATALOG.
    #[arg(long, global = true, value_name = "URL")]
    catalog: Option<String>,

    /// The service's bucket, where it has one.
    #[arg(long, global = true, value_name = "URL")]
    blobs: Option<String>,

    /// The service's file of settings, TOML.
    #[arg(long, global = true, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// The file of a capture.
const CONTAINER: &str = "capture.cager";

/// What to do with what is stored.
#[derive(Subcommand)]
pub(crate) enum StoreCommand {
    /// Sessions, jobs and bytes of each tenant.
    Usage,
    /// Read everything, and name what is damaged; exit status 1 if something is.
    Verify,
    /// Copy the containers of completed sessions, recoveries and transfers to a folder, as
    /// TENANT/ID.cager, and designed cages, as TENANT/ID.obj; those that are there are passed over,
    /// damaged ones are named and left out, with exit status 1.
    Export {
        /// Where to; it may be there.
        #[arg(value_name = "DIR")]
        output: PathBuf,
        /// Only this session or job; may be repeated.
        #[arg(long = "session", value_name = "ID")]
        sessions: Vec<String>,
    },
}

pub(super) fn run(args: &StoreArgs) -> Result<()> {
    let opened = open(args)?;
    match &args.command {
        StoreCommand::Usage => usage(&opened),
        StoreCommand::Verify => verify(&opened),
        StoreCommand::Export { output, sessions } => export(&opened, output, sessions),
    }
}

/// Opens what is stored.
fn open(args: &StoreArgs) -> Result<Opened> {
    let flags = ServeFlags {
        data: args.data.clone(),
        catalog: args.catalog.clone(),
        blobs: args.blobs.clone(),
        config: args.config.clone(),
        ..ServeFlags::default()
    };
    let config = ServeConfig::load_stored(args.config.as_deref(), std::env::vars(), &flags)?;
    // In a bucket is all that there is.
    if config.blobs.is_none() {
        check_folder(&config.data)?;
    }
    let shared = Shared {
        catalog: config.catalog.as_deref(),
        blobs: config.blobs.as_deref(),
        kept_bytes: config.blobs_kept_bytes,
    };
    Ok(Store::open(&config.data, Arc::new(LocalDisk), shared)?)
}

/// Refuses what is no service's folder, before anything is made there.
fn check_folder(data: &Path) -> Result<()> {
    let why = match fs::metadata(data) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => "there is no such folder",
        Err(error) => return Err(error).with_context(|| format!("{}: cannot be looked into", data.display())),
        Ok(there) if !there.is_dir() => "is a file, not a folder",
        Ok(_) if !Store::is_in(data) => "no service's data is here",
        Ok(_) => return Ok(()),
    };
    bail!("{}: {why}; name the service's data folder by --data", data.display())
}

/// Kind, id and tenant of all sessions and jobs, by kind, oldest first.
fn objects(opened: &Opened) -> Vec<(Kind, &str, &str)> {
    let mut all: Vec<(Kind, &str, &str)> = Vec::new();
    all.extend(opened.sessions.iter().map(|meta| (Kind::Session, &meta.id[..], &meta.tenant[..])));
    all.extend(opened.cage_jobs.iter().map(|meta| (Kind::CageJob, &meta.id[..], &meta.tenant[..])));
    all.extend(opened.recoveries.iter().map(|meta| (Kind::Recovery, &meta.id[..], &meta.tenant[..])));
    all.extend(opened.transfers.iter().map(|meta| (Kind::Transfer, &meta.id[..], &meta.tenant[..])));
    all
}

#[derive(Default)]
struct Use {
    sessions: usize,
    jobs: usize,
    bytes: u64,
}

fn usage(opened: &Opened) -> Result<()> {
    let mut tenants = BTreeMap::<&str, Use>::new();
    let store = &opened.store;
    for (kind, id, tenant) in objects(opened) {
        let of = tenants.entry(tenant).or_default();
        match kind {
            Kind::Session => of.sessions += 1,
            _ => of.jobs += 1,
        }
        of.bytes += store.bytes(kind, id)?;
    }
    let mut keys = BTreeSet::new();
    for session in &opened.sessions {
        let of = tenants.entry(&session.tenant).or_default();
        of.bytes += store.frame_bytes(&session.id)?;
        // Sessions with the same model share it.
        if keys.insert(session.key) {
            of.bytes += store.content_bytes(&session.key)?;
        }
    }
    let mut text = format!("{:<24} {:>9} {:>9} {:>16}\n", "tenant", "sessions", "jobs", "bytes");
    let mut sum = Use::default();
    for (tenant, Use { sessions, jobs, bytes }) in &tenants {
        text += &format!("{tenant:<24} {sessions:>9} {jobs:>9} {bytes:>16}\n");
        sum = Use { sessions: sum.sessions + sessions, jobs: sum.jobs + jobs, bytes: sum.bytes + bytes };
    }
    text += &format!("{:<24} {:>9} {:>9} {:>16}\n", "all", sum.sessions, sum.jobs, sum.bytes);
    print(&text)
}

fn verify(opened: &Opened) -> Result<()> {
    let (mut bytes, mut damaged, mut objects_read, mut models) = (0, 0, 0, 0);
    let mut note = |what: &str, id: &str, tenant: &str, found: Verified| -> Result<()> {
        bytes += found.bytes;
        damaged += usize::from(!found.damage.is_empty());
        found.damage.iter().try_for_each(|why| print(&format!("{what} {id} of {tenant}: {why}\n")))
    };
    let store = &opened.store;
    for (kind, id, tenant) in objects(opened) {
        objects_read += 1;
        note(kind.name(), id, tenant, store.verify(kind, id)?)?;
    }
    let mut keys = BTreeSet::new();
    for session in opened.sessions.iter().filter(|session| keys.insert(session.key)) {
        models += 1;
        note("model of the session", &session.id, &session.tenant, store.verify_content(&session.key))?;
    }
    for aside in &opened.quarantined {
        damaged += 1;
        print(&format!("{}: {}; it is in {}\n", aside.name, aside.why, aside.path.display()))?;
    }
    tell(&format!("read {bytes} bytes of {objects_read} sessions and jobs and {models} models\n"))?;
    if damaged > 0 {
        bail!(
            "{damaged} of them are damaged; complete the sessions again whose containers are, restore the others from \
             a backup, or delete them"
        );
    }
    print("nothing is damaged\n")
}

/// The file that is wanted of a session or job; `None` where it has none yet.
fn wanted_file(store: &Store, kind: Kind, id: &str) -> Result<Option<StoredPart>> {
    if kind == Kind::Session {
        let mark = store.completion(id)?;
        return Ok(mark.map(|Completion { container_bytes: bytes, container_digest: blake3, .. }| StoredPart {
            name: CONTAINER.to_owned(),
            bytes,
            blake3,
        }));
    }
    Ok(store.results(kind, id)?.into_iter().find(|part| [CONTAINER, CAGE].contains(&&*part.name)))
}

fn export(opened: &Opened, output: &Path, wanted: &[String]) -> Result<()> {
    let (store, all) = (&opened.store, objects(opened));
    if let Some(unknown) = wanted.iter().find(|id| all.iter().all(|(_, known, _)| known != id)) {
        bail!("there is no session or job {unknown}");
    }
    fs::create_dir_all(output).with_context(|| format!("{}: cannot be made", output.display()))?;
    let (mut written, mut there, mut running, mut left) = (0, 0, 0, 0);
    for (kind, id, tenant) in all.into_iter().filter(|(_, id, _)| wanted.is_empty() || wanted.iter().any(|w| w == id)) {
        let copied = match wanted_file(store, kind, id) {
            Ok(None) => {
                running += 1;
                continue;
            }
            Ok(Some(part)) => copy(store, (kind, id), &part, &output.join(tenant)),
            Err(error) => Err(error),
        };
        match copied {
            Ok(true) => written += 1,
            Ok(false) => there += 1,
            Err(why) => {
                left += 1;
                print(&format!("{} {id} of {tenant}: {why:#}\n", kind.name()))?;
            }
        }
    }
    tell(&format!(
        "wrote {written} files, and {there} were there already; {running} sessions and jobs are not completed and have \
         none\n"
    ))?;
    if left > 0 {
        bail!("files left out, for the reasons above: {left}");
    }
    Ok(())
}

/// Copies a file that is whole, unless the same is there: so that what was stopped goes on. Whether it was copied.
fn copy(store: &Store, (kind, id): (Kind, &str), part: &StoredPart, folder: &Path) -> Result<bool> {
    let damage = match kind {
        Kind::Session => store.completion(id)?.and_then(|mark| store.container_damage(id, &mark)),
        _ => store.result_damage(kind, id, part),
    };
    if let Some(why) = damage {
        bail!(why);
    }
    let ending = Path::new(&part.name).extension().unwrap_or_default().display();
    let path = folder.join(format!("{id}.{ending}"));
    let failed = || format!("{}: the file cannot be written", path.display());
    if path.try_exists().with_context(failed)? {
        if part.is_of(&path).with_context(failed)? {
            return Ok(false);
        }
        bail!("{} has another content; move it away, or name another folder", path.display());
    }
    fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    let mut stored = store.open_file(&store.job_file(kind, id, &part.name)?)?;
    let mut file = AtomicFile::create(Target::New(path.clone())).with_context(failed)?;
    io::copy(&mut stored, &mut file).with_context(failed)?;
    file.commit().with_context(failed)?;
    Ok(true)
}
