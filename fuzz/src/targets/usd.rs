//! Files of USD. The first byte says how many points are expected.

use super::scenes::{read, seeds};
use crate::Target;
use cager_formats::{CacheFormat, MeshFormat};

const WORDS: &[&str] = &[
    "PXR-USDC",
    "timeSamples",
    "xformOpOrder",
    "!resetXformStack!",
    "!invert!xformOp:translate:pivot",
    "xformOp:rotateXYZ",
    "xformOp:orient",
    "xformOp:transform",
    "leftHanded",
    "subLayers",
];

pub(super) const USDC: Target = Target {
    name: "usdc",
    run: |bytes| read(CacheFormat::Usdc, MeshFormat::Usdc, "a.usdc", bytes),
    seeds: || seeds("a.usdc", [0.0, 1.5, 5.25]),
    words: WORDS,
    fixed: 2 << 20,
    per_byte: 256,
};

pub(super) const USDZ: Target = Target {
    name: "usdz",
    run: |bytes| read(CacheFormat::Usdz, MeshFormat::Usdz, "a.usdz", bytes),
    seeds: || seeds("a.usdz", [0.0, 1.5, 5.25]),
    ..USDC
};
