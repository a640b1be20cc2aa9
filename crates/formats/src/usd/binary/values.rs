//! The values of attributes of a binary layer, and where relationships lead.

use super::file::Rep;
use super::pack::{integers, long_integers};
use super::sections::Path;
use super::{Binary, FILLED, RELATIONSHIP, kind};
use crate::error::Fault;
use crate::frames::Scalar;
use crate::scene::{Points, Track, Value, Values, damaged};
use crate::usd::layer::{Attributes, Target, spline};

impl Binary<'_> {
    /// The paths to which an attribute or a relationship leads, by their numbers.
    fn target_indices(&mut self, prim: usize, name: &str) -> Result<Vec<u32>, Fault> {
        let Some(spec) = self.find(prim, name) else { return Ok(Vec::new()) };
        let field = if spec.kind == RELATIONSHIP { "targetPaths" } else { "connectionPaths" };
        let Some(list) = self.sections.field(spec, field)? else { return Ok(Vec::new()) };
        // Which lists follow, each behind how many paths it has: the first is of those that are there.
        let [head] = self.file.source.array(list.offset())?;
        if list.kind() != kind::PATH_LIST || head & FILLED == 0 {
            return Ok(Vec::new());
        }
        let count = self.file.source.number(list.offset() + 1)?;
        let bytes = self.file.source.bytes(list.offset() + 9, count, 4)?;
        // Of each a name or more.
        self.file.source.allowance.take(count, 32)?;
        Ok(bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect())
    }

    /// Whole numbers of eight bytes, which are taken where four are enough.
    fn long_integers(&mut self, rep: Rep, most: u64) -> Result<Vec<i32>, Fault> {
        let (start, count) = self.file.elements(rep)?;
        if count > most {
            return Err(damaged(&format!("it has {count} numbers where {most} are the most")));
        }
        let numbers: Vec<i64> = if rep.is_packed() && count > 0 {
            let length = self.file.source.number(start)?;
            let packed = self.file.source.bytes(start.saturating_add(8), length, 1)?;
            long_integers(&packed, self.file.source.allowance.take(count, 8)?)?
        } else {
            let bytes = self.file.source.bytes(start, count, 8)?;
            bytes.as_chunks().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect()
        };
        Ok(numbers.into_iter().map(|number| i32::try_from(number).unwrap_or(-1)).collect())
    }
}

impl Attributes for Binary<'_> {
    fn attribute(&mut self, prim: usize, name: &str) -> Result<Track, Fault> {
        let mut attribute = Track::default();
        let Some(spec) = self.find(prim, name) else { return Ok(attribute) };
        let field = |name| self.sections.field(spec, name);
        let (default, samples, curve) = (field("default")?, field("timeSamples")?, field("spline")?);
        if curve.is_some() {
            return Err(spline(name));
        }
        attribute.default = default.filter(|value| value.kind() != kind::BLOCKED).map(|value| Value(value.0));
        if let Some(samples) = samples {
            self.samples(samples, &mut attribute)?;
        }
        Ok(attribute)
    }

    fn properties(&self, prim: usize) -> Vec<(String, String)> {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let type_name = |spec| {
            let told = self.sections.field(spec, "typeName").ok().flatten();
            told.map_or_else(String::new, |told| text(self.sections.token(u32::from_le_bytes(told.inlined()))))
        };
        self.below(prim).map(|(name, spec)| (text(name), type_name(spec))).collect()
    }

    fn interpolation(&mut self, prim: usize, name: &str) -> Result<String, Fault> {
        let Some(spec) = self.find(prim, name) else { return Ok(String::new()) };
        let told = self.sections.field(spec, "interpolation")?;
        Ok(told.map_or(Ok(Vec::new()), |told| self.tokens(Value(told.0), 1))?.concat())
    }

    fn weight(&mut self, prim: usize, name: &str) -> Result<Option<f64>, Fault> {
        let Some(spec) = self.find(prim, name) else { return Ok(None) };
        let told = self.sections.field(spec, "weight")?;
        Ok(told.map_or(Ok(Vec::new()), |told| self.file.numbers(told))?.first().copied())
    }

    fn paths(&mut self, prim: usize, name: &str) -> Result<Vec<String>, Fault> {
        let mut paths = Vec::new();
        for path in self.target_indices(prim, name)? {
            let path = self.sections.path(path);
            self.file.source.allowance.take(path.len() as u64, 1)?;
            paths.push(path);
        }
        Ok(paths)
    }

    fn targets(&mut self, prim: usize, name: &str) -> Result<Vec<Option<Target>>, Fault> {
        let mut targets = Vec::new();
        for path in self.target_indices(prim, name)? {
            let of = |path: u32| self.paths.binary_search(&path).ok();
            let Some(&Path { parent, name, .. }) = self.sections.paths.get(path as usize) else { continue };
            targets.push(match (of(path), of(parent)) {
                (Some(prim), _) => Some((prim, String::new())),
                (None, Some(prim)) => {
                    let name = self.sections.token(name);
                    self.file.source.allowance.take(name.len() as u64, 1)?;
                    Some((prim, String::from_utf8_lossy(name).into_owned()))
                }
                (None, None) => None,
            });
        }
        Ok(targets)
    }

    fn vectors(&mut self, value: Value, width: usize, most: u64) -> Result<Vec<f64>, Fault> {
        self.file.vectors(Rep(value.0), width, most)
    }

    fn reserve(&mut self, count: u64, size: u64) -> Result<(), Fault> {
        self.file.source.allowance.take(count, size).map(|_| ())
    }

    fn tokens(&mut self, value: Value, most: usize) -> Result<Vec<String>, Fault> {
        let rep = Rep(value.0);
        let text = |index: u32| String::from_utf8_lossy(self.sections.token(index)).into_owned();
        if rep.is_inlined() && !rep.is_array() {
            let index = u32::from_le_bytes(rep.inlined());
            match rep.kind() {
                kind::TOKEN | kind::ASSET => return Ok(vec![text(index)]),
                kind::STRING => return Ok(vec![self.sections.string(index)]),
                _ => {}
            }
        }
        let (start, count) = match rep.kind() {
            kind::TOKENS => (rep.offset() + 8, self.file.source.number(rep.offset())?),
            kind::TOKEN if rep.is_array() => self.file.elements(rep)?,
            _ => return Err(damaged("it has another value where a list of names belongs")),
        };
        if count > most as u64 {
            return Err(damaged(&format!("it has a list of {count} names where {most} are the most")));
        }
        let bytes = self.file.source.bytes(start, count, 4)?;
        let mut names = Vec::new();
        for index in bytes.as_chunks().0 {
            let index = u32::from_le_bytes(*index);
            self.file.source.allowance.take(self.sections.token(index).len() as u64, 1)?;
            names.push(String::from_utf8_lossy(self.sections.token(index)).into_owned());
        }
        Ok(names)
    }
}

impl Values for Binary<'_> {
    fn numbers(&mut self, value: Value) -> Result<Vec<f64>, Fault> {
        self.file.numbers(Rep(value.0))
    }

    fn integers(&mut self, value: Value, most: u64) -> Result<Vec<i32>, Fault> {
        let rep = Rep(value.0);
        if rep.kind() == kind::INT64 && rep.is_array() {
            return self.long_integers(rep, most);
        }
        if rep.kind() != kind::INT || !rep.is_array() {
            return Err(damaged("it has another value where a list of whole numbers belongs"));
        }
        let (start, count) = self.file.elements(rep)?;
        if count > most {
            return Err(damaged(&format!("it has {count} numbers of faces where {most} are the most")));
        }
        if !rep.is_packed() || count == 0 {
            let bytes = self.file.source.bytes(start, count, 4)?;
            return Ok(bytes.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect());
        }
        let length = self.file.source.number(start)?;
        let packed = self.file.source.bytes(start + 8, length, 1)?;
        integers(&packed, self.file.source.allowance.take(count, 4)?)
    }

    fn points(&mut self, value: Value) -> Result<Points, Fault> {
        let rep = Rep(value.0);
        let scalar = match (rep.kind(), rep.is_array()) {
            (kind::VEC3D, true) => Scalar::F64Little,
            (kind::VEC3F, true) => Scalar::F32Little,
            (kind::VEC3H, true) => Scalar::F16Little,
            (kind::BLOCKED, _) => {
                let what = "has a time at which its points are blocked; export it with its points at all times";
                return Err(Fault::unsupported(what));
            }
            _ => {
                let what = "has points that are not three numbers each; export it again";
                return Err(Fault::unsupported(what));
            }
        };
        let (start, count) = self.file.elements(rep)?;
        self.file.source.check(start, count, 3 * scalar.size() as u64)?;
        let count = usize::try_from(count).map_err(|_| damaged("it has more points than memory"))?;
        Ok(Points { start, count, scalar })
    }

    fn read(&mut self, points: Points, out: &mut [f64]) -> Result<bool, Fault> {
        self.file.source.values(points.start, points.scalar, out)
    }
}
