//! Animations of glTF. The first byte says how many points are expected, and where it is odd, lengths are made right.

use super::meshes::{GLB_WORDS, with_lengths};
use super::scenes::{read, written};
use crate::Target;
use cager_formats::{CacheFormat, FrameOptions, MeshFormat, MorphOptions};

pub(super) const GLB_FRAMES: Target = Target {
    name: "glb-frames",
    run: |bytes| {
        let file = [&bytes[..bytes.len().min(1)], &with_lengths(bytes)].concat();
        read(CacheFormat::Glb, MeshFormat::Glb, "a.glb", &file);
    },
    seeds: || {
        let uneven = FrameOptions { numbers: vec![0.0, 1.5, 5.25], ..FrameOptions::default() };
        let morphs = MorphOptions { floats: true, ..MorphOptions::default() };
        written("a.glb", &[FrameOptions::default(), uneven, FrameOptions { morphs, ..FrameOptions::default() }])
    },
    words: GLB_WORDS,
    fixed: 4 << 20,
    // A document of tiny objects grows more than other formats do.
    per_byte: 2048,
};
