//! From Blender to cages and back, in Blender itself: where a Python with `bpy` is (`make blender` makes one).

use std::path::Path;
use std::process::Command;

#[test]
fn an_animation_and_its_edited_cages_make_the_round_trip_through_blender() {
    let python = std::env::var("CAGER_BLENDER_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found = Command::new(&python).args(["-c", "import bpy, numpy"]).output();
    if !found.is_ok_and(|found| found.status.success()) {
        eprintln!("skipped: {python} has no bpy; `make blender` installs it and runs this test");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/blender/round_trip.py");
    let done = Command::new(&python).arg(script).arg(env!("CARGO_BIN_EXE_cager")).output().expect("python runs");
    let (out, err) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{out}{err}");
    eprintln!("{out}");
}
