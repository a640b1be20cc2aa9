//! The header: which elements follow, and what each is made of.

use crate::colors::Scale;
use crate::error::Fault;
use crate::text::{Lines, damaged, integer, quoted, words};

pub(super) struct Header<'a> {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Pictures that comments name.
    pub(super) textures: Vec<String>,
    /// What follows the header.
    pub(super) body: Lines<'a>,
}

#[derive(Clone, Copy)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Clone, Copy)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

impl Header<'_> {
    /// Number of vertices, which faces are checked against even where they come first.
    pub(super) fn vertices(&self) -> Result<u64, Fault> {
        let mut vertices = self.elements.iter().filter(|element| element.name == "vertex");
        let count = vertices.next().map_or(0, |element| element.count);
        if vertices.next().is_some() {
            return Err(Fault::damaged("has two lists of vertices; export the mesh again"));
        }
        if count > u64::from(u32::MAX) {
            return Err(Fault::damaged(format!(
                "promises {count} vertices, more than 4294967295; export the mesh again"
            )));
        }
        Ok(count)
    }
}

impl Element {
    /// The kind of a property that is a single number.
    pub(super) fn scalar(&self, name: &str) -> Option<Scalar> {
        let mut scalars = self.properties.iter().filter(|property| property.name == name);
        scalars.find_map(|property| if let Kind::Scalar(scalar) = property.kind { Some(scalar) } else { None })
    }

    /// Full light in red, green and blue; `None` where one is missing or of another kind.
    pub(super) fn full_light(&self) -> Option<([f64; 3], Scale)> {
        let mut most = [1.0; 3];
        let mut floats = 0;
        for (most, name) in most.iter_mut().zip(["red", "green", "blue"]) {
            let scalar = self.scalar(name)?;
            *most = match scalar {
                Scalar::U8 => 255.0,
                Scalar::U16 => 65535.0,
                Scalar::F32 | Scalar::F64 => 1.0,
                _ => return None,
            };
            floats += usize::from(scalar.is_float());
        }
        match floats {
            0 => Some((most, Scale::Fractions)),
            3 => Some((most, Scale::Unsaid)),
            _ => None,
        }
    }

    /// Column of the list of vertices of each face or strip, by its name, or the only list.
    pub(super) fn corners(&self) -> Result<usize, Fault> {
        let is_named = |k: &usize| matches!(self.properties[*k].name.as_str(), "vertex_indices" | "vertex_index");
        let lists = || (0..self.properties.len()).filter(|&k| matches!(self.properties[k].kind, Kind::List { .. }));
        let only = || lists().next().filter(|_| lists().count() == 1);
        lists()
            .find(is_named)
            .or_else(only)
            .ok_or_else(|| Fault::unsupported("has faces without vertex_indices; export the mesh with plain polygons"))
    }
}

pub(super) fn parse(bytes: &[u8]) -> Result<Header<'_>, Fault> {
    let mut lines = Lines::new(bytes);
    if lines.next() != Some(b"ply") {
        return Err(Fault::damaged("does not begin with `ply`, so this is not a PLY file; export the mesh again"));
    }
    let (mut encoding, mut textures) = (None, Vec::new());
    let mut elements: Vec<Element> = Vec::new();
    while let Some(line) = lines.next() {
        let words: Vec<_> = words(line).take(6).collect();
        match words.as_slice() {
            [b"format", name, ..] => {
                encoding = Some(match *name {
                    b"ascii" => Encoding::Ascii,
                    b"binary_little_endian" => Encoding::LittleEndian,
                    b"binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(unreadable(&lines, line)),
                });
            }
            [b"element", name, count, ..] => elements.push(Element {
                name: String::from_utf8_lossy(name).into_owned(),
                count: integer(count).ok_or_else(|| unreadable(&lines, line))?,
                properties: Vec::new(),
            }),
            [b"property", kind @ .., name] => {
                let kind = parse_kind(kind).ok_or_else(|| unreadable(&lines, line))?;
                let element = elements.last_mut().ok_or_else(|| unreadable(&lines, line))?;
                element.properties.push(Property { name: String::from_utf8_lossy(name).into_owned(), kind });
            }
            [b"end_header", ..] => {
                let encoding = encoding.ok_or_else(|| Fault::damaged("has no `format` line; export the mesh again"))?;
                return Ok(Header { encoding, elements, textures, body: lines });
            }
            [b"element" | b"property" | b"format", ..] => return Err(unreadable(&lines, line)),
            [b"comment", b"TextureFile", ..] => {
                let name = line.split(|&b| b == b' ').skip(2).collect::<Vec<_>>().join(&b' ');
                textures.push(String::from_utf8_lossy(name.trim_ascii()).into_owned());
            }
            // Comments, and what other programs note.
            _ => {}
        }
    }
    Err(Fault::damaged("ends within its header; copy or export the file again"))
}

fn parse_kind(words: &[&[u8]]) -> Option<Kind> {
    match words {
        [b"list", count, item] => {
            let count = Scalar::parse(count).filter(|count| !count.is_float())?;
            Some(Kind::List { count, item: Scalar::parse(item)? })
        }
        [scalar] => Scalar::parse(scalar).map(Kind::Scalar),
        _ => None,
    }
}

fn unreadable(lines: &Lines<'_>, line: &[u8]) -> Fault {
    damaged(lines.number(), &format!("{} is not understood in a PLY header; export the mesh again", quoted(line)))
}
