//! `docs/FORMAT.md` is enough to write a decoder: one that was written from it, in Python, gives what the program gives.

use crate::support::{blocks, is_there, repository};
use std::fmt::Write as _;
use std::fs;
use std::process::Command;

const RAW: u8 = 0;

/// A module `zstandard` that knows what these compressed sections hold: Python has none of its own.
fn zstandard(container: &[u8]) -> String {
    let number = |at: usize| u64::from_le_bytes(container[at..at + 8].try_into().expect("eight bytes")) as usize;
    let mut module = "KNOWN = {}\nclass ZstdDecompressor:\n    def decompress(self, payload, max_output_size):\n        return KNOWN[payload]\n".to_owned();
    let mut at = 16;
    while at + 40 <= container.len() {
        let (codec, length) = (container[at + 4], number(at + 16));
        let Some(payload) = container.get(at + 40..).and_then(|rest| rest.get(..length)) else { break };
        if codec != RAW {
            let data = zstd::decode_all(payload).expect("zstd");
            let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
            writeln!(module, "KNOWN[bytes.fromhex('{}')] = bytes.fromhex('{}')", hex(payload), hex(&data))
                .expect("a text");
        }
        at += 40 + length;
    }
    module
}

#[test]
fn a_decoder_written_from_the_document_gives_the_same_positions() {
    if !is_there("python3") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let reader = blocks("docs/FORMAT.md", "python").concat();
    let decoder = fs::read_to_string(repository().join("tests/docs/decoder.py")).expect("a script");
    fs::write(folder.path().join("decoder.py"), reader + &decoder).expect("a script");
    for (system, most) in
        [("mvc", 1e-7), ("mvc-origin", 1e-7), ("mvc-edited", 1e-7), ("green", 1e-6), ("green-free", 1e-6)]
    {
        let golden = repository().join(format!("tests/golden/definition3-{system}.cager"));
        let container = fs::read(&golden).expect("a container");
        fs::write(folder.path().join("zstandard.py"), zstandard(&container)).expect("a module");
        let mut command = Command::new("python3");
        let output = command
            .arg("decoder.py")
            .arg(&golden)
            .arg(golden.with_extension("npy"))
            .current_dir(folder.path())
            .output();
        let output = output.expect("python3");
        let said = String::from_utf8_lossy(&output.stdout);
        let farthest: Option<f64> = said.lines().last().and_then(|line| line.parse().ok());
        let farthest =
            farthest.unwrap_or_else(|| panic!("{system}: {said}{}", String::from_utf8_lossy(&output.stderr)));
        assert!(farthest <= most, "{system}: off by {farthest:.1e} of the diagonal");
    }
}
