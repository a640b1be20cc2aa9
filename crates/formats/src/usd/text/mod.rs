//! Layers of text: read once for where values are, which are parsed when they are asked for.

mod clips;
mod composed;
mod fields;
mod parser;
mod scanner;

use std::collections::HashMap;
use std::sync::Arc;

use super::layer::{Attributes, Layer, Target, spline};
use crate::error::Fault;
use crate::frames::Scalar;
use crate::scene::{Allowance, Points, Reader, Track, Value, Values, damaged};
use parser::{Contents, Parser, Stored};
use scanner::Scanner;

pub(super) const MAGIC: &[u8; 5] = b"#usda";
/// Numbers of one value, those of a matrix.
const MOST_NUMBERS: usize = 16;
/// Arrays of points that stay in memory: those around a frame, and around the next one.
const KEPT: usize = 2;

pub(super) struct Text<'a> {
    scanner: Scanner<'a>,
    contents: Contents,
    /// The prims by the one above each and their names.
    places: HashMap<(Option<usize>, Arc<[u8]>), usize>,
    allowance: Allowance,
    /// Where points were read from, and these; the last ones first.
    read: Vec<(u64, Vec<f64>)>,
}

impl<'a> Text<'a> {
    /// Opens a layer, which begins as one does.
    pub(super) fn open(source: Reader<'a>) -> Result<Layer<'a>, Fault> {
        let mut scanner = Scanner::new(source)?;
        let mut contents = Parser::parse(&mut scanner)?;
        let (nodes, prims) = (std::mem::take(&mut contents.nodes), std::mem::take(&mut contents.prims));
        let stage = std::mem::take(&mut contents.stage);
        let places = nodes.iter().enumerate().map(|(k, node)| ((node.parent, Arc::clone(&node.name)), k)).collect();
        let allowance = Allowance(scanner.at.saturating_mul(64).saturating_add(1 << 16));
        let text = Self { scanner, contents, places, allowance, read: Vec::new() };
        Ok(Layer::plain(stage, nodes, prims, Box::new(text)))
    }

    fn enter(&mut self, value: Value) -> Result<Stored, Fault> {
        let stored = usize::try_from(value.0).ok().and_then(|index| self.contents.values.get(index).copied());
        let stored = stored.ok_or_else(|| damaged("it has a value that is nowhere"))?;
        if stored.is_blocked {
            return Err(Fault::unsupported("has a value that is blocked at a time; export it again"));
        }
        self.scanner.go(stored.place)?;
        Ok(stored)
    }

    /// Whether another value follows in a list, whose last one may have a comma behind it.
    fn follows(&mut self) -> Result<bool, Fault> {
        self.scanner.has(b',')?;
        Ok(!self.scanner.has(b']')?)
    }

    /// The numbers of the next value: a number, or those within brackets.
    fn one(&mut self, is_double: bool, is_quaternion: bool) -> Result<Vec<f64>, Fault> {
        let (mut numbers, mut depth) = (Vec::new(), 0_usize);
        loop {
            if self.scanner.has(b'(')? {
                depth += 1;
            } else if depth > 0 && self.scanner.has(b')')? {
                depth -= 1;
            } else if depth == 0 || !self.scanner.has(b',')? {
                numbers.push(rounded(self.scanner.number()?, is_double));
                if numbers.len() > MOST_NUMBERS {
                    return Err(self.scanner.wrong("a value has more numbers than a matrix"));
                }
            }
            if depth == 0 {
                break;
            }
        }
        if is_quaternion && numbers.len() == 4 {
            numbers.rotate_left(1);
        }
        Ok(numbers)
    }

    fn parse_points(&mut self, index: u64) -> Result<Vec<f64>, Fault> {
        let Stored { count, is_double, .. } = self.enter(Value(index))?;
        let mut values = Vec::with_capacity(3 * count);
        self.scanner.expect(b'[')?;
        while self.follows()? {
            self.scanner.expect(b'(')?;
            for k in 0..3 {
                if k > 0 {
                    self.scanner.expect(b',')?;
                }
                values.push(rounded(self.scanner.number()?, is_double));
            }
            self.scanner.expect(b')')?;
        }
        Ok(values)
    }
}

/// As a type that is not of double precision holds it.
fn rounded(number: f64, is_double: bool) -> f64 {
    if is_double { number } else { f64::from(number as f32) }
}

impl Attributes for Text<'_> {
    fn attribute(&mut self, prim: usize, name: &str) -> Result<Track, Fault> {
        let key = (prim, name.to_owned());
        if self.contents.splines.contains(&key) {
            return Err(spline(name));
        }
        Ok(self.contents.attributes.get(&key).cloned().unwrap_or_default())
    }

    fn properties(&self, prim: usize) -> Vec<(String, String)> {
        self.contents.properties.get(&prim).cloned().unwrap_or_default()
    }

    fn interpolation(&mut self, prim: usize, name: &str) -> Result<String, Fault> {
        Ok(self.contents.interpolations.get(&(prim, name.to_owned())).cloned().unwrap_or_default())
    }

    fn weight(&mut self, prim: usize, name: &str) -> Result<Option<f64>, Fault> {
        Ok(self.contents.weights.get(&(prim, name.to_owned())).copied())
    }

    fn paths(&mut self, prim: usize, name: &str) -> Result<Vec<String>, Fault> {
        Ok(self.contents.targets.get(&(prim, name.to_owned())).cloned().unwrap_or_default())
    }

    fn targets(&mut self, prim: usize, name: &str) -> Result<Vec<Option<Target>>, Fault> {
        let paths = self.paths(prim, name)?;
        let find = |path: &String| {
            let (names, attribute) = path.split_once('.').unwrap_or((path, ""));
            let mut prim = None;
            for name in names.strip_prefix('/')?.split('/') {
                prim = Some(*self.places.get(&(prim, Arc::from(name.as_bytes())))?);
            }
            Some((prim?, attribute.to_owned()))
        };
        Ok(paths.iter().map(find).collect())
    }

    fn vectors(&mut self, value: Value, width: usize, most: u64) -> Result<Vec<f64>, Fault> {
        let Stored { count, is_double, is_quaternion, .. } = self.enter(value)?;
        if count as u64 > most {
            return Err(damaged(&format!("it has {count} vectors where {most} are the most")));
        }
        self.reserve((count * width) as u64, 8)?;
        let is_list = self.scanner.has(b'[')?;
        let mut numbers = Vec::new();
        while !is_list || self.follows()? {
            let vector = self.one(is_double, is_quaternion)?;
            if vector.len() != width {
                return Err(self.scanner.wrong(&format!("{} numbers stand where {width} belong", vector.len())));
            }
            numbers.extend(vector);
            if !is_list {
                break;
            }
        }
        Ok(numbers)
    }

    fn reserve(&mut self, count: u64, size: u64) -> Result<(), Fault> {
        self.allowance.take(count, size).map(|_| ())
    }

    fn tokens(&mut self, value: Value, most: usize) -> Result<Vec<String>, Fault> {
        self.enter(value)?;
        if self.scanner.solid()? == Some(b'@') {
            return Ok(vec![self.scanner.enclosed()?]);
        }
        if !self.scanner.has(b'[')? {
            return Ok(vec![self.scanner.string()?]);
        }
        let mut names = Vec::new();
        while self.follows()? {
            if names.len() == most {
                return Err(damaged(&format!("it has a list of more names than {most}, which are the most")));
            }
            names.push(self.scanner.string()?);
        }
        Ok(names)
    }
}

impl Values for Text<'_> {
    fn numbers(&mut self, value: Value) -> Result<Vec<f64>, Fault> {
        let Stored { is_double, is_quaternion, .. } = self.enter(value)?;
        self.one(is_double, is_quaternion)
    }

    fn integers(&mut self, value: Value, most: u64) -> Result<Vec<i32>, Fault> {
        let count = self.enter(value)?.count;
        if count as u64 > most {
            return Err(damaged(&format!("it has {count} numbers of faces where {most} are the most")));
        }
        let mut numbers = Vec::with_capacity(count);
        self.scanner.expect(b'[')?;
        while self.follows()? {
            let number = self.scanner.number()?;
            if number != number.trunc() || !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&number) {
                return Err(self.scanner.wrong(&format!("{number} stands where a whole number of faces belongs")));
            }
            numbers.push(number as i32);
        }
        Ok(numbers)
    }

    fn points(&mut self, value: Value) -> Result<Points, Fault> {
        let count = self.enter(value)?.count;
        Ok(Points { start: value.0, count, scalar: Scalar::F64Little })
    }

    fn read(&mut self, points: Points, out: &mut [f64]) -> Result<bool, Fault> {
        if let Some(known) = self.read.iter().position(|(index, _)| *index == points.start) {
            self.read[..=known].rotate_right(1);
        } else {
            self.read.truncate(KEPT - 1);
            let values = self.parse_points(points.start)?;
            self.read.insert(0, (points.start, values));
        }
        let values = &self.read[0].1;
        if values.len() != out.len() {
            return Err(damaged("its points are not a list of three numbers each"));
        }
        out.copy_from_slice(values);
        Ok(values.iter().all(|x| x.is_finite()))
    }
}
