//! The target named by `FUZZ_TARGET`, driven by libFuzzer.

#![no_main]
#![allow(unsafe_code)] // The names that libFuzzer calls.

use cager_fuzz::{TARGETS, Target};
use libfuzzer_sys::fuzz_target;
use std::path::Path;
use std::sync::OnceLock;

static TARGET: OnceLock<&'static Target> = OnceLock::new();

/// Writes what the target begins with where libFuzzer looks for it.
fn prepare(target: &Target, folder: &Path) -> std::io::Result<()> {
    let seeds = folder.join("seeds").join(target.name);
    std::fs::create_dir_all(&seeds)?;
    for (k, seed) in (target.seeds)().iter().enumerate() {
        std::fs::write(seeds.join(k.to_string()), seed)?;
    }
    let escaped = |word: &str| word.bytes().map(|byte| format!("\\x{byte:02x}")).collect::<String>();
    let words: String = target.words.iter().map(|word| format!("\"{}\"\n", escaped(word))).collect();
    std::fs::write(folder.join(format!("{}.dict", target.name)), words)
}

fuzz_target!(
    init: {
        let name = std::env::var("FUZZ_TARGET").unwrap_or_default();
        let Some(target) = Target::find(&name) else {
            let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
            eprintln!("set FUZZ_TARGET to one of {}", names.join(" "));
            std::process::exit(2);
        };
        if let Some(folder) = std::env::var_os("FUZZ_FOLDER") {
            prepare(target, Path::new(&folder)).expect("the folder takes files");
        }
        TARGET.get_or_init(|| target);
    },
    |bytes: &[u8]| {
        if let Some(target) = TARGET.get() {
            target.check(bytes);
        }
    }
);
