//! The service within a container's walls: no root, no capabilities, nothing to write but one folder.

use crate::support::{FRAMES, Service, cager, ends_within, succeeds, write_capture};
use cager::remote::{RemoteCage, RemoteJob, encode_remotely, mesh_file};
use cager_client::MemoryFrames;
use cager_client::messages::SessionOptions;
use rustix::process::{Pid, Signal, getuid, kill_process};
use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, chown};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// As in the image.
const USER: u32 = 65532;

/// Makes every mount read-only but for the folder $1, gives all privileges up, and becomes what follows.
const WALLS: &str = r#"
set -eu
data=$1; shift
mount --make-rprivate /
mount --bind "$data" "$data"
while read -r _ point _; do
    [ "$point" = "$data" ] || mount -o remount,bind,ro "$point" 2>/dev/null || true
done < /proc/self/mounts
mount -o remount,bind,rw "$data"
for folder in / /tmp /var/tmp /dev/shm; do
    if [ -d "$folder" ] && touch "$folder/.cager-probe" 2>/dev/null; then
        rm -f "$folder/.cager-probe"; echo "$folder can be written"; exit 99
    fi
done
"#;
const UNPRIVILEGED: &str = "exec setpriv --no-new-privs --bounding-set=-all --inh-caps=-all --ambient-caps=-all";

/// A way to build the walls that works here.
struct Walls {
    unshare: &'static [&'static str],
    root: bool,
}

impl Walls {
    fn find(data: &Path) -> Option<Self> {
        let root = getuid().is_root();
        // Who is not root is so in a namespace of its own only.
        let walls = Self { unshare: if root { &["--mount"] } else { &["--user", "--map-root-user", "--mount"] }, root };
        let tried = walls.command(data, &["true".as_ref()]).stdin(Stdio::null()).output();
        match tried {
            Ok(tried) if tried.status.success() => Some(walls),
            tried => {
                eprintln!("\n*** SKIPPED: this machine does not let a test wall a process in: {tried:?} ***\n");
                None
            }
        }
    }

    fn command(&self, data: &Path, what: &[&std::ffi::OsStr]) -> Command {
        let user = format!(" --reuid={USER} --regid={USER} --clear-groups");
        let script = format!("{WALLS}{UNPRIVILEGED}{} -- \"$@\"", if self.root { &user } else { "" });
        let mut command = Command::new("unshare");
        command.args(self.unshare).args(["sh", "-c", &script, "sh"]).arg(data).args(what);
        command.env_clear().env("PATH", std::env::var_os("PATH").unwrap_or_default());
        command
    }
}

#[test]
fn a_service_without_rights_on_a_read_only_system_encodes_and_ends_in_time() {
    let outside = tempfile::tempdir().expect("a folder");
    let data = outside.path().join("data");
    fs::create_dir(&data).expect("a folder");
    // The program may lie where only this user looks.
    let program = outside.path().join("cager");
    fs::copy(env!("CARGO_BIN_EXE_cager"), &program).expect("a copy");
    for path in [outside.path(), &program] {
        fs::set_permissions(path, Permissions::from_mode(0o755)).expect("permissions");
    }
    if getuid().is_root() {
        chown(&data, Some(USER), Some(USER)).expect("another owner");
    }
    let Some(walls) = Walls::find(&data) else { return };
    let store = data.join("store");
    let serve = ["serve", "--listen", "127.0.0.1:0", "--log-filter", "warn", "--data"].map(std::ffi::OsStr::new);
    let line: Vec<_> = [program.as_os_str()].into_iter().chain(serve).chain([store.as_os_str()]).collect();
    let mut service = Service::of(walls.command(&data, &line));

    let status = fs::read_to_string(format!("/proc/{}/status", service.child.id())).expect("its account");
    let field = |name: &str| {
        let line = status.lines().find(|line| line.starts_with(name)).unwrap_or_default();
        line.split_whitespace().nth(1).unwrap_or_default().to_owned()
    };
    assert_eq!(field("Name:"), "cager", "{status}");
    assert_eq!((field("CapEff:"), field("CapBnd:")), ("0".repeat(16), "0".repeat(16)));
    assert_eq!(field("NoNewPrivs:"), "1");
    if walls.root {
        assert_eq!((field("Uid:"), field("Gid:")), (USER.to_string(), USER.to_string()));
    }
    let ready = succeeds(cager().args(["health", "--address", &service.address]));
    assert_eq!(ready.stdout, b"ready\n");

    encode_through(&service.url(), outside.path());
    kill_process(Pid::from_child(&service.child), Signal::TERM).expect("a signal");
    let ended = ends_within(&mut service.child, Duration::from_secs(10));
    assert_eq!(ended.code(), Some(0), "{ended}");
    let done = cager().args(["health", "--address", &service.address]).output().expect("the program runs");
    assert_eq!(done.status.code(), Some(1));
}

fn encode_through(address: &str, folder: &Path) {
    write_capture(folder);
    let bytes = fs::read(folder.join("frames.f32")).expect("frames");
    let values: Vec<f32> = bytes.as_chunks().0.iter().map(|&value| f32::from_le_bytes(value)).collect();
    let job = RemoteJob {
        address,
        token: None,
        rest: mesh_file(&folder.join("rest.obj")).expect("a rest pose"),
        cage: RemoteCage::File(&folder.join("cage.obj")),
        session: None,
        matrix: None,
        frames: MemoryFrames::new(values.len() / 3 / FRAMES, values),
        output: &cager_formats::Target::from(folder.join("capture.cager")),
        options: SessionOptions::default(),
        connections: 1,
    };
    let done = encode_remotely(job, &mut |_| ()).expect("the service encodes");
    assert_eq!(done.encoded.report.frames, FRAMES);
    assert!(done.encoded.report.error.l2_max < 0.05);
}
