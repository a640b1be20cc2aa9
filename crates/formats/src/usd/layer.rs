//! What a layer of USD holds, whatever it is stored as: a tree of prims, whose attributes have values by default and at time codes.

use crate::error::Fault;
use crate::frames::Scalar;
use crate::scene::Failure;

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
    /// Index of the prim that it lies below; none for those at the top.
    pub(super) parent: Option<u32>,
    /// How many names its path has.
    pub(super) depth: u32,
    /// Which of the layer's own this is.
    pub(super) spec: u32,
    /// Index of its name.
    pub(super) name: u32,
    pub(super) kind: Kind,
    /// Whether it, without regard to what it lies below, is there: defined and active.
    pub(super) is_there: bool,
    /// What it is composed of beside what is told here, in words.
    pub(super) composed: Option<&'static str>,
}

/// Where a layer stores a value: opaque to all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Value(pub(super) u64);

/// The values of an attribute.
#[derive(Clone, Debug, Default)]
pub(super) struct Attribute {
    pub(super) default: Option<Value>,
    /// Time codes, ascending, and what is there.
    pub(super) times: Vec<f64>,
    pub(super) values: Vec<Value>,
}

impl Attribute {
    /// Whether there is no value at all.
    pub(super) fn is_empty(&self) -> bool {
        self.default.is_none() && self.times.is_empty()
    }

    /// The value that does not change, or else the first one.
    pub(super) fn still(&self) -> Option<Value> {
        self.default.or_else(|| self.values.first().copied())
    }

    /// The value at a time code, the next one, and how far the time is on its way there; that by default where there are no samples. Before the first
    /// and after the last they hold.
    pub(super) fn at(&self, time: f64) -> Option<(Value, Value, f64)> {
        if self.times.is_empty() {
            return self.default.map(|value| (value, value, 0.0));
        }
        let after = self.times.partition_point(|&t| t <= time + NEAR);
        let (low, high) = (after.saturating_sub(1), after.min(self.times.len() - 1));
        let (start, end) = (self.times[low], self.times[high]);
        let share = if after > 0 && end > start { ((time - start) / (end - start)).max(0.0) } else { 0.0 };
        Some((self.values[low], self.values[high], if share < NEAR { 0.0 } else { share }))
    }
}

/// Time codes by which a time may miss a sample.
pub(super) const NEAR: f64 = 1e-6;

/// An array of points, which lies in the file as it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    pub(super) start: u64,
    pub(super) count: usize,
    pub(super) scalar: Scalar,
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
pub(super) trait Layer: Send {
    fn stage(&self) -> &Stage;

    fn prims(&self) -> &[Prim];

    fn name(&self, prim: &Prim) -> &[u8];

    /// The values of an attribute of a prim; none where it has none of this name.
    fn attribute(&mut self, prim: u32, name: &str) -> Result<Attribute, Failure>;

    /// The names and types of what a mesh has beside its faces, and of the materials of any prim.
    fn properties(&self, prim: u32) -> Vec<(String, String)>;

    /// The numbers of one value: of a number, a vector, a quaternion (its real part last) or a matrix.
    fn numbers(&mut self, value: Value) -> Result<Vec<f64>, Failure>;

    /// A list of at most so many names, or one.
    fn tokens(&mut self, value: Value, most: usize) -> Result<Vec<String>, Failure>;

    /// An array of at most so many whole numbers.
    fn integers(&mut self, value: Value, most: u64) -> Result<Vec<i32>, Failure>;

    /// Where an array of points is.
    fn points(&mut self, value: Value) -> Result<Points, Failure>;

    /// Reads points, `x y z x y z …`, all of which are overwritten; gives whether all are finite.
    fn read(&mut self, points: Points, out: &mut [f64]) -> Result<bool, Failure>;
}

/// The fault of whatever only damage explains.
pub(super) fn damaged(what: &str) -> Fault {
    Fault::damaged(format!("{what}, so the file is damaged; copy or export it again"))
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
