//! Alembic archives. The first byte says how many points are expected.

use super::scenes::{read, seeds};
use crate::Target;
use cager_formats::{CacheFormat, MeshFormat};

pub(super) const ABC: Target = Target {
    name: "abc",
    run: |bytes| read(CacheFormat::Abc, MeshFormat::Abc, "a.abc", bytes),
    seeds: || seeds("a.abc", [0.0, 1.0, 5.0]),
    words: &[
        "Ogawa\u{0}",
        "isInstance=1;",
        "schema=AbcGeom_SubD_v1",
        "schema=AbcGeom_Xform_v3",
        ".geom",
        ".xform",
        ".vals",
        ".ops",
        "_ai_DCC_FPS=30",
    ],
    fixed: 2 << 20,
    per_byte: 64,
};
