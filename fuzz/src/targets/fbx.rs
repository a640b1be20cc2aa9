//! Scenes of FBX. The first byte says how many points are expected.

use super::scenes::read;
use crate::Target;
use cager_formats::{CacheFormat, MeshFormat};

/// Two meshes of 8 and 5 points as text.
const TEXT: &[u8] = include_bytes!("../../../crates/formats/tests/fbx/cube.fbx");

pub(super) const FBX: Target = Target {
    name: "fbx",
    run: |bytes| read(CacheFormat::Fbx, MeshFormat::Fbx, "a.fbx", bytes),
    seeds: || vec![[&[13], TEXT].concat()],
    words: &[
        "Kaydara FBX Binary  \0\x1a\0",
        "FBXVersion: 7400",
        "Geometry: 100, \"Geometry::a\", \"Mesh\" {",
        "Vertices: *",
        "PolygonVertexIndex: *",
        "AnimationCurve: ",
        "KeyTime: *",
        "SubDeformer",
        "\"Cluster\"",
        "BlendShapeChannel",
        "VertexCacheDeformer",
        "ByPolygonVertex",
        "IndexToDirect",
        "C: \"OO\",",
        "C: \"OP\",",
        "Lcl Translation",
        "GeometricScaling",
        "RotationPivot",
        "46186158000",
        "-9223372036854775808",
        "1e308",
        "nan",
    ],
    // Files are packed: a scene may take 32 MiB and a multiple of its bytes, once for good and once while it is read.
    fixed: 68 << 20,
    per_byte: 1024,
};
