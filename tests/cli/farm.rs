//! Shots encoded as render farms do: where a Python with `openjd-cli` and `opencue-pyoutline` is (`make farm` makes one).

#[cfg(unix)]
mod names;

use std::path::Path;
use std::process::Command;

#[test]
fn jobs_of_render_farms_encode_ranges_of_shots() {
    let Ok(python) = std::env::var("CAGER_FARM_PYTHON") else {
        eprintln!("skipped: CAGER_FARM_PYTHON is not set; `make farm` installs what it needs and runs this test");
        return;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/farm/shots.py");
    let done = Command::new(&python).arg(script).arg(env!("CARGO_BIN_EXE_cager")).output().expect("python runs");
    let (out, err) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{out}{err}");
    eprintln!("{out}");
}
