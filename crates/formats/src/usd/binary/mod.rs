//! Binary layers, which OpenUSD calls crate files: values are read when they are asked for.

mod arcs;
mod clips;
mod file;
pub(super) mod kind;
mod pack;
mod sections;
mod values;

use std::collections::HashMap;
use std::sync::Arc;

use super::layer::{COMPOSED, DEEPEST, Kind, Layer, Prim, Stage, Variant};
use crate::error::Fault;
use crate::scene::{Node, Reader, Source, Track, Value, damaged};
pub(super) use file::MAGIC;
use file::{File, Rep};
pub(super) use sections::{CHILD_ONLY, LAST, SIBLING};
use sections::{Sections, Spec};

pub(super) const ATTRIBUTE: u32 = 1;
pub(super) const PRIM: u32 = 6;
pub(super) const ROOT: u32 = 7;
pub(super) const RELATIONSHIP: u32 = 8;
const VARIANT: u32 = 10;

/// Lists of paths that are there: explicit, added, prepended or appended.
const FILLED: u8 = 0b0110_0110;

/// Versions 0.4.0 to 0.13.0 of the format are read: before them tables were not packed.
const VERSIONS: std::ops::RangeInclusive<u8> = 4..=13;

pub(super) struct Binary<'a> {
    file: File<'a>,
    sections: Sections,
    /// Of each prim.
    paths: Vec<u32>,
    /// Attributes and relationships: the paths above them, ascending, and their specs.
    attributes: Vec<(u32, u32)>,
}

/// The set and the name of a variant, as paths have it.
fn variant(name: &[u8]) -> Option<(&str, &str)> {
    std::str::from_utf8(name.strip_prefix(b"{")?.strip_suffix(b"}")?).ok()?.split_once('=')
}

impl<'a> Binary<'a> {
    /// Opens a layer of `length` bytes, which begins as one does.
    pub(super) fn open(source: Reader<'a>, length: u64) -> Result<Layer<'a>, Fault> {
        // The sections once; then times and lists, many of which may be the same.
        let allowance = length.saturating_mul(64).saturating_add(1 << 16);
        let mut file = File { source: Source::new(source, length, allowance), version: 0 };
        let [major, minor, patch] = file.source.array(MAGIC.len() as u64)?;
        if major != 0 || !VERSIONS.contains(&minor) {
            let what = format!(
                "is of version {major}.{minor}.{patch} of USD's binary format, where 0.{}.0 to 0.{}.0 are read; write \
                 it again in Python (pip install usd-core): from pxr import Sdf; Sdf.Layer.FindOrOpen(\"in.usd\").Export(\"out.usda\")",
                VERSIONS.start(),
                VERSIONS.end()
            );
            return Err(Fault::unsupported(what));
        }
        file.version = minor;
        let contents = file.source.number(16)?;
        let sections = Sections::read(&mut file, contents)?;
        let specs = sections.specs.iter().enumerate();
        let properties = specs.filter(|(_, spec)| [ATTRIBUTE, RELATIONSHIP].contains(&spec.kind));
        let above = |spec: &Spec| sections.paths[spec.path as usize].parent;
        let mut attributes: Vec<_> = properties.map(|(index, spec)| (above(spec), index as u32)).collect();
        attributes.sort_unstable();
        let mut layer = Self { file, sections, paths: Vec::new(), attributes };
        let (nodes, prims) = layer.list_prims()?;
        let stage = layer.read_stage()?;
        Ok(Layer::plain(stage, nodes, prims, Box::new(layer)))
    }

    fn list_prims(&mut self) -> Result<(Vec<Node>, Vec<Prim>), Fault> {
        let (sections, file, mut nodes, mut prims) = (&self.sections, &mut self.file, Vec::new(), Vec::new());
        let mut places = vec![usize::MAX; sections.paths.len()];
        // Many prims may share one.
        let mut names: HashMap<u32, Arc<[u8]>> = HashMap::new();
        for &spec in sections.specs.iter().filter(|spec| [PRIM, VARIANT].contains(&spec.kind)) {
            let path = sections.paths[spec.path as usize];
            places[spec.path as usize] = prims.len();
            let name = names.entry(path.name).or_insert_with(|| Arc::from(sections.token(path.name)));
            nodes.push(Node { name: Arc::clone(name), parent: None, depth: path.depth as usize });
            let mut prim = Prim::new(Kind::Other, false);
            for field in sections.fields(spec) {
                let (name, value) = field?;
                match name {
                    b"typeName" => prim.kind = Kind::of(sections.token(u32::from_le_bytes(value.inlined()))),
                    b"specifier" => prim.is_there = value.inlined() == [0; 4],
                    b"variantSelection" => prim.chosen = arcs::chosen(file, sections, value)?,
                    b"clips" => {
                        prim.clips = clips::read(file, sections, value)?.map(Box::new);
                        prim.composed = if prim.clips.is_none() { Some("value clips") } else { prim.composed };
                    }
                    b"active" => prim.is_inactive = value.inlined()[0] == 0,
                    _ => {
                        let told = COMPOSED.iter().find(|(field, _)| field.as_bytes() == name);
                        if let Some((_, words)) = told {
                            match arcs::read(file, sections, value, words)? {
                                Some(arcs) => prim.arcs.extend(arcs),
                                None => prim.composed = Some(words),
                            }
                        }
                    }
                }
            }
            prim.arcs.sort_by_key(|arc| arc.words == "payloads");
            prim.is_there &= !prim.is_inactive && path.depth <= DEEPEST && spec.kind == PRIM;
            self.paths.push(spec.path);
            prims.push(prim);
        }
        for (k, &path) in self.paths.iter().enumerate() {
            let parent = places[sections.paths[path as usize].parent as usize];
            let above = Some(parent).filter(|&parent| nodes[k].depth > 1 && parent != usize::MAX);
            prims[k].is_there &= nodes[k].depth == 1 || above.is_some();
            // What lies below a variant is there in that variant alone.
            let told = variant(&nodes[k].name);
            match (above, told) {
                (Some(above), Some((set, name))) => {
                    // Many may share a name.
                    file.source.allowance.take(nodes[k].name.len() as u64, 1)?;
                    prims[above].vary(Variant { set: set.into(), name: name.to_owned(), prim: k });
                }
                (above, _) => nodes[k].parent = above,
            }
        }
        Ok((nodes, prims))
    }

    fn read_stage(&mut self) -> Result<Stage, Fault> {
        let Some(&root) = self.sections.specs.iter().find(|spec| spec.kind == ROOT) else {
            return Ok(Stage::default());
        };
        let sublayers = arcs::sublayers(&mut self.file, &self.sections, root)?;
        let mut number = |name: &str| -> Result<Option<f64>, Fault> {
            let Some(value) = self.sections.field(root, name)? else { return Ok(None) };
            Ok(self.file.numbers(value)?.first().copied())
        };
        let mut stage = Stage {
            up_is_z: None,
            metres_per_unit: number("metersPerUnit")?,
            time_codes_per_second: number("timeCodesPerSecond")?,
            frames_per_second: number("framesPerSecond")?,
            start: number("startTimeCode")?,
            end: number("endTimeCode")?,
            default_prim: String::new(),
            sublayers,
        };
        let usual = self
            .sections
            .field(root, "defaultPrim")?
            .map_or(&[][..], |name| self.sections.token(u32::from_le_bytes(name.inlined())));
        stage.default_prim = String::from_utf8_lossy(usual).into_owned();
        let up = self.sections.field(root, "upAxis")?;
        stage.up_is_z = up.map(|up| self.sections.token(u32::from_le_bytes(up.inlined())) == b"Z");
        Ok(stage)
    }

    /// A table whose place is told at `at`, counted from there: behind the place, its value.
    fn told(&mut self, at: u64) -> Result<u64, Fault> {
        let place = at.checked_add(self.file.source.number(at)?);
        place.ok_or_else(|| damaged("an offset leads out of the file"))
    }

    fn samples(&mut self, value: Rep, attribute: &mut Track) -> Result<(), Fault> {
        let at = self.told(value.offset())?;
        let times = Rep(self.file.source.number(at)?);
        if value.kind() != kind::TIME_SAMPLES || times.kind() != kind::DOUBLES {
            return Err(damaged("its time samples are of another type"));
        }
        let count = self.file.source.number(times.offset())?;
        let values = self.told(at + 8)?;
        if self.file.source.number(values)? != count {
            return Err(damaged("it has other times than values"));
        }
        let bytes = self.file.source.bytes(times.offset() + 8, count, 8)?;
        attribute.times = bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let bytes = self.file.source.bytes(values + 8, count, 8)?;
        attribute.values = bytes.as_chunks().0.iter().map(|bytes| Value(u64::from_le_bytes(*bytes))).collect();
        if !attribute.times.is_sorted() || attribute.times.iter().any(|time| !time.is_finite()) {
            return Err(damaged("it has times that do not ascend"));
        }
        Ok(())
    }

    fn find(&self, prim: usize, name: &str) -> Option<Spec> {
        self.below(prim).find(|(found, _)| *found == name.as_bytes()).map(|(_, spec)| spec)
    }

    /// The names of attributes and relationships of a prim, and what they are.
    fn below(&self, prim: usize) -> impl Iterator<Item = (&[u8], Spec)> {
        let path = self.paths[prim];
        let first = self.attributes.partition_point(|&(above, _)| above < path);
        let below = self.attributes[first..].iter().take_while(move |&&(above, _)| above == path);
        let specs = below.map(|&(_, spec)| self.sections.specs[spec as usize]);
        specs.map(|spec| (self.sections.token(self.sections.paths[spec.path as usize].name), spec))
    }
}
