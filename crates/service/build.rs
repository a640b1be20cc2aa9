//! Has the viewer built anew into the service whenever it changes.

fn main() {
    // `make web` fills it. A folder that is missing would have every build begin anew.
    let folder = "../../web/dist/viewer";
    let _ = std::fs::create_dir_all(folder);
    println!("cargo::rerun-if-changed={folder}");
}
