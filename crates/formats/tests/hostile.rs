//! Whatever bytes come, readers answer with an error or a value: no panic, and no more memory than the bytes justify.

#[path = "../../../proto/tests/support/memory.rs"]
mod memory;
mod support;

use std::path::Path;

use cager_formats::{CacheFormat, MeshFormat, open_frames_bytes, read_model_bytes};
use memory::peak_of;
use proptest::prelude::*;
use support::*;

/// For blocks and tables that do not depend on the input.
const FIXED: usize = 1 << 20;
const PER_BYTE: usize = 64;

fn guarded<T>(name: &str, bytes: &[u8], read: impl FnOnce() -> T) -> T {
    let (value, used) = peak_of(read);
    let most = FIXED + PER_BYTE * bytes.len();
    assert!(used <= most, "{name}: {used} bytes of memory for {} bytes of file", bytes.len());
    value
}

fn try_mesh(name: &str, bytes: &[u8]) -> bool {
    let path = Path::new(name);
    let format = MeshFormat::from_path(path).unwrap();
    match guarded(name, bytes, || read_model_bytes(format, path, bytes)) {
        Ok(model) => {
            assert!(!model.points.is_empty());
            assert!(model.points.as_flattened().iter().all(|x| x.is_finite()));
            assert!(model.faces.indices().iter().all(|&index| (index as usize) < model.points.len()));
            assert!(model.faces.arities().iter().all(|&corners| corners >= 3));
            assert_eq!(model.surface.check(model.points.len(), &model.faces), Ok(()));
            true
        }
        Err(error) => {
            assert!(error.to_string().starts_with(&format!("{name}: ")), "{error}");
            assert!(error.to_string().len() < 500, "{error}");
            false
        }
    }
}

fn try_cache(name: &str, bytes: &[u8]) -> bool {
    let format = CacheFormat::ALL.into_iter().find(|format| name.ends_with(format.extension())).unwrap();
    let mut accepted = false;
    for points in [0, 1, 2, 6, i32::MAX as usize, 1 << 31, u32::MAX as usize, 1 << 60, 1 << 63, usize::MAX] {
        accepted |= guarded(name, bytes, || {
            let mut reader = match open_frames_bytes(format, Path::new(name), bytes, points) {
                Ok(reader) => reader,
                Err(error) => {
                    assert!(error.to_string().starts_with(&format!("{name}: ")), "{error}");
                    return false;
                }
            };
            assert_eq!(reader.points(), points);
            let mut frame = Vec::new();
            for _ in 0..reader.frames() {
                match reader.read_next(&mut frame) {
                    Ok(more) => assert!(more && frame.len() == 3 * points && frame.iter().all(|x| x.is_finite())),
                    Err(_) => return true,
                }
            }
            !reader.read_next(&mut frame).unwrap()
        });
    }
    accepted
}

/// A reader under test: whether it takes the bytes.
type Try = fn(&str, &[u8]) -> bool;

fn samples() -> Vec<(&'static str, Vec<u8>, Try)> {
    let meshes = meshes().into_iter().map(|(name, bytes)| (name, bytes, try_mesh as Try));
    let caches = caches().into_iter().map(|(name, bytes)| (name, bytes, try_cache as Try));
    let animated = ("a.glb", animated_glb(), try_cache as Try);
    let with_surface = ("a.abc", archive::with_surface(), try_mesh as Try);
    meshes.chain(caches).chain([animated, with_surface]).collect()
}

#[test]
fn samples_are_accepted_whole() {
    for (name, bytes, accepts) in samples() {
        assert!(accepts(name, &bytes), "{name}");
    }
}

#[test]
fn files_cut_anywhere_are_answered() {
    for (name, bytes, accepts) in samples() {
        for length in 0..bytes.len() {
            let accepted = accepts(name, &bytes[..length]);
            let is_binary = !["a.obj", "a.off", "a.ply", "a.stl"].contains(&name);
            assert!(!(accepted && is_binary), "{name}: cut to {length} of {} bytes", bytes.len());
        }
    }
}

#[test]
fn files_with_any_bit_flipped_are_answered() {
    for (name, mut bytes, accepts) in samples() {
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            accepts(name, &bytes);
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

const COUNTS: [u64; 9] = [0, 1, 0x7fff_ffff, 0x8000_0000, 0xffff_fffe, 0xffff_ffff, 1 << 32, i64::MAX as u64, 1 << 63];

#[test]
fn files_with_any_binary_field_replaced_are_answered() {
    for (name, bytes, accepts) in samples() {
        for value in COUNTS {
            let (short, long) = (value as u32, value);
            let fields: [&[u8]; 5] = [
                &(value as u16).to_le_bytes(),
                &short.to_le_bytes(),
                &short.to_be_bytes(),
                &long.to_le_bytes(),
                &long.to_be_bytes(),
            ];
            for field in fields {
                for start in 0..bytes.len().saturating_sub(field.len()) {
                    let mut bytes = bytes.clone();
                    bytes[start..start + field.len()].copy_from_slice(field);
                    accepts(name, &bytes);
                }
            }
        }
    }
}

#[test]
fn files_with_any_written_number_replaced_are_answered() {
    let mut values: Vec<_> = COUNTS.iter().map(u64::to_string).collect();
    values.extend(["-1", "18446744073709551616", "1e308", "nan", "", "0.5", "(", "[[[["].map(str::to_owned));
    for (name, bytes, accepts) in samples() {
        let is_digit = |k: usize| bytes.get(k).is_some_and(u8::is_ascii_digit);
        for start in (0..bytes.len()).filter(|&k| is_digit(k) && (k == 0 || !is_digit(k - 1))) {
            let end = (start..).find(|&k| !is_digit(k)).unwrap();
            for value in &values {
                let mut changed = [&bytes[..start], value.as_bytes(), &bytes[end..]].concat();
                if name == "a.glb" {
                    mend_lengths(&mut changed);
                }
                accepts(name, &changed);
            }
        }
    }
}

/// Makes the lengths of a .glb right again after its JSON has changed.
fn mend_lengths(file: &mut [u8]) {
    let binary = (0..file.len() - 4).rfind(|&k| &file[k..k + 4] == b"BIN\0").map_or(file.len(), |k| k - 4);
    let length = file.len() as u32;
    file[8..12].copy_from_slice(&length.to_le_bytes());
    file[12..16].copy_from_slice(&(binary as u32 - 20).to_le_bytes());
}

#[test]
fn deep_and_endless_json_is_answered() {
    for rest in [
        format!(r#","extras":{}"#, "[".repeat(100_000)),
        format!(r#","materials":[{}{{}}]"#, "{},".repeat(200_000)),
        format!(r#","nodes":[{{"mesh":0}},{}{{}}]"#, r#"{"children":[1,1]},"#.repeat(1000)),
    ] {
        assert!(!try_mesh("a.glb", &glb_file(&glb_json(&rest), &glb_data())));
    }
}

#[test]
fn json_of_empty_objects_takes_no_more_memory_than_their_greatest_number_does() {
    for key in ["nodes", "materials", "images"] {
        let json = glb_json(&format!(r#","{key}":[{}{{}}]"#, "{},".repeat(99_000)));
        let bytes = glb_file(&json, &glb_data());
        let (_, used) = peak_of(|| read("a.glb", &bytes));
        assert!(used < 200 << 20, "{used} bytes of memory for {key}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_are_answered(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        for (name, sample, accepts) in samples() {
            accepts(name, &bytes);
            // Behind a good beginning, more of the reader is reached.
            for share in [6, 16, sample.len() / 4, sample.len() / 2] {
                accepts(name, &[&sample[..share], &bytes].concat());
            }
        }
    }

    #[test]
    fn shuffled_pieces_are_answered(
        cuts in proptest::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>()), 1..6)
    ) {
        for (name, sample, accepts) in samples() {
            let mut bytes = Vec::new();
            for (from, to) in &cuts {
                let (from, to) = (from.index(sample.len()), to.index(sample.len()));
                bytes.extend_from_slice(&sample[from.min(to)..from.max(to)]);
            }
            accepts(name, &bytes);
            accepts(name, &[&sample[..sample.len() / 2], &bytes].concat());
        }
    }
}
