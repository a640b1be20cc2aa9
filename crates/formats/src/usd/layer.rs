//! What a layer of USD holds, whatever it is stored as: a tree of prims, whose attributes have values by default and at time codes.

use crate::error::Fault;
use crate::scene::{Failure, Node, Track, Value, Values};

/// How deep prims nest; programs write far less.
pub(super) const DEEPEST: u32 = 256;

/// Fields that say what a prim is composed of, as they are called in one of the two kinds of layers.
pub(super) const COMPOSED: [(&str, &str); 9] = [
    ("references", "references"),
    ("payload", "payloads"),
    ("inheritPaths", "inherited prims"),
    ("inherits", "inherited prims"),
    ("specializes", "specialized prims"),
    ("variantSetNames", "variants"),
    ("variantSets", "variants"),
    ("clips", "value clips"),
    ("clipSets", "value clips"),
];

/// What a prim is, as far as it matters here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Mesh,
    /// Faces of a mesh, for a material of their own.
    Subset,
    /// What shows the prims below it many times, and not where they are.
    PointInstancer,
    Other,
}

impl Kind {
    pub(super) fn of(type_name: &[u8]) -> Self {
        match type_name {
            b"Mesh" => Self::Mesh,
            b"GeomSubset" => Self::Subset,
            b"PointInstancer" => Self::PointInstancer,
            _ => Self::Other,
        }
    }
}

/// A prim of the tree.
#[derive(Clone, Debug)]
pub(super) struct Prim {
    /// Which of the layer's own this is.
    pub(super) spec: u32,
    pub(super) kind: Kind,
    /// Whether it, without regard to what it lies below, is there: defined and active.
    pub(super) is_there: bool,
    /// What it is composed of beside what is told here, in words.
    pub(super) composed: Option<&'static str>,
}

/// What a layer says of all that it holds.
#[derive(Debug, Default)]
pub(super) struct Stage {
    pub(super) up_is_z: Option<bool>,
    pub(super) metres_per_unit: Option<f64>,
    pub(super) time_codes_per_second: Option<f64>,
    pub(super) frames_per_second: Option<f64>,
    pub(super) start: Option<f64>,
    pub(super) end: Option<f64>,
}

/// A layer.
pub(super) trait Layer: Values {
    fn stage(&self) -> &Stage;

    /// Where the prims are in their tree, and what they are.
    fn nodes(&self) -> &[Node];

    fn prims(&self) -> &[Prim];

    /// The values of an attribute of a prim; none where it has none of this name.
    fn attribute(&mut self, prim: usize, name: &str) -> Result<Track, Failure>;

    /// The names and types of what a mesh has beside its faces, and of the materials of any prim.
    fn properties(&self, prim: usize) -> Vec<(String, String)>;

    /// A list of at most so many names, or one.
    fn tokens(&mut self, value: Value, most: usize) -> Result<Vec<String>, Failure>;
}

/// The fault of what is composed of other prims or files.
pub(super) fn composed(what: &str, of: &str) -> Fault {
    Fault::unsupported(format!(
        "{what} has {of}, which are not read; write all into one file in Python (pip install usd-core): from pxr import Usd; s = Usd.Stage.Open(\"in.usd\"); [p.SetInstanceable(False) for _ in range(9) for p in list(s.TraverseAll()) if p and p.IsInstance()]; s.Export(\"out.usdc\")"
    ))
}

/// The fault of prims within prims, more than programs write.
pub(super) fn too_deep() -> Fault {
    Fault::unsupported(format!("nests deeper than {DEEPEST}; export the mesh alone, without what it lies below"))
}

/// The fault of an attribute that has a curve in place of values.
pub(super) fn spline(name: &str) -> Fault {
    Fault::unsupported(format!("has {name} animated by a spline, which is not read; bake it into time samples"))
}
