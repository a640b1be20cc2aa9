//! What a layer of USD holds: a tree of prims, whose attributes have values, at time codes or not.

use std::collections::{HashMap, HashSet};

use super::clips::Clips;
use crate::error::Fault;
use crate::scene::{Node, Track, Value, Values};

/// How deep prims nest; programs write far less.
pub(super) const DEEPEST: u32 = 256;

/// Fields that say what a prim is composed of, in text or in binary layers.
pub(super) const COMPOSED: [(&str, &str); 5] = [
    ("references", "references"),
    ("payload", "payloads"),
    ("inheritPaths", "inherited prims"),
    ("inherits", "inherited prims"),
    ("specializes", "specialized prims"),
];

/// What a prim is, as far as it matters here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Mesh,
    /// Faces of a mesh, for a material of their own.
    Subset,
    /// A material or what it is made of.
    Shading,
    /// What shows the prims below it many times, and not where they are.
    PointInstancer,
    /// The same, where what it shows is here as instances.
    Instanced,
    /// One of these.
    Instance,
    /// Below it skeletons move meshes.
    SkelRoot,
    Skeleton,
    /// Poses of a skeleton, or shapes that a mesh takes.
    Motion,
    Other,
}

impl Kind {
    pub(super) fn of(type_name: &[u8]) -> Self {
        match type_name {
            b"Mesh" => Self::Mesh,
            b"GeomSubset" => Self::Subset,
            b"Material" | b"Shader" | b"NodeGraph" => Self::Shading,
            b"PointInstancer" => Self::PointInstancer,
            b"SkelRoot" => Self::SkelRoot,
            b"Skeleton" => Self::Skeleton,
            b"SkelAnimation" | b"BlendShape" => Self::Motion,
            _ => Self::Other,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Prim {
    pub(super) kind: Kind,
    /// Whether it, without regard to what it lies below, is there: defined and active.
    pub(super) is_there: bool,
    pub(super) is_inactive: bool,
    /// What it is composed of beside what is told here and by arcs, in words.
    pub(super) composed: Option<&'static str>,
    /// The strongest first.
    pub(super) arcs: Vec<Arc>,
    pub(super) variants: Vec<Variant>,
    /// Files that have its values.
    pub(super) clips: Option<Box<Clips>>,
    /// Sets of variants, and which one of each is chosen.
    pub(super) chosen: Vec<(String, String)>,
}

/// Variants of one prim; programs write some tens.
const MOST_VARIANTS: usize = 256;

/// What a prim says where a variant is chosen, as a prim that is not there.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    pub(super) set: std::sync::Arc<str>,
    pub(super) name: String,
    pub(super) prim: usize,
}

impl Prim {
    pub(super) fn new(kind: Kind, is_there: bool) -> Self {
        let (arcs, variants, chosen) = (Vec::new(), Vec::new(), Vec::new());
        Self { kind, is_there, is_inactive: false, composed: None, arcs, variants, clips: None, chosen }
    }

    /// Adds a variant; too many are not looked at.
    pub(super) fn vary(&mut self, variant: Variant) {
        if self.variants.len() == MOST_VARIANTS {
            self.composed = Some("variants");
        } else {
            self.variants.push(variant);
        }
    }
}

/// Another prim, whose opinions count where a prim has none itself.
#[derive(Clone, Debug, Default)]
pub(super) struct Arc {
    /// What it is, in words.
    pub(super) words: &'static str,
    /// The path of its file as the layer has it; empty for the layer itself.
    pub(super) asset: String,
    /// Its path; empty for the one that its file has as the usual one.
    pub(super) prim: String,
    pub(super) times: Times,
}

/// How times of another layer are counted: scaled, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Times {
    pub(super) offset: f64,
    pub(super) scale: f64,
}

impl Default for Times {
    fn default() -> Self {
        Self { offset: 0.0, scale: 1.0 }
    }
}

/// What a layer says of all that it holds.
#[derive(Clone, Debug, Default)]
pub(super) struct Stage {
    pub(super) up_is_z: Option<bool>,
    pub(super) metres_per_unit: Option<f64>,
    pub(super) time_codes_per_second: Option<f64>,
    pub(super) frames_per_second: Option<f64>,
    pub(super) start: Option<f64>,
    pub(super) end: Option<f64>,
    /// The usual prim of a reference to it.
    pub(super) default_prim: String,
    /// Files whose opinions count where it has none itself, the strongest first.
    pub(super) sublayers: Vec<(String, Times)>,
}

pub(super) struct Layer<'a> {
    pub(super) stage: Stage,
    /// Where the prims are in their tree, and what they are.
    pub(super) nodes: Vec<Node>,
    pub(super) prims: Vec<Prim>,
    /// What instancers show, by their prims.
    pub(super) instances: HashMap<usize, Instance>,
    /// The most points that all meshes may have together, where prims may be there several times.
    pub(super) most_points: u64,
    pub(super) source: Box<dyn Attributes + 'a>,
}

/// One of what an instancer shows.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    pub(super) instancer: usize,
    pub(super) index: usize,
    /// When the instancer says which are hidden, and in which of these values this one is.
    pub(super) hidden: (Track, HashSet<u64>),
}

impl<'a> Layer<'a> {
    /// Of one file.
    pub(super) fn plain(stage: Stage, nodes: Vec<Node>, prims: Vec<Prim>, source: Box<dyn Attributes + 'a>) -> Self {
        Self { stage, nodes, prims, instances: HashMap::new(), most_points: u64::MAX, source }
    }
}

impl Layer<'_> {
    /// The values of an attribute of a prim; none where it has none of this name.
    pub(super) fn attribute(&mut self, prim: usize, name: &str) -> Result<Track, Fault> {
        self.source.attribute(prim, name)
    }

    /// The first value of an attribute of a prim.
    pub(super) fn first(&mut self, prim: usize, name: &str) -> Result<Option<Value>, Fault> {
        let track = self.attribute(prim, name)?;
        Ok(track.values.first().copied().or(track.default))
    }

    /// The numbers of the first value of an attribute of a prim.
    pub(super) fn numbers(&mut self, prim: usize, name: &str) -> Result<Option<Vec<f64>>, Fault> {
        let value = self.first(prim, name)?;
        value.map(|value| self.source.numbers(value)).transpose()
    }

    /// The whole numbers of the first value of an attribute, at most so many; none without a value.
    pub(super) fn integers(&mut self, prim: usize, name: &str, most: u64) -> Result<Vec<i32>, Fault> {
        let value = self.first(prim, name)?;
        value.map_or(Ok(Vec::new()), |value| self.source.integers(value, most))
    }

    /// The vectors of the first value of an attribute, at most so many of `width` numbers each.
    pub(super) fn floats(&mut self, prim: usize, name: &str, width: usize, most: u64) -> Result<Vec<f32>, Fault> {
        let value = self.first(prim, name)?;
        value.map_or(Ok(Vec::new()), |value| self.source.floats(value, width, most))
    }

    /// The tokens that an attribute of a prim is at all times, or first.
    pub(super) fn tokens(&mut self, prim: usize, name: &str, most: usize) -> Result<Option<Vec<String>>, Fault> {
        let value = self.attribute(prim, name)?.still();
        value.map(|value| self.source.tokens(value, most)).transpose()
    }
}

/// A prim, and one of its attributes or none.
pub(super) type Target = (usize, String);

pub(super) trait Attributes: Values {
    /// The values of an attribute of a prim; none where it has none of this name.
    fn attribute(&mut self, prim: usize, name: &str) -> Result<Track, Fault>;

    /// The names and types of what a mesh or a shape has, and of the materials of any prim.
    fn properties(&self, prim: usize) -> Vec<(String, String)>;

    /// What the elements of an attribute belong to, such as corners; empty where it is not said.
    fn interpolation(&mut self, prim: usize, name: &str) -> Result<String, Fault>;

    /// The weight at which a shape between others is reached, where it says one.
    fn weight(&mut self, prim: usize, name: &str) -> Result<Option<f64>, Fault>;

    /// The values of one element of an attribute whose values are lists of so many numbers each.
    fn element(&mut self, _prim: usize, _name: &str, _width: usize, _index: usize) -> Result<Track, Fault> {
        Ok(Track::default())
    }

    /// Adds a prim like another, or one without attributes: within a copy of what lies below the
    /// first prim, the copy of which is the second.
    fn copy(&mut self, _of: usize, _tops: (usize, usize)) {}

    /// The folder that files are named from in a value, as seen from that of the first layer.
    fn folder(&self, _value: Value) -> String {
        String::new()
    }

    /// What is the same of prims that are copies or instances of one.
    fn origin(&self, prim: usize) -> (usize, usize) {
        (0, prim)
    }

    /// The paths to which an attribute or a relationship leads.
    fn paths(&mut self, prim: usize, name: &str) -> Result<Vec<String>, Fault>;

    /// What an attribute or a relationship leads to: prims, and their attributes; `None` for those
    /// that are not there.
    fn targets(&mut self, prim: usize, name: &str) -> Result<Vec<Option<Target>>, Fault>;

    /// The first of these.
    fn target(&mut self, prim: usize, name: &str) -> Result<Option<Target>, Fault> {
        Ok(self.targets(prim, name)?.into_iter().next().flatten())
    }

    /// The numbers of vectors of `width` numbers, of which there are at most so many, or of one;
    /// of quaternions the real part last.
    fn vectors(&mut self, value: Value, width: usize, most: u64) -> Result<Vec<f64>, Fault>;

    /// The same, of single precision.
    fn floats(&mut self, value: Value, width: usize, most: u64) -> Result<Vec<f32>, Fault> {
        Ok(self.vectors(value, width, most)?.iter().map(|&x| x as f32).collect())
    }

    /// Refuses more memory than such a file should take.
    fn reserve(&mut self, count: u64, size: u64) -> Result<(), Fault>;

    /// A list of at most so many names, or one, or the path of a file.
    fn tokens(&mut self, value: Value, most: usize) -> Result<Vec<String>, Fault>;
}

/// The fault of what is composed of other prims or files.
pub(super) fn composed(what: &str, of: &str) -> Fault {
    Fault::unsupported(format!(
        "{what} has {of}, which are not read; write all into one file in Python (pip install usd-core): from pxr \
         import Usd; s = Usd.Stage.Open(\"in.usd\"); [p.SetInstanceable(False) for _ in range(9) for p in \
                                          list(s.TraverseAll()) if p and p.IsInstance()]; s.Export(\"out.usdc\")"
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
