//! What a text says: its prims, and where the values of their attributes are.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::scanner::{Place, Scanner, is_letter};
use crate::error::Fault;
use crate::scene::{Node, Track, Value};
use crate::usd::layer::{COMPOSED, DEEPEST, Kind, Prim, Stage, composed, too_deep};

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
fn is_wanted(kind: Kind, name: &str) -> bool {
    let of_kind = match kind {
        Kind::Mesh => name == "normals" || ["primvars:", "crease"].iter().any(|start| name.starts_with(start)),
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
    fn key(&mut self) -> Result<(String, bool), Fault> {
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

    /// What is said in round brackets of a layer, a prim or a property.
    pub(super) fn fields(&mut self, owner: &Owner) -> Result<(), Fault> {
        self.scanner.expect(b'(')?;
        while !self.scanner.has(b')')? {
            // A comment has no key.
            if matches!(self.scanner.solid()?, Some(b'"' | b'\'')) {
                self.scanner.string()?;
                continue;
            }
            let (key, is_removed) = self.key()?;
            self.scanner.expect(b'=')?;
            match (owner, self.open.last()) {
                (Owner::Layer, _) => self.layer_field(&key)?,
                (Owner::Prim(prim), _) => self.prim_field(*prim, &key, is_removed)?,
                (Owner::Property(name), Some(&prim)) if key == "interpolation" => {
                    let value = self.short()?;
                    if is_wanted(self.contents.prims[prim].kind, name) {
                        self.contents.interpolations.insert((prim, name.clone()), value);
                    }
                }
                (Owner::Property(name), Some(&prim))
                    if key == "weight" && self.contents.prims[prim].kind == Kind::Motion =>
                {
                    let weight = self.scanner.number()?;
                    self.contents.weights.insert((prim, name.clone()), weight);
                }
                (Owner::Property(_), _) => {
                    self.scanner.pass()?;
                }
            }
            // The prim in another file, and by how much its times are moved.
            while matches!(self.scanner.solid()?, Some(b'<' | b'(')) {
                self.scanner.pass()?;
            }
        }
        Ok(())
    }

    /// A value that is a word or a string; empty for others, which are passed over.
    pub(super) fn short(&mut self) -> Result<String, Fault> {
        match self.scanner.solid()? {
            Some(b'"' | b'\'') => self.scanner.string(),
            Some(byte) if is_letter(byte) || b"+-.".contains(&byte) => Ok(self.scanner.word(b"+-._")?.to_owned()),
            _ => self.scanner.pass().map(|_| String::new()),
        }
    }

    fn layer_field(&mut self, key: &str) -> Result<(), Fault> {
        if key == "subLayers" {
            let arcs = self.arcs("sublayers")?.ok_or_else(|| composed("the layer", "sublayers"))?;
            self.contents.stage.sublayers = arcs.into_iter().map(|arc| (arc.asset, arc.times)).collect();
            return Ok(());
        }
        let value = self.short()?;
        let number = value.parse().ok();
        let stage = &mut self.contents.stage;
        match key {
            "defaultPrim" => stage.default_prim = value,
            "upAxis" => stage.up_is_z = Some(value == "Z"),
            "metersPerUnit" => stage.metres_per_unit = number,
            "timeCodesPerSecond" => stage.time_codes_per_second = number,
            "framesPerSecond" => stage.frames_per_second = number,
            "startTimeCode" => stage.start = number,
            "endTimeCode" => stage.end = number,
            _ => {}
        }
        Ok(())
    }

    fn prim_field(&mut self, prim: usize, key: &str, is_removed: bool) -> Result<(), Fault> {
        if let Some((_, words)) = COMPOSED[..2].iter().find(|(field, _)| *field == key) {
            match self.arcs(words)?.filter(|_| !is_removed) {
                Some(arcs) => {
                    let all = &mut self.contents.prims[prim].arcs;
                    all.extend(arcs);
                    all.sort_by_key(|arc| arc.words == "payloads");
                }
                None => self.contents.prims[prim].composed = Some(words),
            }
            return Ok(());
        }
        if key == "variants" {
            return self.chosen(prim);
        }
        let value = self.short()?;
        let prim = &mut self.contents.prims[prim];
        if key == "active" {
            prim.is_inactive = matches!(value.as_str(), "false" | "0");
            prim.is_there &= !prim.is_inactive;
        }
        let told = COMPOSED.iter().find(|(field, _)| *field == key);
        prim.composed = told.map(|(_, words)| *words).or(prim.composed);
        Ok(())
    }

    /// A property behind its type, or an order of names, which has none.
    fn property(&mut self, type_name: &str) -> Result<(), Fault> {
        if self.scanner.has(b'[')? {
            self.scanner.expect(b']')?;
        }
        let name = self.word()?;
        if let Some(&prim) = self.open.last()
            && (matches!(self.contents.prims[prim].kind, Kind::Mesh | Kind::Motion)
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
