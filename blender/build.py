"""Packs the extension for Blender into one zip, with wheels of the Python module: python blender/build.py ZIP WHEEL..."""

import sys
import zipfile
from pathlib import Path

SOURCE = Path(__file__).parent / "extension"
# How the names of wheels and Blender call the same system.
PLATFORMS = (
    ("manylinux", "x86_64", "linux-x64"),
    ("manylinux", "aarch64", "linux-arm64"),
    ("win", "amd64", "windows-x64"),
    ("win", "arm64", "windows-arm64"),
    ("macosx", "arm64", "macos-arm64"),
    ("macosx", "x86_64", "macos-x64"),
)


def platform(wheel):
    system = wheel.stem.split("-")[-1]
    for start, machine, name in PLATFORMS:
        if system.startswith(start) and system.endswith(machine):
            return name
    raise SystemExit(f"{wheel.name}: is of no system that Blender runs on; build it with maturin on that system")


def build(target, wheels):
    manifest = (SOURCE / "blender_manifest.toml").read_text()
    for wheel in wheels:
        if f'\nversion = "{wheel.name.split("-")[1]}"\n' not in manifest:
            raise SystemExit(f"{wheel.name}: has another version than {SOURCE / 'blender_manifest.toml'}; make them the same")
    platforms = sorted({platform(wheel) for wheel in wheels})
    names = [f"./wheels/{wheel.name}" for wheel in wheels]
    lists = f"platforms = {platforms}\nwheels = {names}\n".replace("'", '"')
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as zipped:
        # Before the tables, which TOML has last.
        zipped.writestr("blender_manifest.toml", manifest.replace("\n[permissions]", f"{lists}\n[permissions]"))
        for path in sorted(SOURCE.glob("*.py")):
            zipped.write(path, path.name)
        for wheel in wheels:
            zipped.write(wheel, f"wheels/{wheel.name}")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    build(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
    print(sys.argv[1])
