//! What a text says: its prims, and where the values of their attributes are.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::scanner::{Place, Scanner, is_letter};
use crate::error::Fault;
use crate::scene::{Node, Track, Value};
use crate::usd::layer::{DEEPEST, Kind, Prim, Stage, too_deep};

/// Words in front of the type of a property or of the key of a field.
const MODIFIERS: [&str; 9] =
    ["custom", "uniform", "varying", "config", "add", "append", "prepend", "delete", "reorder"];

/// Attributes that are asked for of all prims, beside the operations of transforms.
const WANTED: [&str; 7] =
    ["subdivisionScheme", "points", "faceVertexCounts", "faceVertexIndices", "orientation", "purpose", "visibility"];

/// Attributes of instancers.
const INSTANCING: [&str; 8] =
    ["prototypes", "protoIndices", "positions", "orientations", "orientationsf", "scales", "ids", "invisibleIds"];

/// Whether an attribute or a relationship of a prim is asked for.
pub(super) fn is_wanted(kind: Kind, name: &str) -> bool {
    let of_kind = match kind {
        // What has no type says something of a prim that others define.
        Kind::Mesh | Kind::Other => {
            name == "normals" || ["primvars:", "crease"].iter().any(|start| name.starts_with(start))
        }
        Kind::Subset | Kind::Shading | Kind::Skeleton | Kind::Motion => true,
        Kind::PointInstancer => INSTANCING.contains(&name),
        _ => false,
    };
    let starts = ["xformOp", "material:binding", "skel:", "primvars:skel:"];
    of_kind || WANTED.contains(&name) || starts.iter().any(|start| name.starts_with(start))
}

/// A value: its place, how many values it has within it, and what they are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stored {
    pub(super) place: Place,
    pub(super) count: usize,
    pub(super) is_blocked: bool,
    pub(super) is_double: bool,
    pub(super) is_quaternion: bool,
}

#[derive(Default)]
pub(super) struct Contents {
    pub(super) stage: Stage,
    pub(super) prims: Vec<Prim>,
    pub(super) nodes: Vec<Node>,
    pub(super) values: Vec<Stored>,
    pub(super) attributes: HashMap<(usize, String), Track>,
    /// What the elements of attributes belong to.
    pub(super) interpolations: HashMap<(usize, String), String>,
    /// The paths to which attributes and relationships lead.
    pub(super) targets: HashMap<(usize, String), Vec<String>>,
    /// At which weights shapes between others are reached.
    pub(super) weights: HashMap<(usize, String), f64>,
    /// Of meshes and shapes their names and types, of others those of materials.
    pub(super) properties: HashMap<usize, Vec<(String, String)>>,
    pub(super) splines: HashSet<(usize, String)>,
}

pub(super) struct Parser<'a, 'b> {
    pub(super) scanner: &'a mut Scanner<'b>,
    pub(super) contents: Contents,
    /// The prims that are open, from the outside to the inside.
    pub(super) open: Vec<usize>,
    /// The sets of variants that are open: within how many prims and in which.
    pub(super) sets: Vec<(usize, usize, Arc<str>)>,
}

/// What fields in brackets belong to.
pub(super) enum Owner {
    Layer,
    Prim(usize),
    Property(String),
}

impl<'a, 'b> Parser<'a, 'b> {
    pub(super) fn parse(scanner: &'a mut Scanner<'b>) -> Result<Contents, Fault> {
        let mut parser = Self { scanner, contents: Contents::default(), open: Vec::new(), sets: Vec::new() };
        if parser.scanner.solid()? == Some(b'(') {
            parser.fields(&Owner::Layer)?;
        }
        loop {
            match parser.scanner.solid()? {
                None if parser.open.is_empty() => return Ok(parser.contents),
                None => return Err(parser.scanner.wrong("the text ends within a prim")),
                Some(b'"' | b'\'') if parser.is_in_set() => parser.variant()?,
                Some(b'}') if parser.is_in_set() => {
                    parser.sets.pop();
                    parser.scanner.expect(b'}')?;
                }
                Some(b'}') if parser.open.pop().is_some() => parser.scanner.expect(b'}')?,
                Some(byte) if is_letter(byte) && !parser.is_in_set() => parser.statement()?,
                Some(_) => {
                    let found = parser.scanner.found()?;
                    return Err(parser.scanner.wrong(&format!("{found} begins neither a prim nor a property")));
                }
            }
        }
    }

    pub(super) fn word(&mut self) -> Result<String, Fault> {
        Ok(self.scanner.word(b"_:.")?.to_owned())
    }

    /// The next word behind those that say how it is meant, and whether that takes something away.
    pub(super) fn key(&mut self) -> Result<(String, bool), Fault> {
        let mut is_removed = false;
        loop {
            let word = self.word()?;
            if !MODIFIERS.contains(&word.as_str()) {
                return Ok((word, is_removed));
            }
            is_removed |= matches!(word.as_str(), "delete" | "reorder");
        }
    }

    fn statement(&mut self) -> Result<(), Fault> {
        let (word, _) = self.key()?;
        match (word.as_str(), self.open.last()) {
            ("def" | "over" | "class", _) => self.prim(word == "def"),
            ("variantSet", Some(&prim)) => {
                let set = self.scanner.string()?;
                self.scanner.expect(b'=')?;
                self.sets.push((self.open.len(), prim, Arc::from(set)));
                self.scanner.expect(b'{')
            }
            _ => self.property(&word),
        }
    }

    fn prim(&mut self, is_defined: bool) -> Result<(), Fault> {
        if self.open.len() == DEEPEST as usize {
            return Err(too_deep());
        }
        let kind = Kind::of(self.word()?.as_bytes());
        let name = self.scanner.string()?;
        let index = self.contents.prims.len();
        let (parent, depth) = (self.open.last().copied(), self.open.len() + 1);
        self.contents.nodes.push(Node { name: name.into_bytes().into(), parent, depth });
        self.contents.prims.push(Prim::new(kind, is_defined));
        if self.scanner.solid()? == Some(b'(') {
            self.fields(&Owner::Prim(index))?;
        }
        self.open.push(index);
        self.scanner.expect(b'{')
    }

    /// A property behind its type, or an order of names, which has none.
    fn property(&mut self, type_name: &str) -> Result<(), Fault> {
        if self.scanner.has(b'[')? {
            self.scanner.expect(b']')?;
        }
        let name = self.word()?;
        if let Some(&prim) = self.open.last()
            && (matches!(self.contents.prims[prim].kind, Kind::Mesh | Kind::Motion | Kind::Other)
                || name.starts_with("material:binding"))
        {
            let plain = name.split('.').next().unwrap_or_default().to_owned();
            self.contents.properties.entry(prim).or_default().push((plain, type_name.to_owned()));
        }
        if self.scanner.has(b'=')? {
            self.value(type_name, &name)?;
        }
        if self.scanner.solid()? == Some(b'(') {
            self.fields(&Owner::Property(name))?;
        }
        Ok(())
    }

    fn value(&mut self, type_name: &str, full: &str) -> Result<(), Fault> {
        let (name, part) = full.split_once('.').unwrap_or((full, ""));
        let prims = &self.contents.prims;
        let Some(&prim) = self.open.last().filter(|&&prim| is_wanted(prims[prim].kind, name)) else {
            return self.scanner.pass().map(|_| ());
        };
        let key = (prim, name.to_owned());
        match part {
            _ if type_name == "rel" || part == "connect" => {
                let paths = self.paths()?;
                self.contents.targets.insert(key, paths);
            }
            "" => {
                let value = self.stored(type_name)?;
                let is_blocked = self.contents.values[value.0 as usize].is_blocked;
                self.contents.attributes.entry(key).or_default().default = Some(value).filter(|_| !is_blocked);
            }
            "timeSamples" => {
                let samples = self.samples(type_name)?;
                let attribute = self.contents.attributes.entry(key).or_default();
                (attribute.times, attribute.values) = samples.into_iter().unzip();
            }
            _ => {
                self.scanner.pass()?;
                if part == "spline" {
                    self.contents.splines.insert(key);
                }
            }
        }
        Ok(())
    }

    /// The paths of a value, one or a list of them; none where it is something else.
    fn paths(&mut self) -> Result<Vec<String>, Fault> {
        let mut paths = Vec::new();
        self.scanner.solid()?;
        let start = self.scanner.place();
        self.scanner.has(b'[')?;
        while self.scanner.solid()? == Some(b'<') {
            paths.push(self.scanner.enclosed()?);
            if !self.scanner.has(b',')? {
                break;
            }
        }
        self.scanner.go(start)?;
        self.scanner.pass()?;
        Ok(paths)
    }

    fn stored(&mut self, type_name: &str) -> Result<Value, Fault> {
        let passed = self.scanner.pass()?;
        self.contents.values.push(Stored {
            place: passed.place,
            count: passed.count,
            is_blocked: passed.is_none,
            // As in `double3`, `matrix4d` and `quatd`.
            is_double: type_name.starts_with("double") || type_name.ends_with('d'),
            is_quaternion: type_name.starts_with("quat"),
        });
        Ok(Value(self.contents.values.len() as u64 - 1))
    }

    /// Time codes, ascending, and what is there; of those at one time the last.
    fn samples(&mut self, type_name: &str) -> Result<Vec<(f64, Value)>, Fault> {
        let mut samples = Vec::new();
        self.scanner.expect(b'{')?;
        while !self.scanner.has(b'}')? {
            let time = self.scanner.number()?;
            if !time.is_finite() {
                return Err(self.scanner.wrong("a time code is not finite"));
            }
            self.scanner.expect(b':')?;
            samples.push((time, self.stored(type_name)?));
            self.scanner.has(b',')?;
        }
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        samples.dedup_by(|later, earlier| {
            let is_same = later.0 == earlier.0;
            if is_same {
                *earlier = *later;
            }
            is_same
        });
        Ok(samples)
    }
}
