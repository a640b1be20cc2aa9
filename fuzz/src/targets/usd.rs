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

/// Files of OpenUSD's library as text.
const TEXTS: [&[u8]; 4] = [
    include_bytes!("../../../crates/formats/tests/usd/operations.usda"),
    include_bytes!("../../../crates/formats/tests/usd/several.usda"),
    include_bytes!("../../../crates/formats/tests/usd/single.usda"),
    include_bytes!("../../../crates/formats/tests/usd/variants.usda"),
];

pub(super) const USDA: Target = Target {
    name: "usda",
    run: |bytes| read(CacheFormat::Usda, MeshFormat::Usda, "a.usda", bytes),
    seeds: || TEXTS.iter().map(|text| [&[3], *text].concat()).collect(),
    words: &[
        "#usda",
        "def Mesh \"",
        "timeSamples = {",
        ".spline",
        "None",
        "subLayers",
        "variantSet",
        "payload",
        "\"\"\"",
        "@@@",
        "/*",
        "inf",
        "1e308",
        "xformOpOrder",
        "!invert!",
    ],
    ..USDC
};
