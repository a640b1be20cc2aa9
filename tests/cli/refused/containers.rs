//! Files that are no containers, and damaged ones.

use super::{assert_sentence, refused};
use crate::support::Dir;

#[test]
fn files_that_are_no_containers_are_refused() {
    let (dir, _) = Dir::with_encoded();
    dir.write(
        "text.cager",
        "Dear reader,\nthis is a letter, and not a short one: it goes on for more than a header.\n",
    );
    dir.write("short.cager", "hi");
    dir.write("empty.cager", "");
    dir.write("zeros.cager", [0; 4096]);
    dir.write("newer.cager", {
        let mut bytes = dir.read("out.cager");
        bytes[8] = 200;
        bytes
    });
    std::fs::create_dir(dir.path("folder.cager")).expect("a folder");
    for file in ["text.cager", "short.cager", "empty.cager", "zeros.cager", "folder.cager", "rest.obj"] {
        for line in [format!("inspect {file}"), format!("inspect --json {file}"), format!("decode {file} -o back.npy")]
        {
            let what = if file == "folder.cager" { "is a folder" } else { "is not a .cager file" };
            refused(&dir, &line, &[file, what]);
        }
    }
    for line in ["inspect newer.cager", "decode newer.cager -o back.npy"] {
        refused(&dir, line, &["newer.cager"]);
    }
    for line in ["inspect gone.cager", "decode gone.cager -o back.npy", "decode rest.obj/x.cager -o back.npy"] {
        refused(&dir, line, &["cager", "cannot be read", "check the path"]);
    }
}

#[test]
fn container_cut_anywhere_is_refused() {
    let (dir, _) = Dir::with_encoded();
    let whole = dir.read("out.cager");
    let ends = [0, 1, 7, 8, 9, 15, 16, 17, 40, 63, 64, 65].into_iter();
    let last = (1..=8).map(|k| whole.len() - k * k);
    for length in ends.chain(last).chain((1..32).map(|k| k * whole.len() / 32)) {
        damaged(&dir, &whole[..length], &format!("cut after {length} bytes"));
    }
    damaged(&dir, &[whole.as_slice(), b"\0"].concat(), "a byte in excess");
    damaged(&dir, &[whole.as_slice(), whole.as_slice()].concat(), "twice over");
}

#[test]
fn container_corrupted_anywhere_is_refused() {
    let (dir, _) = Dir::with_encoded();
    let whole = dir.read("out.cager");
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for round in 0..200 {
        // Half of the rounds hit the two ends, where the structure is.
        let place = match round % 4 {
            0 => random.below(whole.len().min(400)),
            1 => whole.len() - 1 - random.below(whole.len().min(900)),
            _ => random.below(whole.len()),
        };
        let change = 1 + random.below(255) as u8;
        let mut bytes = whole.clone();
        bytes[place] ^= change;
        damaged(&dir, &bytes, &format!("byte {place} of {} changed by {change}", whole.len()));
    }
}

/// Neither command believes these bytes.
#[track_caller]
fn damaged(dir: &Dir, bytes: &[u8], what: &str) {
    dir.write("bad.cager", bytes);
    for line in ["decode bad.cager -o back.npy", "inspect bad.cager"] {
        let done = dir.cager(line).run();
        assert_eq!(done.status, Some(1), "{what}: {line}: {done:?}");
        assert_sentence(line, &done.stderr, &["bad.cager"]);
        assert_eq!(done.stdout, "", "{what}: {line}");
        assert!(!dir.path("back.npy").exists(), "{what}: {line} left an output");
    }
    let names = dir.names("");
    assert_eq!(names, ["bad.cager", "cage.obj", "frames.npy", "out.cager", "report.json", "rest.obj"], "{what}");
}

/// xorshift64: the same places in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }
}
