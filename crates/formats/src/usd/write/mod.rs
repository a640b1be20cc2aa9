//! Writes a layer of one polygon mesh below one transform, frame by frame, in version 0.8.0 of the binary format, which USD reads since 2019.

mod sink;
mod tables;

use std::io::{self, Seek, Write};

use cager_geometry::mesh::{Point, Polygons};

use super::binary::{ATTRIBUTE, MAGIC, PRIM, ROOT, kind};
use crate::units::{Units, Up};
use sink::Sink;
use tables::{Next, Tables, integers};

const VERSION: [u8; 3] = [0, 8, 0];
/// Bits of a value: an array, one that is in place of its offset, one that is packed.
const ARRAY: u64 = 1 << 63;
const INLINED: u64 = 1 << 62;
const PACKED: u64 = 1 << 61;
/// Arrays of fewer whole numbers are not packed, nor are those of more, which LZ4 takes in several pieces.
const PACKED_FROM: usize = 16;
const PACKED_TO: usize = 1 << 28;

/// What a file is to hold beside positions and faces.
pub(crate) struct Scene {
    /// Name of the transform, below which the mesh is called `mesh`.
    pub(crate) name: String,
    /// Frames per second.
    pub(crate) fps: f64,
    /// Time codes of all frames, ascending.
    pub(crate) codes: Vec<f64>,
    pub(crate) units: Units,
    /// The translation above the mesh, which keeps exact what lies far away.
    pub(crate) origin: Option<Point>,
    /// Whether the layer is put into a package.
    pub(crate) is_packed: bool,
}

/// A mesh that is being written. Memory does not grow with the frames but by 24 bytes for each.
pub(crate) struct MeshWriter<W> {
    sink: Sink<W>,
    scene: Scene,
    /// Values of how many corners faces have, and which.
    faces: [u64; 2],
    points: Vec<u64>,
    extents: Vec<u64>,
    bytes: Vec<u8>,
}

impl<W: Write + Seek> MeshWriter<W> {
    pub(crate) fn new(out: W, faces: &Polygons, scene: Scene) -> io::Result<Self> {
        let sink = Sink::new(out, scene.is_packed.then(|| format!("{}.usdc", scene.name)))?;
        let (points, extents, bytes) = (Vec::new(), Vec::new(), Vec::new());
        let mut writer = Self { sink, scene, faces: [0; 2], points, extents, bytes };
        let counts: Vec<i32> = faces.arities().iter().map(|&count| count as i32).collect();
        let corners: Vec<i32> = faces.indices().iter().map(|&corner| corner as i32).collect();
        writer.faces = [writer.integers(&counts)?, writer.integers(&corners)?];
        Ok(writer)
    }

    /// Writes a frame, `x y z x y z …`.
    pub(crate) fn write_frame(&mut self, positions: &[f32]) -> io::Result<()> {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for point in positions.as_chunks::<3>().0 {
            for k in 0..3 {
                low[k] = low[k].min(point[k]);
                high[k] = high[k].max(point[k]);
            }
        }
        let points = self.vectors(positions)?;
        self.points.push(points);
        let extent = self.vectors([low, high].as_flattened())?;
        self.extents.push(extent);
        Ok(())
    }

    /// Writes what says where the frames are; gives the file back.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let codes: Vec<u8> = self.scene.codes.iter().flat_map(|code| code.to_le_bytes()).collect();
        let times = self.list(kind::DOUBLES, self.scene.codes.len(), &codes)?;
        let (points, extents) = (std::mem::take(&mut self.points), std::mem::take(&mut self.extents));
        let [points_at, extents_at] = [self.samples(times, &points)?, self.samples(times, &extents)?];
        let first = points.first().copied().unwrap_or(ARRAY | value(kind::VEC3F, 0));

        let mut tables = Tables::default();
        // A first name that no property has, as its negative would be no other number.
        tables.token(";-)");
        let (name, fps) = (self.scene.name.clone(), self.double(self.scene.fps)?);
        let (start, end) = (self.scene.codes.first().copied(), self.scene.codes.last().copied());
        let up = if self.scene.units.up == Up::Z { "Z" } else { "Y" };
        let token = |tables: &mut Tables, text: &str| INLINED | value(kind::TOKEN, tables.token(text).into());
        let root = [
            ("defaultPrim", token(&mut tables, &name)),
            ("endTimeCode", self.double(end.unwrap_or(0.0))?),
            ("framesPerSecond", fps),
            ("metersPerUnit", self.double(self.scene.units.metres_per_unit)?),
            ("startTimeCode", self.double(start.unwrap_or(0.0))?),
            ("timeCodesPerSecond", fps),
            ("upAxis", token(&mut tables, up)),
            ("primChildren", self.tokens(&mut tables, &[&name])?),
        ];
        tables.spec(ROOT, "", Next::Child, &root);

        let defined = ("specifier", INLINED | value(kind::SPECIFIER, 0));
        let uniform = ("variability", INLINED | value(kind::VARIABILITY, 1));
        let mut transform = vec![defined, ("typeName", token(&mut tables, "Xform"))];
        if self.scene.origin.is_some() {
            transform.push(("properties", self.tokens(&mut tables, &[TRANSLATE, ORDER])?));
        }
        transform.push(("primChildren", self.tokens(&mut tables, &["mesh"])?));
        tables.spec(PRIM, &name, Next::Child, &transform);
        if let Some(origin) = self.scene.origin {
            self.sink.align()?;
            let at = self.sink.put(origin.map(f64::to_le_bytes).as_flattened())?;
            let fields = [("typeName", token(&mut tables, "double3")), ("default", value(kind::VEC3D, at))];
            tables.spec(ATTRIBUTE, TRANSLATE, Next::Sibling, &fields);
            let order = ARRAY | self.list(kind::TOKEN, 1, &tables.token(TRANSLATE).to_le_bytes())?;
            let fields = [("typeName", token(&mut tables, "token[]")), uniform, ("default", order)];
            tables.spec(ATTRIBUTE, ORDER, Next::Sibling, &fields);
        }

        let names = ["extent", "faceVertexCounts", "faceVertexIndices", "points", "subdivisionScheme"];
        let properties = ("properties", self.tokens(&mut tables, &names)?);
        let mesh = [defined, ("typeName", token(&mut tables, "Mesh")), properties];
        tables.spec(PRIM, "mesh", Next::Child, &mesh);
        let kinds = ["float3[]", "int[]", "point3f[]", "token"];
        let [extent, integers, point, text] = kinds.map(|kind| ("typeName", token(&mut tables, kind)));
        let [counts, corners] = self.faces;
        tables.spec(ATTRIBUTE, names[0], Next::Sibling, &[extent, ("timeSamples", extents_at)]);
        tables.spec(ATTRIBUTE, names[1], Next::Sibling, &[integers, ("default", counts)]);
        tables.spec(ATTRIBUTE, names[2], Next::Sibling, &[integers, ("default", corners)]);
        // Readers without a time take the first frame.
        tables.spec(ATTRIBUTE, names[3], Next::Sibling, &[point, ("default", first), ("timeSamples", points_at)]);
        // Otherwise programs subdivide it.
        let plain = ("default", token(&mut tables, "none"));
        tables.spec(ATTRIBUTE, names[4], Next::None, &[text, uniform, plain]);

        let contents = tables.write(&mut self.sink)?;
        let head = [&MAGIC[..], &VERSION, &[0; 5], &contents.to_le_bytes()].concat();
        self.sink.close(&head)
    }

    /// Some elements behind how many they are.
    fn list(&mut self, kind: u8, count: usize, bytes: &[u8]) -> io::Result<u64> {
        self.sink.align()?;
        let at = self.sink.put(&(count as u64).to_le_bytes())?;
        self.sink.put(bytes)?;
        Ok(value(kind, at))
    }

    fn vectors(&mut self, numbers: &[f32]) -> io::Result<u64> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        let array = self.list(kind::VEC3F, numbers.len() / 3, &bytes);
        self.bytes = bytes;
        Ok(ARRAY | array?)
    }

    fn integers(&mut self, numbers: &[i32]) -> io::Result<u64> {
        if !(PACKED_FROM..=PACKED_TO).contains(&numbers.len()) {
            let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            return Ok(ARRAY | self.list(kind::INT, numbers.len(), &bytes)?);
        }
        let bytes = integers(numbers);
        let sized = [&(bytes.len() as u64).to_le_bytes()[..], &bytes].concat();
        Ok(ARRAY | PACKED | self.list(kind::INT, numbers.len(), &sized)?)
    }

    fn tokens(&mut self, tables: &mut Tables, names: &[&str]) -> io::Result<u64> {
        let bytes: Vec<u8> = names.iter().flat_map(|name| tables.token(name).to_le_bytes()).collect();
        self.list(kind::TOKENS, names.len(), &bytes)
    }

    fn double(&mut self, number: f64) -> io::Result<u64> {
        if f64::from(number as f32) == number {
            return Ok(INLINED | value(kind::DOUBLE, (number as f32).to_bits().into()));
        }
        self.sink.align()?;
        Ok(value(kind::DOUBLE, self.sink.put(&number.to_le_bytes())?))
    }

    /// Values at times: where the value of these is, counted from there, and where the others are.
    fn samples(&mut self, times: u64, values: &[u64]) -> io::Result<u64> {
        self.sink.align()?;
        let at = self.sink.put(&8_u64.to_le_bytes())?;
        let head = [times, 8, values.len() as u64];
        let bytes: Vec<u8> = head.iter().chain(values).flat_map(|number| number.to_le_bytes()).collect();
        self.sink.put(&bytes)?;
        Ok(value(kind::TIME_SAMPLES, at))
    }
}

const TRANSLATE: &str = "xformOp:translate";
const ORDER: &str = "xformOpOrder";

fn value(kind: u8, payload: u64) -> u64 {
    u64::from(kind) << 48 | payload
}
